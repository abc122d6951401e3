//! Time and ids: the one place that asks the machine for them. Everybody else is handed a [`Clock`] or [`Ids`].
//!
//! Imports nothing of the crate.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use jiff::{SignedDuration, Timestamp, Unit};
use uuid::Uuid;

/// Tells what time it is.
pub trait Clock: Send + Sync {
    /// The time, in whole microseconds, as the records keep it.
    fn now(&self) -> Timestamp;

    /// Time since some fixed moment; never goes back.
    fn monotonic(&self) -> Duration;
}

/// Makes ids.
pub trait Ids: Send + Sync {
    /// A new `UUIDv7`, later ones ordered after earlier ones.
    fn next(&self) -> Uuid;
}

/// The machine's own clock.
#[derive(Debug, Clone, Copy)]
pub struct SystemClock {
    start: Instant,
}

impl SystemClock {
    /// The machine's clock; [`Clock::monotonic`] counts from here.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "the one door to the machine's time")]
    pub fn new() -> Self {
        Self { start: Instant::now() }
    }
}

impl Default for SystemClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for SystemClock {
    #[expect(clippy::disallowed_methods, reason = "the one door to the machine's time")]
    fn now(&self) -> Timestamp {
        whole_microseconds(Timestamp::now())
    }

    fn monotonic(&self) -> Duration {
        self.start.elapsed()
    }
}

fn whole_microseconds(time: Timestamp) -> Timestamp {
    time.round(Unit::Microsecond)
        .expect("invariant: today rounds to a time that can be told")
}

/// Ids from the machine's clock and its randomness.
#[derive(Debug, Clone, Copy, Default)]
pub struct SystemIds;

impl Ids for SystemIds {
    #[expect(clippy::disallowed_methods, reason = "the one door to the machine's ids")]
    fn next(&self) -> Uuid {
        Uuid::now_v7()
    }
}

/// A clock that stands still until it is told to go on: for tests.
#[derive(Debug)]
pub struct ManualClock {
    start: Timestamp,
    now: Mutex<Timestamp>,
}

impl ManualClock {
    /// A clock that stands at `start`.
    #[must_use]
    pub fn new(start: Timestamp) -> Self {
        let start = whole_microseconds(start);
        Self {
            start,
            now: Mutex::new(start),
        }
    }

    /// Goes on by `step`.
    ///
    /// # Panics
    /// When that is past the year 9999.
    pub fn advance(&self, step: Duration) {
        let mut now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        *now = whole_microseconds(*now + step);
    }
}

impl Clock for ManualClock {
    fn now(&self) -> Timestamp {
        *self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn monotonic(&self) -> Duration {
        SignedDuration::unsigned_abs(self.now().duration_since(self.start))
    }
}

/// The same ids in every run: for tests.
#[derive(Debug, Default)]
pub struct ManualIds(AtomicU64);

impl Ids for ManualIds {
    fn next(&self) -> Uuid {
        let count = self.0.fetch_add(1, Ordering::Relaxed);
        uuid::Builder::from_unix_timestamp_millis(count, &[0; 10]).into_uuid()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machines_time_is_told_in_whole_microseconds() {
        assert_eq!(SystemClock::new().now().subsec_nanosecond() % 1000, 0);
    }

    #[test]
    fn a_manual_clock_stands_still_until_it_is_told_to_go_on() {
        let clock = ManualClock::new(Timestamp::UNIX_EPOCH);
        assert_eq!(clock.now(), clock.now());
        clock.advance(Duration::from_millis(1500));
        assert_eq!(clock.now().as_millisecond(), 1500);
        assert_eq!(clock.monotonic(), Duration::from_millis(1500));
    }

    #[test]
    fn ids_are_ordered_and_of_version_seven() {
        let manual = ManualIds::default();
        for ids in [&SystemIds as &dyn Ids, &manual] {
            let (first, second) = (ids.next(), ids.next());
            assert!(first < second);
            assert_eq!(first.get_version_num(), 7);
        }
    }
}
