//! A grid seen on another lattice, under a pose.
//!
//! Convention: `pose_target_source` is the pose of the source map's frame in the target's frame.
//!
//! Method: from target to source, so there are no holes and every value is one that a robot has seen.
//! 1. Target cells not larger than the source's: the source cell that the target cell's centre falls into. A wall keeps
//!    its thickness in metres.
//! 2. Target cells larger than the source's: of the source cells whose centres fall into the target cell, an occupied
//!    one if there is any (the surest), else the known one nearest to the middle. Every source cell falls into exactly
//!    one target cell, so no wall is lost, and none grows by more than a target cell's diagonal. Where no source centre
//!    falls into the target cell (sizes that differ by less than a factor of sqrt 2, rotated), as in 1.
//!
//! Cost: one pass over the target cells that the source covers, in parallel by rows; in case 2 each looks at about twice
//! as many source cells as it covers.

use std::ops::Range;

use rayon::prelude::*;

use super::{CellState, Lattice, LogOdds, OccupancyGrid};
use crate::geometry::{Point, Pose2};

/// The source grid on the target lattice, unknown outside.
#[must_use]
pub fn resample(source: &OccupancyGrid, pose_target_source: Pose2, target: Lattice) -> OccupancyGrid {
    let mut grid = OccupancyGrid::unknown(target);
    resample_onto(&mut grid, source, pose_target_source, |_, seen| seen);
    grid
}

/// As [`resample`], but each known source value is combined with the value that the target cell has:
/// `target = combine(target, source)`, called only where the source is known.
pub fn resample_onto(
    target: &mut OccupancyGrid,
    source: &OccupancyGrid,
    pose_target_source: Pose2,
    combine: impl Fn(LogOdds, LogOdds) -> LogOdds + Sync,
) {
    let sampler = Sampler::new(source, pose_target_source, target.lattice());
    let (width, height) = (target.lattice().width() as usize, target.lattice().height());
    let rows = target.cells_mut().par_chunks_mut(width);
    rows.zip(0..height).for_each(|(cells, row)| {
        for column in sampler.columns(row) {
            if let Some(index) = sampler.source_index(column, row) {
                let seen = source.cells()[index];
                if seen.is_known() {
                    let cell = &mut cells[column as usize];
                    *cell = combine(*cell, seen);
                }
            }
        }
    });
}

/// Which cell of a source grid speaks for which cell of a target lattice: rules 1 and 2 of the module.
#[derive(Debug, Clone, Copy)]
pub struct Sampler<'a> {
    source: &'a OccupancyGrid,
    /// Source lattice coordinates of the target's corner, and of one step to the right.
    start: Point,
    step: Point,
    /// Cosine and sine of the target's axes on the source lattice.
    axis: Point,
    /// Half a target cell, in source cells, when rule 2 applies.
    half: Option<f64>,
    width: u32,
}

/// Sizes that differ by less than this factor are the same: resolutions come from decimal text and from 32-bit floats.
const SAME_SIZE: f64 = 1.0 + 1e-6;
/// Source centres on the very border of two target cells go to the same one for both, in spite of rounding.
const BORDER: f64 = 1e-7;

impl<'a> Sampler<'a> {
    /// For the source under this pose and the target.
    #[must_use]
    pub fn new(source: &'a OccupancyGrid, pose_target_source: Pose2, target: &Lattice) -> Self {
        let from = source.lattice();
        // p_source_lattice = (origin_source^-1 * pose_source_target * origin_target) * p_target_lattice, in metres
        let motion = (from.origin().inverse() * pose_target_source.inverse() * target.origin()).motion();
        let scale = target.resolution() / from.resolution();
        Self {
            source,
            start: [motion.x / from.resolution(), motion.y / from.resolution()],
            step: [motion.cos * scale, motion.sin * scale],
            axis: [motion.cos, motion.sin],
            half: (scale > SAME_SIZE).then_some(scale / 2.0),
            width: target.width(),
        }
    }

    /// The columns of a target row whose cells the source may cover.
    #[must_use]
    pub fn columns(&self, row: u32) -> Range<u32> {
        let lattice = self.source.lattice();
        let [u, v] = self.point(-0.5, row);
        let reach = self.reach() + 1e-3;
        let mut range = [0.0, f64::from(self.width)];
        for (start, step, end) in [(u, self.step[0], lattice.width()), (v, self.step[1], lattice.height())] {
            let [low, high] = [-reach - start, f64::from(end) + reach - start];
            if step.abs() < 1e-12 {
                if low > 0.0 || high < 0.0 {
                    return 0..0;
                }
                continue;
            }
            let [first, last] = if step > 0.0 {
                [low / step, high / step]
            } else {
                [high / step, low / step]
            };
            range = [range[0].max(first - 1.0), range[1].min(last + 1.0)];
        }
        if range[0] < range[1] {
            whole(range[0])..whole(range[1].ceil())
        } else {
            0..0
        }
    }

