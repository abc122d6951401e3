//! A map in a few thousand points: enough to tell, in microseconds and without any method, how much of two maps lies on
//! each other under a pose, and whether their walls agree there.
//!
//! **Method.** Of the occupied cells and of the known cells at most [`POINTS_MAX`] each are taken, evenly in row-major
//! order; each stands for all that were left out with it. A wall point is looked up in the other map with the cells
//! around it within the tolerance: matched when one of them is occupied, violated when all of them are free.
//!
//! **Cost.** One pass over the map; a look at a pose costs some ten thousand cells.

use super::Moments;
use crate::geometry::{Point, Pose2};
use crate::grid::{CellState, OccupancyGrid};

/// The most points of each kind.
const POINTS_MAX: usize = 4000;

/// The points of one map, in its own frame.
#[derive(Debug, Clone)]
pub(super) struct Sketch {
    pub(super) moments: Moments,
    walls: Vec<Point>,
    /// Metres of wall that each wall point stands for.
    wall_m: f64,
    known: Vec<Point>,
    /// Radius of a circle around the middle of the lattice that holds all points.
    circle: (Point, f64),
}

/// Metres of wall (occupied cells times their size), the mean of both directions of looking up.
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

    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            matched_m: self.matched_m + other.matched_m,
            violated_m: self.violated_m + other.violated_m,
        }
    }
}

impl Sketch {
    pub(super) fn of(grid: &OccupancyGrid) -> Self {
        let lattice = grid.lattice();
        let (mut occupied, mut known) = (0_usize, 0_usize);
        for cell in grid.cells() {
            match cell.state() {
                CellState::Unknown => {}
                CellState::Free => known += 1,
                CellState::Occupied => {
                    known += 1;
                    occupied += 1;
                }
            }
        }
        let (wall_step, known_step) = (occupied.div_ceil(POINTS_MAX).max(1), known.div_ceil(POINTS_MAX).max(1));
        let (mut walls, mut all) = (Vec::new(), Vec::new());
        let (mut next_wall, mut next_known) = (wall_step / 2, known_step / 2);
        for row in 0..lattice.height() {
            for (column, cell) in (0_u32..).zip(grid.row(row)) {
                let state = cell.state();
                if state == CellState::Unknown {
                    continue;
                }
                if next_known == 0 {
                    all.push(lattice.cell_center(column, row));
                    next_known = known_step;
                }
                next_known -= 1;
                if state == CellState::Occupied {
                    if next_wall == 0 {
                        walls.push(lattice.cell_center(column, row));
                        next_wall = wall_step;
                    }
                    next_wall -= 1;
                }
            }
        }
        let [low, _, high, _] = lattice.corners();
        let middle = [f64::midpoint(low[0], high[0]), f64::midpoint(low[1], high[1])];
        #[expect(clippy::cast_precision_loss, reason = "steps are below 2^31")]
        let wall_m = lattice.resolution() * wall_step as f64;
        Self {
            moments: Moments::of(grid),
            walls,
            wall_m,
            known: all,
            circle: (middle, (high[0] - low[0]).hypot(high[1] - low[1]) / 2.0),
        }
    }
}

/// A map with its sketch.
pub(super) type Sketched<'a> = (&'a OccupancyGrid, &'a Sketch);

/// About the area known in both maps over the smaller known area, in [0, 1].
pub(super) fn overlap(fixed: Sketched<'_>, moving: Sketched<'_>, pose_fixed_moving: Pose2) -> f64 {
    if !may_meet(fixed.1, moving.1, pose_fixed_moving) {
        return 0.0;
    }
    let share = |from: &Sketch, to: &OccupancyGrid, pose_to_from: Pose2| {
        let to_cells = (to.lattice().origin().inverse() * pose_to_from).motion();
        let per_metre = 1.0 / to.lattice().resolution();
        let known = from.known.iter().filter(|&&point| {
            let [x, y] = to_cells.apply(point);
            let cell = to.lattice().cell_of([x * per_metre, y * per_metre]);
            cell.is_some_and(|(column, row)| to.at(column, row).state() != CellState::Unknown)
        });
        #[expect(clippy::cast_precision_loss, reason = "a few thousand points")]
        let share = known.count() as f64 / from.known.len().max(1) as f64;
        share
    };
    // the larger of both shares is that of the map with the smaller known area
    share(moving.1, fixed.0, pose_fixed_moving).max(share(fixed.1, moving.0, pose_fixed_moving.inverse()))
}

