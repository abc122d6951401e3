//! The fused map against its plain definition, and what must not change it.

use proptest::prelude::*;

use super::*;
use crate::geometry::Angle;
use crate::grid::CellState;

fn grid(width: u32, height: u32, resolution: f64, origin: Pose2, seed: u64) -> OccupancyGrid {
    let lattice = Lattice::new(width, height, resolution, origin).expect("valid");
    let mut state = seed;
    let cells = (0..lattice.cell_count()).map(|_| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        match (state >> 60) % 4 {
            0 => LogOdds::OCCUPIED,
            1 => LogOdds::FREE,
            2 => LogOdds::from_value(0.25),
            _ => LogOdds::UNKNOWN,
        }
    });
    OccupancyGrid::new(lattice, cells.collect()).expect("as many cells")
}

fn pose() -> impl Strategy<Value = Pose2> {
    (-1.0..1.0_f64, -1.0..1.0_f64, -4.0..4.0_f64).prop_map(|(x, y, yaw)| Pose2::new(x, y, Angle::from_radians(yaw)))
}

#[test]
fn an_anchor_alone_is_the_fused_map_cell_by_cell() {
    let anchor = grid(31, 17, 0.05, Pose2::new(-3.217, 2.05, Angle::ZERO), 1);
    let fused = fuse(&anchor, &[], &FuseOptions::default()).expect("it fuses");
    assert_eq!(fused.grid, anchor);
    assert_eq!(fused.conflicts.expect("asked for").cells(), 0);
}

#[test]
fn the_anchors_cells_map_one_to_one_however_far_the_others_reach() {
    let anchor = grid(31, 17, 0.05, Pose2::new(-3.217, 2.05, Angle::ZERO), 1);
    let silent = OccupancyGrid::new(
        Lattice::new(9, 9, 0.05, Pose2::IDENTITY).expect("valid"),
        vec![LogOdds::from_value(0.0); 81],
    )
    .expect("as many");
    let other = PlacedMap {
        grid: &silent,
        pose_anchor_map: Pose2::new(-5.511, 0.333, Angle::from_degrees(40.0)),
    };
    let fused = fuse(&anchor, &[other], &FuseOptions::default()).expect("it fuses").grid;
    let [u, v] = fused.lattice().to_cells(anchor.lattice().origin().translation());
    assert!(
        (u - u.round()).abs() < 1e-6 && (v - v.round()).abs() < 1e-6,
        "snapped to the anchor's cells"
    );
    let (left, below) = (count(u.round()), count(v.round()));
    assert!(left > 20 && below > 20);
    for row in 0..17 {
        for column in 0..31 {
            let [seen, was] = [fused.at(left + column, below + row), anchor.at(column, row)];
            assert!(seen == was || (!was.is_known() && seen == LogOdds::from_value(0.0)));
        }
    }
}

#[test]
fn a_yaw_in_the_anchors_origin_stays_out_of_the_fused_maps_origin() {
    let anchor = grid(40, 30, 0.05, Pose2::new(1.0, 2.0, Angle::from_degrees(30.0)), 1);
    let fused = fuse(&anchor, &[], &FuseOptions::default()).expect("it fuses").grid;
    assert_eq!(fused.lattice().origin().yaw(), Angle::ZERO);
    for corner in anchor.lattice().corners() {
        let [u, v] = fused.lattice().to_cells(corner);
        assert!(u > -1e-2 && v > -1e-2);
        assert!(u < f64::from(fused.lattice().width()) + 1e-2 && v < f64::from(fused.lattice().height()) + 1e-2);
    }
}

#[test]
fn a_fused_map_over_the_limit_is_refused_with_its_size_and_the_limit() {
    let anchor = grid(10, 10, 0.05, Pose2::IDENTITY, 1);
    let far = PlacedMap {
        grid: &anchor,
        pose_anchor_map: Pose2::new(1000.0, 0.0, Angle::ZERO),
    };
    let options = FuseOptions {
        cells_max: 100_000,
        ..FuseOptions::default()
    };
    let error = fuse(&anchor, &[far], &options).expect_err("too large").to_string();
    assert!(error.contains("20010 x 10") && error.contains("100000"), "{error}");
    let options = FuseOptions {
        resolution: Some(0.0),
        ..FuseOptions::default()
    };
    let error = fuse(&anchor, &[], &options).expect_err("no resolution").to_string();
    assert!(error.contains("resolution 0 m/cell"), "{error}");
}

