//! The clock of the commands that compute in this process.

use std::time::{Duration, Instant};

use crate::registration::{Control, Stop};

/// Tells the time since it was started, and never stops the work: a person has Ctrl-C.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch {
    started: Instant,
}

impl Stopwatch {
    /// Starts now.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "commands read the clock themselves")]
    pub fn start() -> Self {
        Self {
            started: Instant::now(),
        }
    }

    /// Time since the start.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }
}

impl Control for Stopwatch {
    fn now(&self) -> Duration {
        self.elapsed()
    }

    fn should_stop(&self) -> Option<Stop> {
        None
    }
}
