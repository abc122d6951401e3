//! How far an experiment has come.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::registration::Control;

/// Counts what is done, from any thread.
pub(super) struct Steps<'a> {
    control: &'a dyn Control,
    done: AtomicUsize,
    total: usize,
}

impl<'a> Steps<'a> {
    pub(super) fn new(control: &'a dyn Control, total: usize) -> Self {
        control.progress(0, total);
        Self {
            control,
            done: AtomicUsize::new(0),
            total,
        }
    }

    /// One more is done.
    pub(super) fn step(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.control.progress(done, self.total);
    }
}
