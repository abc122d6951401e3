//! How often one key may ask.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::model::KeyId;

/// So many requests a second for each key, and so many at once after a pause: a leaky bucket, kept as the moment at
/// which it will be empty (the generic cell rate algorithm, ITU-T I.371).
///
/// Only good keys are counted, so the table is as large as the number of keys in use.
pub(in crate::http) struct RateLimit {
    /// From one request to the next; none when there is no limit.
    pace: Option<Duration>,
    /// How far a key may be ahead of its pace.
    ahead: Duration,
    empty_at: Mutex<HashMap<KeyId, Duration>>,
}

/// Entries beyond which those of resting keys are forgotten.
const ENTRIES: usize = 1024;

impl RateLimit {
    /// `per_second` requests, 0 for any number; `burst` at once.
    pub(in crate::http) fn new(per_second: u32, burst: u32) -> Self {
        let pace = (per_second > 0).then(|| Duration::from_secs(1) / per_second);
        Self {
            pace,
            ahead: pace.unwrap_or_default() * burst.saturating_sub(1),
            empty_at: Mutex::default(),
        }
    }

    /// Counts a request at `now`; or says how long to wait for the next one.
    pub(super) fn admit(&self, key: KeyId, now: Duration) -> Result<(), Duration> {
        let Some(pace) = self.pace else { return Ok(()) };
        let mut empty_at = self.empty_at.lock().unwrap_or_else(PoisonError::into_inner);
        if empty_at.len() > ENTRIES {
            empty_at.retain(|_, at| *at > now);
        }
        let at = empty_at.entry(key).or_insert(now);
        let ahead = at.saturating_sub(now);
        if ahead > self.ahead {
            return Err(ahead.saturating_sub(self.ahead));
        }
        *at = now + ahead + pace;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(number: u128) -> KeyId {
        KeyId::new(uuid::Uuid::from_u128(number))
    }

    const NOW: Duration = Duration::from_secs(100);

    #[test]
    fn a_key_has_its_burst_and_then_its_pace() {
        let limit = RateLimit::new(10, 3);
        for _ in 0..3 {
            assert_eq!(limit.admit(key(1), NOW), Ok(()));
        }
        let wait = limit.admit(key(1), NOW).expect_err("the burst is over");
        assert_eq!(wait, Duration::from_millis(100));
        assert_eq!(limit.admit(key(1), NOW + wait), Ok(()), "after the wait that was told");
        assert!(limit.admit(key(1), NOW + wait).is_err());
        let rested = NOW + Duration::from_secs(5);
        let at_once = (0..9).filter(|_| limit.admit(key(1), rested).is_ok()).count();
        assert_eq!(at_once, 3, "rest saves up one burst, no more");
    }

    #[test]
    fn one_key_does_not_use_up_what_another_has() {
        let limit = RateLimit::new(1, 1);
        assert_eq!(limit.admit(key(1), NOW), Ok(()));
        assert!(limit.admit(key(1), NOW).is_err());
        assert_eq!(limit.admit(key(2), NOW), Ok(()));
    }

    #[test]
    fn no_rate_is_no_limit_and_resting_keys_are_forgotten() {
        let none = RateLimit::new(0, 1);
        assert!((0..1000).all(|_| none.admit(key(1), NOW).is_ok()));
        let limit = RateLimit::new(1, 1);
        for number in 0..=ENTRIES as u128 {
            limit.admit(key(number), NOW).expect("its first");
        }
        limit.admit(key(5), NOW + Duration::from_mins(1)).expect("rested");
        assert_eq!(limit.empty_at.lock().expect("no panic").len(), 1);
    }
}
