//! Maps told in other frames.

use crate::geometry::{Angle, Pose2};
use crate::grid::{Lattice, OccupancyGrid};
use crate::simulation::Random;

use super::numbers::index;

/// The same map in another frame, in which the old frame has the given pose: only its origin changes.
///
/// # Panics
/// When that takes the origin beyond what a lattice may have, 100 000 km.
pub(super) fn reframed(map: &OccupancyGrid, pose_new_old: Pose2) -> OccupancyGrid {
    let old = map.lattice();
    let lattice = Lattice::new(old.width(), old.height(), old.resolution(), pose_new_old * old.origin())
        .expect("invariant: frames of experiments are metres apart");
    OccupancyGrid::new(lattice, map.cells().to_vec()).expect("invariant: as many cells as before")
}

/// The same map drawn anew on cells along another frame, in which the old frame has the given pose: what a robot of that
/// frame would have drawn, up to the rounding to its cells.
pub(super) fn redrawn(map: &OccupancyGrid, pose_new_old: Pose2) -> OccupancyGrid {
    let old = map.lattice();
    let cell = old.resolution();
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in old.corners() {
        let at = pose_new_old.apply(corner);
        low = [0, 1].map(|k| at[k].min(low[k]));
        high = [0, 1].map(|k| at[k].max(high[k]));
    }
    let low = low.map(|metres| (metres / cell).floor() * cell);
    let side = |k: usize| index(((high[k] - low[k]) / cell).ceil()).max(1);
    let lattice = Lattice::new(side(0), side(1), cell, Pose2::new(low[0], low[1], Angle::ZERO))
        .expect("invariant: no larger than the map's diagonal");
    crate::grid::resample(map, pose_new_old, lattice)
}

/// Where the moving map is told so that the truth is as the paper's method needs it: a translation of at most 20 cells of
/// 0.05 m on each axis (its own example has [27, 2]), at the rotation that the maps have.
///
/// Returns the moving map and the truth.
pub(super) fn near(moving: &OccupancyGrid, truth: Pose2, random: &mut Random) -> (OccupancyGrid, Pose2) {
    let near = Pose2::new(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), truth.yaw());
    // p_fixed = near * p_new = truth * p_old
    (reframed(moving, near.inverse() * truth), near)
}

/// Where the moving map is told so that nothing is known of the translation: 5 to 15 m on each axis.
///
/// Returns the moving map and the truth.
pub(super) fn far(moving: &OccupancyGrid, truth: Pose2, random: &mut Random) -> (OccupancyGrid, Pose2) {
    let mut metres = || random.pick(&[-1.0, 1.0]) * random.uniform(5.0, 15.0);
    let pose_new_old = Pose2::new(metres(), metres(), Angle::ZERO);
    (reframed(moving, pose_new_old), truth * pose_new_old.inverse())
}

/// The middle of the box around the occupied cells, in the map's frame.
#[cfg(test)]
pub(super) fn middle_of_walls(map: &OccupancyGrid) -> [f64; 2] {
    let lattice = map.lattice();
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for row in 0..lattice.height() {
        for column in 0..lattice.width() {
            if map.at(column, row).state() == crate::grid::CellState::Occupied {
                let at = lattice.cell_center(column, row);
                low = [0, 1].map(|k| at[k].min(low[k]));
                high = [0, 1].map(|k| at[k].max(high[k]));
            }
        }
    }
    if low[0] > high[0] {
        return lattice.to_metres([f64::from(lattice.width()) / 2.0, f64::from(lattice.height()) / 2.0]);
    }
    [f64::midpoint(low[0], high[0]), f64::midpoint(low[1], high[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::LogOdds;

    fn map() -> OccupancyGrid {
        let lattice = Lattice::new(40, 30, 0.05, Pose2::new(-1.0, 2.0, Angle::ZERO)).expect("valid");
        let cells = (0..1200).map(|k| if k % 40 < 7 { LogOdds::OCCUPIED } else { LogOdds::FREE });
        OccupancyGrid::new(lattice, cells.collect()).expect("as many")
    }

    #[test]
    fn every_frame_shows_the_same_place() {
        let truth = Pose2::new(3.0, -4.0, Angle::from_degrees(70.0));
        let place = truth.apply(map().lattice().cell_center(3, 3));
        for told in [near, far] {
            let (moved, pose) = told(&map(), truth, &mut Random::new(1, &[]));
            let [x, y] = pose.apply(moved.lattice().cell_center(3, 3));
            assert!((x - place[0]).hypot(y - place[1]) < 1e-9);
            assert!((pose.yaw() - truth.yaw()).magnitude() < 1e-12);
        }
    }

    #[test]
    fn a_map_drawn_anew_keeps_its_walls_within_a_cell() {
        let pose = Pose2::new(5.0, 1.0, Angle::from_degrees(33.0));
        let drawn = redrawn(&map(), pose);
        let share = drawn.known_area() / map().known_area();
        assert!((share - 1.0).abs() < 0.02, "{share}");
        let (was, is) = (pose.apply(middle_of_walls(&map())), middle_of_walls(&drawn));
        assert!((was[0] - is[0]).hypot(was[1] - is[1]) < 0.1, "{was:?} {is:?}");
    }
}
