//! How much wall two maps have in common under a pose, and how much of it stands in the other's free space: a look that
//! needs no method and no search.

use rayon::prelude::*;

use super::conflicts::{Word, near_occupied, words};
use crate::geometry::Pose2;
use crate::grid::{CellState, Lattice, OccupancyGrid};

/// Metres of wall: occupied cells times their size, the mean of both directions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct WallAgreement {
    /// Wall of one map within the tolerance of a wall of the other.
    pub(super) matched_m: f64,
    /// Wall of one map in free space of the other, with no wall of that one within the tolerance.
    pub(super) violated_m: f64,
}

impl WallAgreement {
    /// Share of the compared wall that stands in the other's free space; 0 when nothing was compared.
    pub(super) fn violated_share(&self) -> f64 {
        let compared = self.matched_m + self.violated_m;
        if compared > 0.0 {
            self.violated_m / compared
        } else {
            0.0
        }
    }
}

/// A map, ready to be compared.
#[derive(Debug)]
pub(super) struct Walls {
    lattice: Lattice,
    words: Vec<Word>,
    near: Vec<bool>,
    occupied: Vec<(u32, u32)>,
}

impl Walls {
    pub(super) fn of(grid: &OccupancyGrid, tolerance_m: f64) -> Self {
        let lattice = *grid.lattice();
        let mut occupied = Vec::new();
        for row in 0..lattice.height() {
            for (column, cell) in (0_u32..).zip(grid.row(row)) {
                if cell.state() == CellState::Occupied {
                    occupied.push((column, row));
                }
            }
        }
        Self {
            lattice,
            words: words(grid, tolerance_m),
            near: near_occupied(grid, tolerance_m),
            occupied,
        }
    }
}

/// Compares two maps whose tolerance was the same.
pub(super) fn agreement(fixed: &Walls, moving: &Walls, pose_fixed_moving: Pose2) -> WallAgreement {
    let (one, other) = (
        look_up(moving, fixed, pose_fixed_moving),
        look_up(fixed, moving, pose_fixed_moving.inverse()),
    );
    WallAgreement {
        matched_m: f64::midpoint(one.matched_m, other.matched_m),
        violated_m: f64::midpoint(one.violated_m, other.violated_m),
    }
}

/// The walls of `from` on the map `to`.
fn look_up(from: &Walls, to: &Walls, pose_to_from: Pose2) -> WallAgreement {
    let to_cells = (to.lattice.origin().inverse() * pose_to_from * from.lattice.origin()).motion();
    let (size, resolution) = (from.lattice.resolution(), to.lattice.resolution());
    let (matched, violated) = from
        .occupied
        .par_chunks(4096)
        .map(|cells| {
            let (mut matched, mut violated) = (0_u32, 0_u32);
            for &(column, row) in cells {
                let [x, y] = to_cells.apply([(f64::from(column) + 0.5) * size, (f64::from(row) + 0.5) * size]);
                if let Some((i, j)) = to.lattice.cell_of([x / resolution, y / resolution]) {
                    let index = to.lattice.index(i, j);
                    matched += u32::from(to.near[index]);
                    violated += u32::from(to.words[index] == Word::Free);
                }
            }
            (matched, violated)
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    WallAgreement {
        matched_m: f64::from(matched) * size,
        violated_m: f64::from(violated) * size,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::grid::LogOdds;

    /// A free room of 4 m x 3 m with walls around.
    fn room() -> OccupancyGrid {
        let lattice = Lattice::new(80, 60, 0.05, Pose2::IDENTITY).expect("valid");
        let mut grid = OccupancyGrid::new(lattice, vec![LogOdds::FREE; 4800]).expect("as many");
        for row in 0..60 {
            for column in 0..80 {
                if row == 0 || row == 59 || column == 0 || column == 79 {
                    grid.cells_mut()[lattice.index(column, row)] = LogOdds::OCCUPIED;
                }
            }
        }
        grid
    }

    #[test]
    fn a_map_agrees_with_itself_and_not_with_itself_moved() {
        let walls = Walls::of(&room(), 0.1);
        let same = agreement(&walls, &walls, Pose2::IDENTITY);
        assert!((same.matched_m - 0.05 * 276.0).abs() < 1e-9);
        assert!(same.violated_share() < 1e-9);
        let turned = agreement(&walls, &walls, Pose2::new(1.0, 1.0, Angle::from_degrees(30.0)));
        assert!(turned.violated_share() > 0.6, "{turned:?}");
    }
}
