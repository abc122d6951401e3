use super::*;
use crate::grid::{Lattice, LogOdds, OccupancyGrid, resample, resample_onto};
use crate::registration::overlap::compare;
use proptest::prelude::*;

/// Rooms and corridors of a few cells, unknown around them.
fn map(width: u32, height: u32, origin: Pose2, seed: u32) -> OccupancyGrid {
    let lattice = Lattice::new(width, height, 0.1, origin).expect("a valid lattice");
    let cells = (0..width * height).map(|i| {
        let (x, y) = (i % width + seed % 5, i / width);
        // squares and triangular numbers: no two spaces between walls are alike
        let is_wall = |k: u32| (0..=k).any(|n| n * n == k || n * (n + 1) / 2 + 3 == k);
        if is_wall(x) || is_wall(y + seed % 3) {
            LogOdds::OCCUPIED
        } else if (x * 7 + y * 3 + seed) % 29 < 20 {
            LogOdds::FREE
        } else {
            LogOdds::UNKNOWN
        }
    });
    OccupancyGrid::new(lattice, cells.collect()).expect("as many cells")
}

/// The fused map on the canvas of all shifts, and its entropy, cell by cell.
fn entropy_oracle(fixed: &OccupancyGrid, moving: &OccupancyGrid, pose: Pose2, reach: usize, shift: Shift) -> f64 {
    let (states, moved) = (StateMap::new(fixed), StateMap::new(moving));
    let (low, high) = moved_box(&states, &moved, pose);
    let reach = to_f64(reach);
    let size = [f64::from(fixed.lattice().width()), f64::from(fixed.lattice().height())];
    let start = [(low[0] - reach).min(0.0), (low[1] - reach).min(0.0)];
    let end = [(high[0] + reach).max(size[0]), (high[1] + reach).max(size[1])];
    let cells = |k: usize| (end[k] - start[k]).round() as u32;
    let corner = fixed.lattice().to_metres(start);
    let origin = Pose2::new(corner[0], corner[1], fixed.lattice().origin().yaw());
    let canvas = Lattice::new(cells(0), cells(1), fixed.lattice().resolution(), origin).expect("valid");
    let mut fused = resample(fixed, Pose2::IDENTITY, canvas);
    resample_onto(&mut fused, moving, shift.applied(pose, &states), LogOdds::fused_with);
    let mut histogram = std::collections::BTreeMap::new();
    for cell in fused.cells() {
        // unknown and undecided have the same grey value
        let level = cell.value().map_or(0, |value| (value * 128.0).round() as i64);
        *histogram.entry(level).or_insert(0_u32) += 1;
    }
    let n = fused.cells().len() as f64;
    histogram
        .values()
        .map(|count| f64::from(*count) / n)
        .map(|p| -p * p.log2())
        .sum()
}