/// How the walls of two maps agree; walls within the tolerance are the same one.
pub(super) fn agreement(
    fixed: Sketched<'_>,
    moving: Sketched<'_>,
    pose_fixed_moving: Pose2,
    tolerance_m: f64,
) -> WallAgreement {
    if !may_meet(fixed.1, moving.1, pose_fixed_moving) {
        return WallAgreement::default();
    }
    let one = look_up(moving.1, fixed.0, pose_fixed_moving, tolerance_m);
    let other = look_up(fixed.1, moving.0, pose_fixed_moving.inverse(), tolerance_m);
    WallAgreement {
        matched_m: f64::midpoint(one.matched_m, other.matched_m),
        violated_m: f64::midpoint(one.violated_m, other.violated_m),
    }
}

/// Whether the circles around two maps meet.
fn may_meet(fixed: &Sketch, moving: &Sketch, pose_fixed_moving: Pose2) -> bool {
    let ([ax, ay], radius_a) = fixed.circle;
    let (middle, radius_b) = moving.circle;
    let [bx, by] = pose_fixed_moving.apply(middle);
    (ax - bx).hypot(ay - by) <= radius_a + radius_b
}

/// The wall points of `from` in the map `to`.
fn look_up(from: &Sketch, to: &OccupancyGrid, pose_to_from: Pose2, tolerance_m: f64) -> WallAgreement {
    let lattice = to.lattice();
    let to_cells = (lattice.origin().inverse() * pose_to_from).motion();
    let per_metre = 1.0 / lattice.resolution();
    let reach = (tolerance_m * per_metre).round().max(0.0);
    let (mut matched, mut violated) = (0_u32, 0_u32);
    for &point in &from.walls {
        let [x, y] = to_cells.apply(point);
        let (u, v) = (x * per_metre, y * per_metre);
        let corners = (
            lattice.cell_of([u - reach, v - reach]),
            lattice.cell_of([u + reach, v + reach]),
        );
        // at the very border of a map nothing is known of what is around
        let (Some((left, low)), Some((right, high))) = corners else {
            continue;
        };
        let (mut occupied, mut free) = (false, true);
        for row in low..=high {
            for cell in &to.row(row)[left as usize..=right as usize] {
                let state = cell.state();
                occupied |= state == CellState::Occupied;
                free &= state == CellState::Free;
            }
        }
        matched += u32::from(occupied);
        violated += u32::from(free);
    }
    WallAgreement {
        matched_m: f64::from(matched) * from.wall_m,
        violated_m: f64::from(violated) * from.wall_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::grid::{Lattice, LogOdds};

    /// A free hall with walls around and unknown space outside.
    fn hall(width: u32, height: u32) -> OccupancyGrid {
        let lattice = Lattice::new(width + 10, height + 10, 0.05, Pose2::new(-0.25, -0.25, Angle::ZERO));
        let lattice = lattice.expect("valid");
        let mut grid = OccupancyGrid::unknown(lattice);
        for row in 5..height + 5 {
            for column in 5..width + 5 {
                let border = row == 5 || row == height + 4 || column == 5 || column == width + 4;
                let cell = if border { LogOdds::OCCUPIED } else { LogOdds::FREE };
                grid.cells_mut()[lattice.index(column, row)] = cell;
            }
        }
        grid
    }

    #[test]
    fn a_map_agrees_with_itself_and_not_with_itself_moved() {
        for (width, height) in [(80, 60), (900, 700)] {
            let grid = hall(width, height);
            let sketch = Sketch::of(&grid);
            let look = |pose| agreement((&grid, &sketch), (&grid, &sketch), pose, 0.1);
            let same = look(Pose2::IDENTITY);
            let walls = 0.05 * f64::from(2 * (width + height) - 4);
            assert!((same.matched_m / walls - 1.0).abs() < 0.01, "{same:?} of {walls} m");
            assert!(same.violated_share() < 1e-9);
            let turned = look(Pose2::new(0.2 * walls, 0.1, Angle::from_degrees(20.0)));
            assert!(turned.violated_share() > 0.6, "{turned:?}");
            assert_eq!(look(Pose2::new(1e4, 0.0, Angle::ZERO)), WallAgreement::default());
        }
    }

    #[test]
    fn the_overlap_of_halves_is_a_half() {
        let grid = hall(400, 300);
        let sketch = Sketch::of(&grid);
        let overlap = |x: f64| overlap((&grid, &sketch), (&grid, &sketch), Pose2::new(x, 0.0, Angle::ZERO));
        assert!((overlap(0.0) - 1.0).abs() < 1e-9);
        assert!((overlap(10.0) - 0.5).abs() < 0.02);
        assert!(overlap(20.5) < 1e-9);
    }
}
