//! What the service survives, and what it keeps while it does: servers that are killed, stopped and frozen, databases that
//! go away, folders that are full.
//!
//! Each test has a short form, which runs with all the others, and a full form: `MAPWELD_KILLS=300` for the kills,
//! `MAPWELD_JOBS=200` for the replicas. Each prints its figures on standard error.

mod container;
mod database_outage;
mod folder_outage;
mod home;
mod kills;
mod ledger;
mod proxy;
mod recovery;
mod replica;
mod replicas;
mod stop;
mod watching;

use std::io::Write as _;
use std::time::Duration;

/// Longest time for anything that a test waits for.
const PATIENCE: Duration = Duration::from_mins(2);

/// A number that makes a test longer than it is among the others.
pub(crate) fn full_form(variable: &str, short: usize) -> usize {
    match std::env::var(variable) {
        Ok(number) => number
            .parse()
            .unwrap_or_else(|_| panic!("{variable} is {number:?}; it must be a whole number")),
        Err(_) => short,
    }
}

/// Prints past the capture of the test harness, which hides what tests that pass have said.
pub(crate) fn tell(figures: &str) {
    let _ = writeln!(std::io::stderr(), "{figures}");
}

/// Random numbers that are the same in every run.
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// `SplitMix64` (Steele, Lea, Flood: Fast splittable pseudorandom number generators, OOPSLA 2014).
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// Below `most`.
    pub(crate) fn below(&mut self, most: usize) -> usize {
        usize::try_from(self.next() % most as u64).expect("below a usize")
    }

    /// Milliseconds, from `least` on and below `most`.
    fn milliseconds(&mut self, least: u64, most: u64) -> Duration {
        Duration::from_millis(least + self.next() % (most - least))
    }
}
