//! Poses and lattices on the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::grid::StateCounts;

/// Kept in records too, so it lives beside them.
pub use crate::model::Pose;

/// How many cells of a map are in each state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct CellCounts {
    /// Cells that nobody has seen, or that are seen but undecided.
    pub unknown: usize,
    /// Free cells.
    pub free: usize,
    /// Occupied cells.
    pub occupied: usize,
}

impl From<StateCounts> for CellCounts {
    fn from(counts: StateCounts) -> Self {
        Self {
            unknown: counts.unknown,
            free: counts.free,
            occupied: counts.occupied,
        }
    }
}