#[test]
fn a_wall_in_another_maps_free_space_is_a_conflict_and_a_wall_beside_its_wall_is_none() {
    let lattice = Lattice::new(40, 5, 0.05, Pose2::IDENTITY).expect("valid");
    let with_wall_at = |column: u32| {
        let mut grid = OccupancyGrid::new(lattice, vec![LogOdds::FREE; 200]).expect("as many");
        (0..5).for_each(|row| grid.cells_mut()[lattice.index(column, row)] = LogOdds::OCCUPIED);
        grid
    };
    let conflicts = |a: u32, b: u32| {
        let other = PlacedMap {
            grid: &with_wall_at(b),
            pose_anchor_map: Pose2::IDENTITY,
        };
        let fused = fuse(&with_wall_at(a), &[other], &FuseOptions::default()).expect("it fuses");
        fused.conflicts.expect("asked for").cells()
    };
    assert_eq!(conflicts(10, 10), 0);
    assert_eq!(conflicts(10, 12), 0);
    assert_eq!(conflicts(10, 20), 10);
}

#[test]
fn two_halves_of_a_sub_cell_step_leave_a_wall_as_thick_as_it_was() {
    let lattice = Lattice::new(60, 60, 0.05, Pose2::IDENTITY).expect("valid");
    let mut wall = OccupancyGrid::unknown(lattice);
    (0..60).for_each(|row| wall.cells_mut()[lattice.index(30, row)] = LogOdds::OCCUPIED);
    let anchor = OccupancyGrid::unknown(lattice);
    for shift in [0.0, 0.01, 0.024, 0.026, 0.04] {
        let placed = PlacedMap {
            grid: &wall,
            pose_anchor_map: Pose2::new(shift, 0.3 * shift, Angle::ZERO),
        };
        let fused = fuse(&anchor, &[placed], &FuseOptions::default())
            .expect("it fuses")
            .grid;
        for row in 1..59 {
            let thickness = fused
                .row(row)
                .iter()
                .filter(|cell| cell.state() == CellState::Occupied)
                .count();
            assert_eq!(thickness, 1, "shift {shift} m, row {row}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn each_cell_is_the_sum_of_what_the_maps_say_in_any_order_and_on_any_number_of_threads(
        a in pose(), b in pose(), yaw in -0.3..0.3_f64, resolution in 0.04..0.12_f64,
    ) {
        let anchor = grid(30, 20, 0.05, Pose2::new(-0.4, 0.3, Angle::from_radians(yaw)), 1);
        let (one, two) = (grid(25, 35, 0.05, Pose2::IDENTITY, 2), grid(15, 12, 0.1, Pose2::new(0.1, 0.0, Angle::HALF_TURN), 3));
        let placed = [
            PlacedMap { grid: &one, pose_anchor_map: a },
            PlacedMap { grid: &two, pose_anchor_map: b },
        ];
        let options = FuseOptions { resolution: Some(resolution), ..FuseOptions::default() };
        let fused = fuse(&anchor, &placed, &options).expect("it fuses");
        let swapped = fuse(&anchor, &[placed[1], placed[0]], &options).expect("it fuses");
        prop_assert_eq!(&fused, &swapped);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        prop_assert_eq!(&fused, &pool.install(|| fuse(&anchor, &placed, &options)).expect("it fuses"));
        // the slow definition
        let lattice = *fused.grid.lattice();
        let layers = [
            crate::grid::resample(&anchor, Pose2::IDENTITY, lattice),
            crate::grid::resample(&one, a, lattice),
            crate::grid::resample(&two, b, lattice),
        ];
        for index in 0..lattice.cell_count() {
            let sum = layers.iter().fold(LogOdds::UNKNOWN, |sum, layer| sum.fused_with(layer.cells()[index]));
            prop_assert_eq!(fused.grid.cells()[index], sum);
        }
    }
}
