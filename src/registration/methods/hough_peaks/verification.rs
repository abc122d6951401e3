//! Verification of a hypothesis (eq. 33 and 34) and what else speaks for it.
//!
//! **Method.** V over the cells known in both maps, at their own resolutions. Walls: an occupied cell of one map matches
//! when an occupied cell of the other lies in its cell or next to it; it is violated when it does not and its cell is free
//! in the other map.
//!
//! **Fails when** V is taken for proof: at wrong poses free space agrees with free space, and more than half of them have
//! V above 92 % on real maps.
//!
//! **Differences from the paper.** See `overlap`, for what counts as disagreement.

use super::features::Features;
use super::hough_image::to_f64;
use super::params::{Disagreement, HoughPeaksParams};
use crate::geometry::{Point, Pose2};
use crate::grid::CellState;
use crate::registration::overlap::{Comparison, StateMap, compare};
use crate::registration::{Candidate, Covariance, Evidence};

/// Error of a right answer in cells, on each axis amid the common area: measured on maps of known poses.
const SIGMA_CELLS: f64 = 1.5;
/// Error of a right answer's rotation in radians: a quarter of a degree, measured likewise.
const SIGMA_RAD: f64 = 0.0044;

/// The paper's V of a comparison, by the chosen disagreement.
pub(super) fn verification_index(comparison: &Comparison, disagreement: Disagreement) -> Option<f64> {
    match disagreement {
        Disagreement::KnownInBoth => comparison.verification_index(),
        Disagreement::KnownInOne => comparison.verification_index_over_union(),
    }
}

/// A hypothesis with its evidence. `fixed` and `moving` are in cells of one size; `support_m` is the wall that holds its
/// weaker direction.
pub(super) fn verified(
    (fixed_map, moving_map): (&StateMap, &StateMap),
    (fixed, moving): (&Features, &Features),
    pose_fixed_moving: Pose2,
    support_m: f64,
    params: &HoughPeaksParams,
) -> Candidate {
    let comparison = compare(fixed_map, moving_map, pose_fixed_moving);
    let index = verification_index(&comparison, params.disagreement);
    let there = walls_in(moving, fixed, pose_fixed_moving);
    let back = walls_in(fixed, moving, pose_fixed_moving.inverse());
    Candidate {
        pose_fixed_moving,
        covariance: covariance(pose_fixed_moving, moving),
        evidence: Evidence {
            score: index.unwrap_or(0.0),
            verification_index: index,
            overlap: comparison.overlap(),
            matched_wall_m: f64::midpoint(there.matched_m, back.matched_m),
            violated_wall_m: f64::midpoint(there.violated_m, back.violated_m),
            weaker_direction_m: support_m,
            runner_up: None,
        },
    }
}

struct Walls {
    matched_m: f64,
    violated_m: f64,
}

/// The walls of one map looked up in the other.
fn walls_in(walls: &Features, other: &Features, pose_other_walls: Pose2) -> Walls {
    let map = &other.states;
    let lattice = map.lattice();
    let (width, height) = (lattice.width(), lattice.height());
    let motion = (lattice.origin().inverse() * pose_other_walls).motion();
    let (mut matched, mut violated) = (0_usize, 0_usize);
    let [cx, cy] = walls.points.center;
    for [x, y] in &walls.points.local {
        let metres = [(cx + f64::from(*x)) * walls.cell(), (cy + f64::from(*y)) * walls.cell()];
        let Some((column, row)) = lattice.cell_of(motion.apply(metres).map(|m| m / lattice.resolution())) else {
            continue;
        };
        let near = |row| {
            (column.saturating_sub(1)..=(column + 1).min(width - 1))
                .any(|column| map.at(column, row) == CellState::Occupied)
        };
        if (row.saturating_sub(1)..=(row + 1).min(height - 1)).any(near) {
            matched += 1;
        } else if map.at(column, row) == CellState::Free {
            violated += 1;
        }
    }
    Walls {
        matched_m: to_f64(matched) * walls.cell(),
        violated_m: to_f64(violated) * walls.cell(),
    }
}

/// Independent errors amid the moving map's walls, told of its frame's origin.
fn covariance(pose: Pose2, moving: &Features) -> Covariance {
    let middle: Point = pose.apply(moving.points.center.map(|cells| cells * moving.cell()));
    let (rx, ry) = (pose.x() - middle[0], pose.y() - middle[1]);
    let (m, r) = ((SIGMA_CELLS * moving.cell()).powi(2), SIGMA_RAD.powi(2));
    // the origin moves by the error of the middle plus the rotation's error across the arm (rx, ry)
    Covariance([
        [m + r * ry * ry, -r * rx * ry, -r * ry],
        [-r * rx * ry, m + r * rx * rx, r * rx],
        [-r * ry, r * rx, r],
    ])
}