    /// Where in the source's row-major array the cell stands that speaks for a target cell, if any; it may be unknown.
    #[must_use]
    #[inline]
    pub fn source_index(&self, column: u32, row: u32) -> Option<usize> {
        let lattice = self.source.lattice();
        let point = self.point(f64::from(column), row);
        self.half
            .and_then(|half| self.strongest_within(point, half))
            .or_else(|| lattice.cell_of(point).map(|(i, j)| lattice.index(i, j)))
    }

    /// Source lattice coordinates of a target cell's centre.
    #[inline]
    fn point(&self, column: f64, row: u32) -> Point {
        let (x, y) = (column + 0.5, f64::from(row) + 0.5);
        [
            self.start[0] + self.step[0] * x - self.step[1] * y,
            self.start[1] + self.step[1] * x + self.step[0] * y,
        ]
    }

    /// How far, in source cells along its axes, a target cell reaches from its centre.
    fn reach(&self) -> f64 {
        self.half.unwrap_or(0.0) * (self.axis[0].abs() + self.axis[1].abs())
    }

    /// Rule 2.
    fn strongest_within(&self, [u, v]: Point, half: f64) -> Option<usize> {
        let lattice = self.source.lattice();
        let reach = self.reach() + 1.0;
        let span = |middle: f64, end: u32| {
            whole((middle - reach).clamp(0.0, f64::from(end)))..whole((middle + reach).clamp(0.0, f64::from(end)))
        };
        let inside = |a: f64| a >= -half - BORDER && a < half - BORDER;
        let mut best: Option<(Strength, usize)> = None;
        for j in span(v, lattice.height()) {
            for i in span(u, lattice.width()) {
                let (du, dv) = (f64::from(i) + 0.5 - u, f64::from(j) + 0.5 - v);
                if inside(self.axis[0] * du + self.axis[1] * dv) && inside(self.axis[0] * dv - self.axis[1] * du) {
                    let index = lattice.index(i, j);
                    let strength = strength(self.source.cells()[index], du * du + dv * dv);
                    // ties go to the first in row-major order
                    if best.is_none_or(|(best, _)| strength > best) {
                        best = Some((strength, index));
                    }
                }
            }
        }
        best.map(|(_, index)| index)
    }
}

/// Rank, then how much more than others of the same rank.
type Strength = (u8, f64);

fn strength(cell: LogOdds, distance2: f64) -> Strength {
    match cell.value() {
        None => (0, 0.0),
        Some(value) if cell.state() == CellState::Occupied => (2, value),
        Some(_) => (1, -distance2),
    }
}

