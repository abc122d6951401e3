//! A grid seen on another lattice, under a pose.

use rayon::prelude::*;

use super::{Lattice, LogOdds, OccupancyGrid};
use crate::geometry::Pose2;

/// Convention: `pose_target_source` is the pose of the source map's frame in the target's frame. Each target cell takes
/// the log odds of the source cell that its centre falls into, unknown outside.
///
/// Nearest neighbour, from target to source: no holes, every value is one that a robot has seen, walls never grow
/// thicker. Cost: one pass over the target, in parallel by rows.
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
    let (to, from) = (*target.lattice(), *source.lattice());
    // p_source_lattice = (origin_source^-1 * pose_source_target * origin_target) * p_target_lattice, in metres
    let pose_source_target = pose_target_source.inverse();
    let step = (from.origin().inverse() * pose_source_target * to.origin()).motion();
    let scale = to.resolution() / from.resolution();
    let (du, dv) = (step.cos * scale, step.sin * scale);
    let [u0, v0] = [step.x / from.resolution(), step.y / from.resolution()];
    let width = to.width() as usize;
    target
        .cells_mut()
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(row, cells)| {
            #[expect(clippy::cast_precision_loss, reason = "rows are below 2^31")]
            let y = row as f64 + 0.5;
            for (column, cell) in (0_u32..).zip(cells) {
                let x = f64::from(column) + 0.5;
                // Lattice coordinates of the target cell's centre on the source lattice.
                let point = [u0 + du * x - dv * y, v0 + dv * x + du * y];
                if let Some((i, j)) = from.cell_of(point) {
                    let seen = source.at(i, j);
                    if seen.is_known() {
                        *cell = combine(*cell, seen);
                    }
                }
            }
        });
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
        #[test]
        fn the_stepped_loop_equals_the_plain_definition(x in -2.0..2.0_f64, y in -2.0..2.0_f64, yaw in -4.0..4.0_f64,
                                                        resolution in 0.03..0.2_f64) {
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