/// RMS distance in metres between the moving map's occupied cells under two poses.
pub(super) fn distance_between(moving: &Features, one: Pose2, other: Pose2) -> f64 {
    let points = &moving.points;
    let count = to_f64(points.len().max(1));
    let (mut mean, mut square) = ([0.0; 2], 0.0);
    for [x, y] in points.local.iter().map(|point| point.map(f64::from)) {
        mean = [mean[0] + x / count, mean[1] + y / count];
        square += (x * x + y * y) / count;
    }
    // about their mean the cells are apart by the chord of the turn, and all by the distance of the mean
    let spread = (square - mean[0] * mean[0] - mean[1] * mean[1]).max(0.0) * moving.cell().powi(2);
    let middle = [0, 1].map(|k| (points.center[k] + mean[k]) * moving.cell());
    let (here, there) = (one.apply(middle), other.apply(middle));
    let chord = 2.0 * ((one.yaw() - other.yaw()).radians() / 2.0).sin();
    ((here[0] - there[0]).powi(2) + (here[1] - there[1]).powi(2) + chord * chord * spread).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::grid::Lattice;
    use proptest::prelude::*;

    fn features(width: u32, origin: Pose2) -> Features {
        let lattice = Lattice::new(width, 40, 0.1, origin).expect("valid");
        let state = |i: usize| match i % 7 {
            0 => CellState::Occupied,
            1..=4 => CellState::Free,
            _ => CellState::Unknown,
        };
        let states = (0..lattice.cell_count()).map(state).collect();
        Features::new(StateMap::from_states(lattice, states), &HoughPeaksParams::default())
    }

    fn pose() -> impl Strategy<Value = Pose2> {
        (-9.0..9.0_f64, -9.0..9.0_f64, -4.0..4.0_f64).prop_map(|(x, y, yaw)| Pose2::new(x, y, Angle::from_radians(yaw)))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn the_distance_of_two_poses_is_that_of_the_cells_under_them(one in pose(), other in pose()) {
            let map = features(50, Pose2::new(3.0, -2.0, Angle::from_degrees(25.0)));
            let lattice = map.states.lattice();
            let (mut sum, mut count) = (0.0, 0.0);
            for row in 0..lattice.height() {
                for column in 0..lattice.width() {
                    if map.states.at(column, row) == CellState::Occupied {
                        let center = lattice.cell_center(column, row);
                        let (a, b) = (one.apply(center), other.apply(center));
                        sum += (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
                        count += 1.0;
                    }
                }
            }
            let slow = (sum / count).sqrt();
            prop_assert!((distance_between(&map, one, other) - slow).abs() < 1e-3 * (1.0 + slow));
        }
    }

    #[test]
    fn walls_match_next_to_walls_and_are_violated_in_free_space() {
        let lattice = Lattice::new(10, 4, 0.5, Pose2::IDENTITY).expect("valid");
        let of = |row: [CellState; 10]| {
            let states = (0..4).flat_map(|_| row).collect();
            Features::new(StateMap::from_states(lattice, states), &HoughPeaksParams::default())
        };
        let (u, f, o) = (CellState::Unknown, CellState::Free, CellState::Occupied);
        let one = of([u, o, f, f, f, f, f, o, f, o]);
        let other = of([u, f, o, f, f, f, f, f, f, u]);
        // of the three columns the first matches the neighbour, the second lies in free space, the third is unknown there
        let walls = walls_in(&one, &other, Pose2::IDENTITY);
        assert!((walls.matched_m - 2.0).abs() < 1e-9 && (walls.violated_m - 2.0).abs() < 1e-9);
    }

    #[test]
    fn far_from_the_walls_the_frames_origin_is_known_less_well() {
        let near = features(50, Pose2::new(-2.5, -2.0, Angle::ZERO));
        let far = features(50, Pose2::new(97.5, -2.0, Angle::ZERO));
        let of = |map: &Features| covariance(Pose2::new(1.0, 2.0, Angle::from_degrees(30.0)), map).0;
        let along = |c: [[f64; 3]; 3]| c[0][0] + c[1][1];
        assert!(along(of(&far)) > 5.0 * along(of(&near)));
        for c in [of(&near), of(&far)] {
            assert!((c[0][1] - c[1][0]).abs() < 1e-12 && (c[0][2] - c[2][0]).abs() < 1e-12);
            assert!(c[0][0] * c[1][1] > c[0][1] * c[1][0]);
        }
    }
}
