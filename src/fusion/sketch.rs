//! A map in a few thousand points: enough to tell, in microseconds and without any method, how much of two maps lies on
//! each other under a pose, and whether their walls agree there.
//!
//! **Method.** Of the occupied cells and of the known cells at most [`POINTS_MAX`] each are taken, evenly in row-major
//! order; each stands for all that were left out with it. What is around each cell within the tolerance is told once: a
//! wall point of another map is matched when one of the cells around is occupied, and violated when all of them are free.
//! Of the matched walls' normals n the smaller eigenvalue of the sum of n n^T is the wall that holds the weaker direction.
//!
//! **Cost.** Two passes over the map, and two bits for each of its cells; a look at a pose costs some ten thousand cells.

use super::Moments;
use super::bitmap::Bitmap;
use super::conflicts::reach_cells;
use crate::geometry::{Point, Pose2};
use crate::grid::{CellState, Lattice, OccupancyGrid};

/// The most points of each kind.
const POINTS_MAX: usize = 4000;

/// The points of one map, in its own frame.
#[derive(Debug, Clone)]
pub(super) struct Sketch {
    pub(super) moments: Moments,
    walls: Vec<Wall>,
    known: Vec<Point>,
    /// Radius of a circle around the middle of the lattice that holds all points.
    circle: (Point, f64),
    /// Cells with a wall around.
    near_wall: Bitmap,
    /// Cells with something around that is not known.
    near_unknown: Bitmap,
}

/// A point of a wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wall {
    pub(super) point: Point,
    /// Across the wall, where it is straight.
    normal: Option<Point>,
    /// Metres of wall that it stands for.
    metres: f64,
}

impl Wall {
    /// The same wall told in another frame, in which its own lies at `pose`.
    pub(super) fn moved(&self, pose: Pose2) -> Self {
        let motion = pose.motion();
        Self {
            point: motion.apply(self.point),
            normal: self.normal.map(|normal| motion.rotate(normal)),
            metres: self.metres,
        }
    }
}

/// What is within the tolerance of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Around {
    /// No wall, but something that is not known.
    Doubt,
    /// Nothing but free space.
    Free,
    /// A wall.
    Wall,
}

/// Metres of wall (occupied cells times their size), the mean of both directions of looking up.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[expect(clippy::struct_field_names, reason = "the unit stands in the name, as everywhere")]
pub(super) struct WallAgreement {
    /// Wall of one map within the tolerance of a wall of the other.
    pub(super) matched_m: f64,
    /// Wall of one map in free space of the other, with no wall of that one within the tolerance.
    pub(super) violated_m: f64,
    /// Matched wall that holds the weaker direction.
    pub(super) weaker_m: f64,
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
            weaker_m: self.weaker_m + other.weaker_m,
        }
    }

    /// The mean of both directions of looking up.
    pub(super) fn mean(self, other: Self) -> Self {
        Self {
            matched_m: f64::midpoint(self.matched_m, other.matched_m),
            violated_m: f64::midpoint(self.violated_m, other.violated_m),
            weaker_m: f64::midpoint(self.weaker_m, other.weaker_m),
        }
    }
}

impl Sketch {
    /// Walls within the tolerance (metres) of each other are the same one.
    pub(super) fn of(grid: &OccupancyGrid, tolerance_m: f64) -> Self {
        let lattice = grid.lattice();
        let occupied = Bitmap::of(grid, |state| state == CellState::Occupied);
        let known = Bitmap::of(grid, |state| state != CellState::Unknown);
        let step = step(&known);
        let known_points = known.every(step / 2, step);
        let [low, _, high, _] = lattice.corners();
        let middle = [f64::midpoint(low[0], high[0]), f64::midpoint(low[1], high[1])];
        let reach = reach_cells(grid, tolerance_m);
        Self {
            moments: Moments::of_cells(grid, &occupied),
            walls: wall_points(grid, &occupied),
            known: known_points
                .map(|(column, row)| lattice.cell_center(column, row))
                .collect(),
            circle: (middle, (high[0] - low[0]).hypot(high[1] - low[1]) / 2.0),
            near_wall: occupied.widened(reach),
            near_unknown: known.inverted().widened(reach),
        }
    }

    pub(super) fn walls(&self) -> &[Wall] {
        &self.walls
    }

    /// What is around a point of the map's frame.
    pub(super) fn around(&self, grid: &OccupancyGrid, point: Point) -> Around {
        self.around_cell(grid.lattice().cell_at(point))
    }

    fn around_cell(&self, cell: Option<(u32, u32)>) -> Around {
        match cell {
            Some((column, row)) if self.near_wall.has(column, row) => Around::Wall,
            Some((column, row)) if !self.near_unknown.has(column, row) => Around::Free,
            _ => Around::Doubt,
        }
    }
}

/// The wall points of a map that is looked up in others, but in which nothing is.
pub(super) fn walls_of(grid: &OccupancyGrid) -> Vec<Wall> {
    wall_points(grid, &Bitmap::of(grid, |state| state == CellState::Occupied))
}

fn wall_points(grid: &OccupancyGrid, occupied: &Bitmap) -> Vec<Wall> {
    let (lattice, step) = (grid.lattice(), step(occupied));
    #[expect(clippy::cast_precision_loss, reason = "steps are below 2^31")]
    let metres = lattice.resolution() * step as f64;
    let chosen = occupied.every(step / 2, step).map(|(column, row)| Wall {
        point: lattice.cell_center(column, row),
        normal: normal(occupied, lattice, column, row),
        metres,
    });
    chosen.collect()
}

