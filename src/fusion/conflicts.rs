//! Which cells maps contradict: what one calls occupied and another free.
//!
//! A pose that is off by half a cell puts every wall next to itself, and nobody would call that a contradiction. So a
//! map's word for free counts here only where it has no wall of its own within a tolerance.

use rayon::prelude::*;

use super::bitmap::Bitmap;
use crate::grid::{CellState, OccupancyGrid};

/// How many maps call a cell occupied, and how many call it free with no wall of theirs nearby.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Votes {
    /// Maps that say occupied (255 stands for all beyond).
    pub occupied: u8,
    /// Maps that say free, and see no wall within the tolerance (255 stands for all beyond).
    pub free: u8,
}

impl Votes {
    /// Whether some map says occupied where another one says free.
    #[must_use]
    pub fn contradict(self) -> bool {
        self.occupied > 0 && self.free > 0
    }
}

/// The votes on every cell of a fused map, row by row from the lowest, on the fused map's lattice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Conflicts {
    votes: Vec<Votes>,
}

impl Conflicts {
    pub(super) fn new(votes: Vec<Votes>) -> Self {
        Self { votes }
    }

    /// The votes on each cell.
    #[must_use]
    pub fn votes(&self) -> &[Votes] {
        &self.votes
    }

    /// Whether the maps contradict each other, cell by cell.
    #[must_use]
    pub fn mask(&self) -> Vec<bool> {
        self.votes.iter().map(|votes| votes.contradict()).collect()
    }

    /// How many cells the maps contradict.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.votes.iter().filter(|votes| votes.contradict()).count()
    }
}

/// What one map says of a cell when maps are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Word {
    /// Nothing, or free but within the tolerance of its own wall.
    Silent,
    /// Free, and no wall of its own within the tolerance.
    Free,
    /// Occupied.
    Occupied,
}

/// What a map says of each of its cells.
pub(super) fn words(grid: &OccupancyGrid, tolerance_m: f64) -> Vec<Word> {
    let near = near_occupied(grid, tolerance_m);
    let width = grid.lattice().width() as usize;
    let mut words = vec![Word::Silent; grid.cells().len()];
    let rows = words.par_chunks_mut(width).zip(grid.cells().par_chunks(width));
    rows.zip(0..grid.lattice().height()).for_each(|((words, cells), row)| {
        for ((word, cell), column) in words.iter_mut().zip(cells).zip(0..) {
            *word = match cell.state() {
                CellState::Occupied => Word::Occupied,
                CellState::Free if !near.has(column, row) => Word::Free,
                _ => Word::Silent,
            };
        }
    });
    words
}

/// The cells with an occupied cell within the tolerance (rounded to whole cells, along the lattice's axes).
fn near_occupied(grid: &OccupancyGrid, tolerance_m: f64) -> Bitmap {
    let occupied = Bitmap::of(grid, |state| state == CellState::Occupied);
    occupied.widened(reach_cells(grid, tolerance_m))
}

/// A tolerance in metres as whole cells of a grid.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped just before"
)]
pub(super) fn reach_cells(grid: &OccupancyGrid, tolerance_m: f64) -> usize {
    (tolerance_m / grid.lattice().resolution()).round().clamp(0.0, 1000.0) as usize
}

#[cfg(test)]
mod tests {
    use super::Word::{Free, Occupied, Silent};
    use super::*;
    use crate::geometry::Pose2;
    use crate::grid::{Lattice, LogOdds};

    #[test]
    fn free_next_to_an_own_wall_is_no_word_against_another_maps_wall() {
        let lattice = Lattice::new(7, 1, 0.05, Pose2::IDENTITY).expect("valid");
        let mut cells = vec![LogOdds::FREE; 7];
        cells[0] = LogOdds::OCCUPIED;
        cells[6] = LogOdds::UNKNOWN;
        let grid = OccupancyGrid::new(lattice, cells).expect("seven");
        assert_eq!(words(&grid, 0.1), [Occupied, Silent, Silent, Free, Free, Free, Silent]);
        assert_eq!(words(&grid, 0.0), [Occupied, Free, Free, Free, Free, Free, Silent]);
    }
}
