//! Occupancy grids: cells on a lattice, each unknown or a log odds.
//!
//! Imports `geometry` only. Pure values: no files, clock, randomness or logging.

mod lattice;
mod log_odds;
mod resample;

use std::collections::TryReserveError;

pub use lattice::{Lattice, LatticeError};
pub use log_odds::{CellState, LogOdds, LogOddsSum};
pub use resample::{Sampler, resample, resample_onto};

/// An occupancy grid map (paper section 3.2): one [`LogOdds`] a cell, row 0 the lowest row, on a [`Lattice`].
///
/// Two bytes a cell. Invariant: as many cells as the lattice has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OccupancyGrid {
    lattice: Lattice,
    cells: Vec<LogOdds>,
}

/// How many cells of a map are in each state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StateCounts {
    /// Cells that nobody has seen, or that are seen but undecided.
    pub unknown: usize,
    /// Cells that are free.
    pub free: usize,
    /// Cells that are occupied.
    pub occupied: usize,
}

impl StateCounts {
    /// Free and occupied cells together.
    #[must_use]
    pub fn known(self) -> usize {
        self.free + self.occupied
    }
}

impl OccupancyGrid {
    /// A grid of these cells, row by row from the lowest; `None` when their number is not the lattice's.
    #[must_use]
    pub fn new(lattice: Lattice, cells: Vec<LogOdds>) -> Option<Self> {
        (cells.len() == lattice.cell_count()).then_some(Self { lattice, cells })
    }

    /// A grid that knows nothing.
    #[must_use]
    pub fn unknown(lattice: Lattice) -> Self {
        Self {
            lattice,
            cells: vec![LogOdds::UNKNOWN; lattice.cell_count()],
        }
    }

    /// As [`OccupancyGrid::unknown`], but an allocation that the machine refuses is an error, not an abort.
    ///
    /// # Errors
    /// When the memory is not to be had.
    pub fn try_unknown(lattice: Lattice) -> Result<Self, TryReserveError> {
        let mut cells = Vec::new();
        cells.try_reserve_exact(lattice.cell_count())?;
        cells.resize(lattice.cell_count(), LogOdds::UNKNOWN);
        Ok(Self { lattice, cells })
    }

    /// Where the cells lie.
    #[must_use]
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// All cells, row by row from the lowest.
    #[must_use]
    pub fn cells(&self) -> &[LogOdds] {
        &self.cells
    }

    /// All cells, to be changed in place.
    pub fn cells_mut(&mut self) -> &mut [LogOdds] {
        &mut self.cells
    }

    /// The cells of one row, from the left.
    ///
    /// # Panics
    /// When there is no such row.
    #[must_use]
    pub fn row(&self, row: u32) -> &[LogOdds] {
        let width = self.lattice.width() as usize;
        &self.cells[row as usize * width..][..width]
    }

    /// The log odds of one cell.
    ///
    /// # Panics
    /// When the lattice has no such cell.
    #[must_use]
    pub fn at(&self, column: u32, row: u32) -> LogOdds {
        self.cells[self.lattice.index(column, row)]
    }

    /// How many cells are in each state.
    #[must_use]
    pub fn state_counts(&self) -> StateCounts {
        let mut counts = StateCounts::default();
        for cell in &self.cells {
            match cell.state() {
                CellState::Unknown => counts.unknown += 1,
                CellState::Free => counts.free += 1,
                CellState::Occupied => counts.occupied += 1,
            }
        }
        counts
    }

    /// Area of the free and occupied cells, in square metres.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "cell counts stay far below 2^52")]
    pub fn known_area(&self) -> f64 {
        self.state_counts().known() as f64 * self.lattice.resolution().powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_holds_exactly_the_cells_of_its_lattice() {
        let lattice = Lattice::new(2, 3, 0.05, crate::geometry::Pose2::IDENTITY).expect("a valid lattice");
        assert!(OccupancyGrid::new(lattice, vec![LogOdds::FREE; 6]).is_some());
        assert!(OccupancyGrid::new(lattice, vec![LogOdds::FREE; 5]).is_none());
    }

    #[test]
    fn counts_tell_the_three_states_apart() {
        let lattice = Lattice::new(3, 1, 0.5, crate::geometry::Pose2::IDENTITY).expect("a valid lattice");
        let grid =
            OccupancyGrid::new(lattice, vec![LogOdds::UNKNOWN, LogOdds::FREE, LogOdds::OCCUPIED]).expect("three");
        assert_eq!(
            grid.state_counts(),
            StateCounts {
                unknown: 1,
                free: 1,
                occupied: 1
            }
        );
        assert!((grid.known_area() - 0.5).abs() < 1e-12);
    }
}
