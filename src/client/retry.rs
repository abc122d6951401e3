//! When to try again: exponential back-off with jitter from a seed, and what the server asks for by Retry-After.

use std::time::Duration;

use rand_core::Rng;
use rand_pcg::Pcg32;

/// How patient a client is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patience {
    /// Wait before the second attempt; doubles with each further one.
    pub first_wait: Duration,
    /// The longest wait that the client chooses by itself.
    pub longest_wait: Duration,
    /// After this long in all, the client gives up.
    pub give_up_after: Duration,
}

impl Default for Patience {
    /// Rides out the restart of a server (seconds), and tells a robot that it is alone within two minutes.
    fn default() -> Self {
        Self {
            first_wait: Duration::from_millis(200),
            longest_wait: Duration::from_secs(10),
            give_up_after: Duration::from_mins(2),
        }
    }
}

/// The waits of one call, one after the other.
///
/// Each lies between half of the doubling wait and the whole of it, so that robots which lost the same server do not
/// come back in step; where in between is the seed's choice.
#[derive(Debug, Clone)]
pub struct Backoff {
    patience: Patience,
    attempts: u32,
    waited: Duration,
    random: Pcg32,
}

impl Backoff {
    /// Starts before the first attempt.
    #[must_use]
    pub fn new(patience: Patience, seed: u64) -> Self {
        Self {
            patience,
            attempts: 0,
            waited: Duration::ZERO,
            random: Pcg32::new(seed, 0x6d61_7077),
        }
    }

    /// How many attempts have failed so far.
    #[must_use]
    pub fn attempts(&self) -> u32 {
        self.attempts
    }

    /// After a failed attempt: how long to wait for the next one, at least as long as the server asked for, or `None`
    /// when that would take more patience than there is.
    pub fn next_wait(&mut self, retry_after: Option<Duration>) -> Option<Duration> {
        let doubled = self
            .patience
            .first_wait
            .saturating_mul(1_u32.checked_shl(self.attempts).unwrap_or(u32::MAX));
        let longest = doubled.min(self.patience.longest_wait);
        let share = 0.5 + 0.5 * f64::from(self.random.next_u32()) / f64::from(u32::MAX);
        let wait = longest.mul_f64(share).max(retry_after.unwrap_or_default());
        self.attempts += 1;
        self.waited = self.waited.saturating_add(wait);
        (self.waited <= self.patience.give_up_after).then_some(wait)
    }
}

/// The time that a Retry-After header asks for (RFC 9110, 10.2.3): seconds, or an HTTP date, which is taken relative to
/// the answer's own Date, so that a robot with a wrong clock waits as long as it should.
#[must_use]
pub(super) fn retry_after(header: &str, date: Option<&str>) -> Option<Duration> {
    let header = header.trim();
    if let Ok(seconds) = header.parse::<u64>() {
        return Some(Duration::from_secs(seconds));
    }
    let until = http_date(header)?;
    let now = http_date(date?)?;
    Some(Duration::try_from(until.duration_since(now)).unwrap_or_default())
}

fn http_date(text: &str) -> Option<jiff::Timestamp> {
    jiff::fmt::rfc2822::DateTimeParser::new()
        .parse_timestamp(text.trim())
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn patience() -> Patience {
        Patience {
            first_wait: SECOND,
            longest_wait: SECOND * 8,
            give_up_after: SECOND * 60,
        }
    }

    proptest! {
        #[test]
        fn waits_double_up_to_the_longest_and_end_when_patience_does(seed: u64) {
            let mut backoff = Backoff::new(patience(), seed);
            let mut waited = Duration::ZERO;
            let mut whole = SECOND;
            while let Some(wait) = backoff.next_wait(None) {
                prop_assert!(wait >= whole / 2 && wait <= whole, "{wait:?} is not in the upper half of {whole:?}");
                waited += wait;
                whole = (whole * 2).min(SECOND * 8);
            }
            prop_assert!(waited <= SECOND * 60 && waited > SECOND * 52);
        }
    }

    #[test]
    fn the_same_seed_waits_the_same() {
        let waits = |seed| {
            let mut backoff = Backoff::new(patience(), seed);
            std::iter::from_fn(move || backoff.next_wait(None)).collect::<Vec<_>>()
        };
        assert_eq!(waits(7), waits(7));
        assert_ne!(waits(7), waits(8));
    }

    #[test]
    fn the_server_is_never_asked_sooner_than_it_said() {
        let mut backoff = Backoff::new(patience(), 1);
        assert_eq!(backoff.next_wait(Some(SECOND * 20)), Some(SECOND * 20));
        assert_eq!(
            backoff.next_wait(Some(SECOND * 50)),
            None,
            "70 s in all are more than the 60 s of patience"
        );
    }

    #[test]
    fn retry_after_is_read_as_seconds_and_as_a_date() {
        assert_eq!(retry_after("3", None), Some(SECOND * 3));
        let date = Some("Sun, 22 Nov 2026 10:00:00 GMT");
        assert_eq!(retry_after("Sun, 22 Nov 2026 10:00:05 GMT", date), Some(SECOND * 5));
        assert_eq!(retry_after("Sun, 22 Nov 2026 09:00:05 GMT", date), Some(Duration::ZERO));
        assert_eq!(retry_after("Sun, 22 Nov 2026 10:00:05 GMT", None), None);
        assert_eq!(retry_after("soon", date), None);
    }
}