/// On the border between two cells rounding may choose either.
fn yaws() -> impl Strategy<Value = f64> {
    -3.0..3.0_f64
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_counts_of_every_shift_equal_those_of_laying_the_maps_over_each_other(yaw in yaws(), x in -2.0..2.0_f64,
                                                                               y in -2.0..2.0_f64, seed in 0_u32..20) {
        let fixed = map(90, 70, Pose2::new(-4.0, -3.0, Angle::from_radians(0.4)), seed);
        let moving = map(60, 75, Pose2::new(-3.0, -3.5, Angle::from_radians(-0.2)), seed + 3);
        let (fixed, moving) = (StateMap::new(&fixed), StateMap::new(&moving));
        let pose = Pose2::new(x, y, Angle::from_radians(yaw));
        let window = Window::of_known(&fixed).expect("something is known");
        let tallies = tallies(&fixed, &moving, pose, &window, [3, 2]);
        prop_assert_eq!(tallies.len(), 7 * 5);
        for (shift, tally) in tallies {
            // cell by cell, by the public doors of the lattices
            let mut slow = Tally::default();
            let back = shift.applied(pose, &fixed).inverse();
            for row in 0..fixed.lattice().height() {
                for column in 0..fixed.lattice().width() {
                    let point = back.apply(fixed.lattice().cell_center(column, row));
                    let there = moving.lattice().cell_at(point).map_or(CellState::Unknown, |(i, j)| moving.at(i, j));
                    let here = fixed.at(column, row);
                    if here != CellState::Unknown && there != CellState::Unknown {
                        slow.common += 1;
                        slow.agreeing += u32::from(here == there);
                        slow.both_occupied += u32::from(here == there && here == CellState::Occupied);
                    }
                }
            }
            // a centre on the border of two cells may fall to either by rounding
            prop_assert!(tally.common.abs_diff(slow.common) <= 2 && tally.agreeing.abs_diff(slow.agreeing) <= 2
                         && tally.both_occupied.abs_diff(slow.both_occupied) <= 2, "{tally:?} {slow:?} {shift:?}");
        }
    }

    #[test]
    fn the_entropy_from_counts_equals_that_of_the_fused_map(yaw in yaws(), x in -3.0..3.0_f64, seed in 0_u32..20) {
        let fixed = map(60, 50, Pose2::new(-2.0, -1.0, Angle::from_radians(0.3)), seed);
        let moving = map(45, 55, Pose2::new(-1.5, -2.0, Angle::from_radians(-0.5)), seed + 1);
        let pose = Pose2::new(x, 0.5, Angle::from_radians(yaw));
        let params = HoughPeaksParams { translation_tuning: TranslationTuning::Entropy, ..HoughPeaksParams::default() };
        let (states, moved) = (StateMap::new(&fixed), StateMap::new(&moving));
        let totals = Totals::new(&states, &moved, pose, [2, 2], &params);
        let window = Window::of_known(&states).expect("something is known");
        for (shift, tally) in tallies(&states, &moved, pose, &window, [2, 2]) {
            let slow = entropy_oracle(&fixed, &moving, pose, 2, shift);
            prop_assert!((totals.entropy(&tally) - slow).abs() < 2e-3, "{} {slow}", totals.entropy(&tally));
        }
    }
}

#[test]
fn the_greatest_verification_index_is_at_the_truth() {
    let fixed = map(150, 120, Pose2::new(-7.0, -6.0, Angle::ZERO), 0);
    let fixed = StateMap::new(&fixed);
    let params = HoughPeaksParams::default();
    let truth = Pose2::new(0.2, -0.1, Angle::ZERO);
    let moving = StateMap::new(&resample(
        &map(150, 120, Pose2::new(-7.0, -6.0, Angle::ZERO), 0),
        truth.inverse(),
        *fixed.lattice(),
    ));
    for (x, y) in [(0.7, -0.8), (-0.5, 0.5), (0.2, -0.1)] {
        let tuned = tuned_translation(&fixed, &moving, Pose2::new(x, y, Angle::ZERO), &params);
        assert!((tuned.x() - truth.x()).hypot(tuned.y() - truth.y()) < 0.01, "{tuned:?}");
        assert_eq!(compare(&fixed, &moving, tuned).verification_index(), Some(1.0));
    }
}

#[test]
fn without_known_cells_or_without_tuning_the_pose_stays() {
    let known = StateMap::new(&map(50, 50, Pose2::IDENTITY, 0));
    let nothing = StateMap::new(&OccupancyGrid::unknown(*known.lattice()));
    let pose = Pose2::new(0.3, 0.4, Angle::from_degrees(10.0));
    let params = HoughPeaksParams::default();
    assert_eq!(tuned_translation(&nothing, &known, pose, &params), pose);
    assert_eq!(tuned_translation(&known, &nothing, pose, &params), pose);
    let off = HoughPeaksParams {
        translation_tuning: TranslationTuning::Off,
        ..params
    };
    assert_eq!(tuned_translation(&known, &known, pose, &off), pose);
}