/// The whole part of a number that is neither negative nor beyond a lattice's side.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "callers clamp to [0, side], and a side is a u32"
)]
fn whole(value: f64) -> u32 {
    value as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use proptest::prelude::*;

    fn pattern(lattice: Lattice) -> OccupancyGrid {
        let cells = (0..lattice.cell_count()).map(|i| match i % 7 {
            0 | 1 => LogOdds::OCCUPIED,
            2..=4 => LogOdds::FREE,
            _ => LogOdds::UNKNOWN,
        });
        OccupancyGrid::new(lattice, cells.collect()).expect("as many cells")
    }

    #[test]
    fn on_its_own_lattice_a_grid_stays_as_it_is() {
        let lattice = Lattice::new(31, 17, 0.05, Pose2::new(-3.0, 2.0, Angle::from_degrees(33.0))).expect("valid");
        let grid = pattern(lattice);
        assert_eq!(resample(&grid, Pose2::IDENTITY, lattice), grid);
    }

    /// A room with walls of `thickness` metres all around, free inside, unknown outside.
    fn room(resolution: f64, thickness: f64) -> OccupancyGrid {
        let side = (8.0 / resolution).round();
        let lattice = Lattice::new(whole(side), whole(side), resolution, Pose2::IDENTITY).expect("valid");
        let mut grid = OccupancyGrid::unknown(lattice);
        for row in 0..whole(side) {
            for column in 0..whole(side) {
                let [x, y] = lattice.cell_center(column, row);
                let inside = (x - 4.0).abs().max((y - 4.0).abs());
                let cell = match inside {
                    d if d < 3.0 => LogOdds::FREE,
                    d if d < 3.0 + thickness => LogOdds::OCCUPIED,
                    _ => continue,
                };
                grid.cells_mut()[lattice.index(column, row)] = cell;
            }
        }
        grid
    }

    /// Mean thickness of the room's walls in metres: occupied area over the length of the four walls.
    fn wall_thickness(grid: &OccupancyGrid, thickness: f64) -> f64 {
        let cells = u32::try_from(grid.state_counts().occupied).expect("a small grid");
        f64::from(cells) * grid.lattice().resolution().powi(2) / (4.0 * (6.0 + thickness))
    }

    /// Whether a flood over free and unknown cells, started in the middle, stays inside of the room.
    fn walls_hold(grid: &OccupancyGrid) -> bool {
        let lattice = grid.lattice();
        let mut seen = vec![false; lattice.cell_count()];
        let (middle_u, middle_v) = (lattice.width() / 2, lattice.height() / 2);
        let mut open = vec![(middle_u, middle_v)];
        while let Some((column, row)) = open.pop() {
            let index = lattice.index(column, row);
            if seen[index] || grid.cells()[index].state() == CellState::Occupied {
                continue;
            }
            seen[index] = true;
            if column == 0 || row == 0 || column + 1 == lattice.width() || row + 1 == lattice.height() {
                return false;
            }
            open.extend([
                (column - 1, row),
                (column + 1, row),
                (column, row - 1),
                (column, row + 1),
            ]);
        }
        true
    }

    fn onto_fitting(source: &OccupancyGrid, yaw: f64, shift: f64, resolution: f64) -> OccupancyGrid {
        let cells = whole((14.0 / resolution).round());
        let target = Lattice::new(cells, cells, resolution, Pose2::new(-7.0, -7.0, Angle::ZERO)).expect("valid");
        let centred = Pose2::new(-4.0, -4.0, Angle::ZERO);
        resample(
            source,
            Pose2::new(shift, shift / 3.0, Angle::from_radians(yaw)) * centred,
            target,
        )
    }

    #[test]
    fn a_finer_source_loses_no_wall_cell_by_cell() {
        // every source cell lies in exactly one target cell, so every occupied source cell makes its target cell occupied
        let source = room(0.025, 0.025);
        let target = Lattice::new(60, 60, 0.1, Pose2::new(1.0, 1.0, Angle::from_degrees(10.0))).expect("valid");
        let pose_target_source = Pose2::new(0.3, 0.4, Angle::from_degrees(20.0));
        let seen = resample(&source, pose_target_source, target);
        for row in 0..source.lattice().height() {
            for column in 0..source.lattice().width() {
                let point = pose_target_source.apply(source.lattice().cell_center(column, row));
                if let Some((i, j)) = target.cell_at(point)
                    && source.at(column, row).state() == CellState::Occupied
                {
                    assert_eq!(
                        seen.at(i, j).state(),
                        CellState::Occupied,
                        "source cell ({column}, {row})"
                    );
                }
            }
        }
    }

    #[test]
    fn a_quarter_turn_turns_the_cells() {
        let source = Lattice::new(3, 2, 1.0, Pose2::IDENTITY).expect("valid");
        let grid = pattern(source);
        // turned by 90 degrees the 3 x 2 map covers x in [-2, 0], y in [0, 3]
        let target = Lattice::new(2, 3, 1.0, Pose2::new(-2.0, 0.0, Angle::ZERO)).expect("valid");
        let turned = resample(&grid, Pose2::new(0.0, 0.0, Angle::QUARTER_TURN), target);
        for (column, row) in [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)] {
            assert_eq!(turned.at(1 - row, column), grid.at(column, row));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn walls_keep_their_thickness_and_do_not_leak(yaw in -4.0..4.0_f64, shift in -0.1..0.1_f64) {
            // the same resolution, and a coarser source: the thickness in metres stays
            for (source, target) in [(0.05, 0.05), (0.1, 0.05), (0.1, 0.04)] {
                let room = room(source, 2.0 * source);
                let before = wall_thickness(&room, 2.0 * source);
                let seen = onto_fitting(&room, yaw, shift, target);
                let after = wall_thickness(&seen, 2.0 * source);
                prop_assert!((after / before - 1.0).abs() < 0.1, "{source} to {target}: {before} m became {after} m");
                prop_assert!(walls_hold(&seen), "{source} to {target}");
            }
            // a finer source: never more than a target cell's diagonal more; never a gap
            for (source, target) in [(0.025, 0.1), (0.05, 0.1), (0.05, 0.06)] {
                let room = room(source, 2.0 * source);
                let before = wall_thickness(&room, 2.0 * source);
                let seen = onto_fitting(&room, yaw, shift, target);
                let after = wall_thickness(&seen, 2.0 * source);
                prop_assert!(after > 0.5 * before && after < before + 1.42 * target, "{source} to {target}: {before} m became {after} m");
                prop_assert!(walls_hold(&seen), "{source} to {target}");
            }
        }

        #[test]
        fn the_stepped_loop_equals_the_plain_definition(x in -2.0..2.0_f64, y in -2.0..2.0_f64, yaw in -4.0..4.0_f64,
                                                        resolution in 0.03..0.05_f64) {
            let source = pattern(Lattice::new(40, 30, 0.05, Pose2::new(-1.0, -0.7, Angle::from_radians(0.3))).expect("valid"));
            let target = Lattice::new(23, 29, resolution, Pose2::new(-1.5, -1.0, Angle::from_radians(-0.2))).expect("valid");
            let pose_target_source = Pose2::new(x, y, Angle::from_radians(yaw));
            let fast = resample(&source, pose_target_source, target);
            for row in 0..29 {
                for column in 0..23 {
                    let point = pose_target_source.inverse().apply(target.cell_center(column, row));
                    let [u, v] = source.lattice().to_cells(point);
                    // on the border between two cells rounding may choose either
                    prop_assume!((u - u.round()).abs() > 1e-9 && (v - v.round()).abs() > 1e-9);
                    let expected = source.lattice().cell_at(point).map_or(LogOdds::UNKNOWN, |(i, j)| source.at(i, j));
                    prop_assert_eq!(fast.at(column, row), expected);
                }
            }
        }
    }
}
