//! Where a map's walls lie, in three numbers: enough to say exactly how far two poses of the map are apart.

use super::bitmap::Bitmap;
use crate::geometry::{Point, Pose2};
use crate::grid::{CellState, OccupancyGrid};

/// Mean position of a map's occupied cells, and their mean square distance from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    mean: Point,
    spread2: f64,
}

impl Moments {
    /// Of points around `mean` (in the map's frame, metres) at an RMS distance of `spread_m` metres.
    #[must_use]
    pub fn new(mean: Point, spread_m: f64) -> Self {
        Self {
            mean,
            spread2: spread_m * spread_m,
        }
    }

    /// Of a map's occupied cells; of all its cells when none is occupied.
    #[must_use]
    pub fn of(grid: &OccupancyGrid) -> Self {
        Self::of_cells(grid, &Bitmap::of(grid, |state| state == CellState::Occupied))
    }

    /// Of a map of which these cells are occupied.
    pub(super) fn of_cells(grid: &OccupancyGrid, occupied: &Bitmap) -> Self {
        let lattice = grid.lattice();
        let mut sums = Sums::of(occupied.cells());
        if sums.count == 0 {
            sums = Sums::of(Bitmap::of(grid, |_| true).cells());
        }
        let ([u, v], spread2) = sums.moments();
        Self {
            mean: lattice.to_metres([u + 0.5, v + 0.5]),
            spread2: spread2 * lattice.resolution().powi(2),
        }
    }

    /// The mean position in the map's frame.
    #[must_use]
    pub fn mean(&self) -> Point {
        self.mean
    }

    /// RMS distance of the points from their mean, in metres.
    #[must_use]
    pub fn spread_m(&self) -> f64 {
        self.spread2.sqrt()
    }

    /// RMS distance in metres between the map's occupied cells under two poses. Exact, without a look at the cells.
    #[must_use]
    pub fn distance(&self, one: Pose2, other: Pose2) -> f64 {
        let ([ax, ay], [bx, by]) = (one.apply(self.mean), other.apply(self.mean));
        let half_turn = (one.yaw() - other.yaw()).radians() / 2.0;
        ((ax - bx).powi(2) + (ay - by).powi(2) + 4.0 * half_turn.sin().powi(2) * self.spread2).sqrt()
    }
}

/// Whole-number sums over lattice coordinates: exact in any order.
#[derive(Default)]
struct Sums {
    count: u64,
    u: u64,
    v: u64,
    uu: u128,
    vv: u128,
}

impl Sums {
    fn of(cells: impl Iterator<Item = (u32, u32)>) -> Self {
        let mut sums = Self::default();
        for (column, row) in cells {
            let (u, v) = (u64::from(column), u64::from(row));
            sums.count += 1;
            sums.u += u;
            sums.v += v;
            sums.uu += u128::from(u * u);
            sums.vv += u128::from(v * v);
        }
        sums
    }

    #[expect(clippy::cast_precision_loss, reason = "the sums of any real map stay far below 2^53")]
    fn moments(&self) -> (Point, f64) {
        let n = self.count.max(1) as f64;
        let mean = [self.u as f64 / n, self.v as f64 / n];
        let square = (self.uu as f64 + self.vv as f64) / n - mean[0].powi(2) - mean[1].powi(2);
        (mean, square.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::grid::{Lattice, LogOdds};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_distance_equals_the_rms_over_all_occupied_cells(
            a in (-9.0..9.0_f64, -9.0..9.0_f64, -4.0..4.0_f64), b in (-9.0..9.0_f64, -9.0..9.0_f64, -4.0..4.0_f64), step in 2_usize..40,
        ) {
            let lattice = Lattice::new(23, 31, 0.1, Pose2::new(5.0, -3.0, Angle::from_radians(0.7))).expect("valid");
            let cells = (0..23 * 31).map(|i| if i % step == 1 { LogOdds::OCCUPIED } else { LogOdds::FREE });
            let grid = OccupancyGrid::new(lattice, cells.collect()).expect("as many");
            let [a, b] = [a, b].map(|(x, y, yaw)| Pose2::new(x, y, Angle::from_radians(yaw)));
            let (mut sum, mut count) = (0.0, 0.0);
            for row in 0..31 {
                for column in (0..23).filter(|&column| grid.at(column, row).state() == CellState::Occupied) {
                    let p = lattice.cell_center(column, row);
                    let (p, q) = (a.apply(p), b.apply(p));
                    sum += (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
                    count += 1.0;
                }
            }
            prop_assert!((Moments::of(&grid).distance(a, b) - (sum / f64::max(count, 1.0)).sqrt()).abs() < 1e-6);
        }
    }

    #[test]
    fn a_map_without_walls_has_the_moments_of_its_lattice() {
        let lattice = Lattice::new(10, 10, 0.1, Pose2::IDENTITY).expect("valid");
        let moments = Moments::of(&OccupancyGrid::unknown(lattice));
        assert!((moments.mean()[0] - 0.5).abs() < 1e-9 && moments.spread_m() > 0.3);
    }
}
