//! How a caller stops a registration, and how a registration tells the time without a clock of its own.

use std::time::Duration;

/// Looked at between the stages of every method. Implemented where clocks are allowed.
pub trait Control: Sync {
    /// Time since some fixed moment; used only to tell how long each stage took.
    fn now(&self) -> Duration;

    /// Whether to give up now, and why.
    fn should_stop(&self) -> Option<Stop>;

    /// Told as work on many pairs goes on, from any thread and in any order: so many of so many are done.
    fn progress(&self, done: usize, total: usize) {
        let _ = (done, total);
    }
}

/// Why a caller wants a computation to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// The deadline has passed.
    Deadline,
    /// Somebody cancelled the work.
    Cancelled,
}

/// Never stops, tells no time: for tests and for callers who do not care.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unhurried;

impl Control for Unhurried {
    fn now(&self) -> Duration {
        Duration::ZERO
    }

    fn should_stop(&self) -> Option<Stop> {
        None
    }
}