/// Of how many cells one is taken.
fn step(cells: &Bitmap) -> usize {
    cells.count().div_ceil(POINTS_MAX).max(1)
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

/// How the walls of two maps agree, by the tolerances that they were sketched with.
pub(super) fn agreement(fixed: Sketched<'_>, moving: Sketched<'_>, pose_fixed_moving: Pose2) -> WallAgreement {
    if !may_meet(fixed.1, moving.1, pose_fixed_moving) {
        return WallAgreement::default();
    }
    let there = look_up(&moving.1.walls, fixed, pose_fixed_moving);
    let back = look_up(&fixed.1.walls, moving, pose_fixed_moving.inverse());
    there.mean(back)
}

/// Whether the circles around two maps meet.
fn may_meet(fixed: &Sketch, moving: &Sketch, pose_fixed_moving: Pose2) -> bool {
    let ([ax, ay], radius_a) = fixed.circle;
    let (middle, radius_b) = moving.circle;
    let [bx, by] = pose_fixed_moving.apply(middle);
    (ax - bx).hypot(ay - by) <= radius_a + radius_b
}

/// The wall points of one map in the map `to`.
pub(super) fn look_up(walls: &[Wall], (to, sketch): Sketched<'_>, pose_to_walls: Pose2) -> WallAgreement {
    let lattice = to.lattice();
    let to_cells = (lattice.origin().inverse() * pose_to_walls).motion();
    let per_metre = 1.0 / lattice.resolution();
    tally(walls.iter().map(|wall| {
        let [x, y] = to_cells.apply(wall.point);
        (
            *wall,
            sketch.around_cell(lattice.cell_of([x * per_metre, y * per_metre])),
        )
    }))
}

/// Adds up walls by what is around each of them.
pub(super) fn tally(walls: impl Iterator<Item = (Wall, Around)>) -> WallAgreement {
    let mut sums = WallAgreement::default();
    let [mut xx, mut xy, mut yy] = [0.0; 3];
    for (wall, around) in walls {
        match around {
            Around::Doubt => {}
            Around::Free => sums.violated_m += wall.metres,
            Around::Wall => {
                sums.matched_m += wall.metres;
                let [x2, y2] = match wall.normal {
                    Some([x, y]) => {
                        xy += x * y * wall.metres;
                        [x * x, y * y]
                    }
                    None => [CLUTTER; 2],
                };
                xx += x2 * wall.metres;
                yy += y2 * wall.metres;
            }
        }
    }
    let (mean, spread) = (f64::midpoint(xx, yy), ((xx - yy) / 2.0).hypot(xy));
    sums.weaker_m = (mean - spread).max(0.0);
    sums
}

/// How much a piece of clutter holds each direction, as a share of its length.
const CLUTTER: f64 = 0.3;

/// The normal of a wall at one of its cells, in the map's frame: across the occupied cells within three cells of it,
/// where they lie in a line.
#[expect(clippy::similar_names, reason = "the letters of the formulas")]
fn normal(occupied: &Bitmap, lattice: &Lattice, column: u32, row: u32) -> Option<Point> {
    const REACH: u32 = 3;
    let [mut count, mut sum_x, mut sum_y, mut sum_xx, mut sum_xy, mut sum_yy] = [0.0; 6];
    for other_row in row.saturating_sub(REACH)..=(row + REACH).min(lattice.height() - 1) {
        for other in column.saturating_sub(REACH)..=(column + REACH).min(lattice.width() - 1) {
            if occupied.has(other, other_row) {
                let dx = f64::from(other) - f64::from(column);
                let dy = f64::from(other_row) - f64::from(row);
                count += 1.0;
                sum_x += dx;
                sum_y += dy;
                sum_xx += dx * dx;
                sum_xy += dx * dy;
                sum_yy += dy * dy;
            }
        }
    }
    let (mean_x, mean_y) = (sum_x / count, sum_y / count);
    let xx = sum_xx / count - mean_x * mean_x;
    let xy = sum_xy / count - mean_x * mean_y;
    let yy = sum_yy / count - mean_y * mean_y;
    let (mean, spread) = (f64::midpoint(xx, yy), ((xx - yy) / 2.0).hypot(xy));
    let straight = count >= 4.0 && mean + spread >= 1.0 && mean - spread < 0.5 * (mean + spread);
    straight.then(|| {
        // the line runs at half of this angle, the normal across it
        let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
        lattice.origin().motion().rotate([-sin, cos])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::grid::LogOdds;

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
            let sketch = Sketch::of(&grid, 0.1);
            let look = |pose| agreement((&grid, &sketch), (&grid, &sketch), pose);
            let same = look(Pose2::IDENTITY);
            let walls = 0.05 * f64::from(2 * (width + height) - 4);
            assert!((same.matched_m / walls - 1.0).abs() < 0.01, "{same:?} of {walls} m");
            assert!(same.violated_share() < 1e-9);
            // two walls of the hall hold one direction, two the other
            let shorter = 0.1 * f64::from(width.min(height));
            assert!((same.weaker_m / shorter - 1.0).abs() < 0.15, "{same:?} of {shorter} m");
            let turned = look(Pose2::new(0.2 * walls, 0.1, Angle::from_degrees(20.0)));
            assert!(turned.violated_share() > 0.6, "{turned:?}");
            assert_eq!(look(Pose2::new(1e4, 0.0, Angle::ZERO)), WallAgreement::default());
        }
    }

    #[test]
    fn the_overlap_of_halves_is_a_half() {
        let grid = hall(400, 300);
        let sketch = Sketch::of(&grid, 0.1);
        let overlap = |x: f64| overlap((&grid, &sketch), (&grid, &sketch), Pose2::new(x, 0.0, Angle::ZERO));
        assert!((overlap(0.0) - 1.0).abs() < 1e-9);
        assert!((overlap(10.0) - 0.5).abs() < 0.02);
        assert!(overlap(20.5) < 1e-9);
    }
}
