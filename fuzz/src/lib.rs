//! What the fuzz targets share: a reader each, and inputs to begin with. `tests/readers.rs` reads mutated inputs with the
//! same code, without libFuzzer.
//!
//! A panic is a find.

mod readers;
mod seeds;

pub use readers::{limits, must_be_kept, occupancy_grid, picture, yaml};
pub use seeds::seeds;
