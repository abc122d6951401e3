//! What two maps have in common when their poses are known: how pairs are labelled and checked.

use super::numbers::{index, real};
use crate::geometry::{Point, Pose2};
use crate::grid::{CellState, OccupancyGrid, resample};

/// Two maps under a known pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Square metres that are known in both.
    pub common_area: f64,
    /// The same as a share of the smaller map's known area.
    pub overlap: f64,
    /// Of the moving map's occupied cells that fall on known cells of the fixed map, the share that lie within two
    /// cells (of the coarser map) of an occupied one; 0 when none fall there.
    pub agreement: f64,
}

/// Lays the moving map over the fixed one at `pose_fixed_moving`.
#[must_use]
pub fn compare(fixed: &OccupancyGrid, moving: &OccupancyGrid, pose_fixed_moving: Pose2) -> Comparison {
    let laid = resample(moving, pose_fixed_moving, *fixed.lattice());
    let known = |state: CellState| state != CellState::Unknown;
    let both = fixed
        .cells()
        .iter()
        .zip(laid.cells())
        .filter(|(a, b)| known(a.state()) && known(b.state()))
        .count();
    let common_area = real(both) * fixed.lattice().resolution().powi(2);
    let reach = 2.0 * fixed.lattice().resolution().max(moving.lattice().resolution());
    Comparison {
        common_area,
        overlap: common_area / fixed.known_area().min(moving.known_area()).max(1e-9),
        agreement: agreement(fixed, &occupied_points(moving), pose_fixed_moving, reach),
    }
}

/// Centres of the occupied cells, in the map's frame.
pub(super) fn occupied_points(map: &OccupancyGrid) -> Vec<Point> {
    let lattice = map.lattice();
    (0..lattice.height())
        .flat_map(|row| (0..lattice.width()).map(move |column| (column, row)))
        .filter(|&(column, row)| map.at(column, row).state() == CellState::Occupied)
        .map(|(column, row)| lattice.cell_center(column, row))
        .collect()
}

/// As [`Comparison::agreement`], for points of the moving map and any reach in metres.
pub(super) fn agreement(fixed: &OccupancyGrid, points: &[Point], pose_fixed_moving: Pose2, reach: f64) -> f64 {
    let motion = pose_fixed_moving.motion();
    let (mut seen, mut met) = (0, 0);
    for point in points.iter().map(|&p| motion.apply(p)) {
        let lattice = fixed.lattice();
        let Some((column, row)) = lattice.cell_at(point) else {
            continue;
        };
        if fixed.at(column, row).state() != CellState::Unknown {
            seen += 1;
            met += usize::from(wall_near(fixed, point, reach));
        }
    }
    if seen == 0 { 0.0 } else { real(met) / real(seen) }
}

/// Whether an occupied cell of one map lies within `reach` metres of one of the other.
pub(super) fn walls_within(
    fixed: &OccupancyGrid,
    moving: &OccupancyGrid,
    pose_fixed_moving: Pose2,
    reach: f64,
) -> bool {
    let motion = pose_fixed_moving.motion();
    occupied_points(moving)
        .into_iter()
        .any(|p| wall_near(fixed, motion.apply(p), reach))
}

/// Whether the pose can slide along some direction by 0.8 or 1.6 m and keep 85 % of the agreement: a lone corridor.
pub(super) fn weakly_constrained(fixed: &OccupancyGrid, moving: &OccupancyGrid, pose_fixed_moving: Pose2) -> bool {
    let reach = 2.0 * fixed.lattice().resolution().max(moving.lattice().resolution());
    let points = occupied_points(moving);
    let at_truth = agreement(fixed, &points, pose_fixed_moving, reach);
    (0..16_u32).any(|k| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 16.0).sin_cos();
        [0.8, 1.6].into_iter().any(|shift| {
            let pose = Pose2::new(
                pose_fixed_moving.x() + shift * cos,
                pose_fixed_moving.y() + shift * sin,
                pose_fixed_moving.yaw(),
            );
            agreement(fixed, &points, pose, reach) >= 0.85 * at_truth
        })
    })
}

/// Whether an occupied cell's centre lies within `reach` metres of a point of the map's frame.
fn wall_near(map: &OccupancyGrid, point: Point, reach: f64) -> bool {
    let lattice = map.lattice();
    let [u, v] = lattice.to_cells(point);
    let radius = reach / lattice.resolution();
    let span = |at: f64, count: u32| index((at - 0.5 - radius).ceil())..index((at + 0.5 + radius).max(0.0)).min(count);
    span(v, lattice.height()).any(|row| {
        span(u, lattice.width()).any(|column| {
            let off = (f64::from(column) + 0.5 - u).hypot(f64::from(row) + 0.5 - v);
            off <= radius && map.at(column, row).state() == CellState::Occupied
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::grid::{Lattice, LogOdds};

    /// 40 x 20 free cells with a wall along the row 10.
    fn map() -> OccupancyGrid {
        let lattice = Lattice::new(40, 20, 0.1, Pose2::IDENTITY).expect("valid");
        let cell = |i: usize| if i / 40 == 10 { LogOdds::OCCUPIED } else { LogOdds::FREE };
        OccupancyGrid::new(lattice, (0..800).map(cell).collect()).expect("800 cells")
    }

    #[test]
    fn half_a_map_aside_is_half_an_overlap() {
        let compared = compare(&map(), &map(), Pose2::new(2.0, 0.0, Angle::ZERO));
        assert!((compared.overlap - 0.5).abs() < 1e-9 && (compared.common_area - 4.0).abs() < 1e-9);
        assert!((compared.agreement - 1.0).abs() < 1e-9);
        assert!(compare(&map(), &map(), Pose2::new(0.0, 0.5, Angle::ZERO)).agreement < 0.01);
        assert!(compare(&map(), &map(), Pose2::new(9.0, 0.0, Angle::ZERO)).overlap < 1e-9);
    }

    #[test]
    fn a_lone_wall_is_weakly_constrained() {
        assert!(weakly_constrained(&map(), &map(), Pose2::IDENTITY));
    }

    #[test]
    fn walls_are_near_each_other_up_to_the_reach() {
        let aside = |y: f64| walls_within(&map(), &map(), Pose2::new(0.0, y, Angle::ZERO), 0.6);
        assert!(aside(0.59) && !aside(0.7) && !aside(-0.7) && !aside(-30.0));
    }
}
