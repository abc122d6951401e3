//! Fusion: many maps placed consistently, and made into one.
//!
//! Imports `geometry`, `grid` and `registration`. Pure: no clock, randomness, files or logging.
//!
//! [`weld()`] is the one story that every door tells (the command, the service's one shot, the worker): features of each
//! map, registrations of the pairs, one consistent pose for each map that can be placed, and the fused map in the
//! anchor's frame. Below it: [`register_set`] places maps, [`fuse()`] adds them up.

mod conflicts;
mod fuse;
mod names;

pub use conflicts::{Conflicts, Votes};
pub use fuse::{FuseError, FuseOptions, Fused, PlacedMap, fuse};
pub use names::distinct_names;
