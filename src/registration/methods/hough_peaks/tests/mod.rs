use super::*;
use crate::geometry::{Angle, Pose2};
use crate::grid::{Lattice, LogOdds};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;
use crate::registration::methods::shared::world::{Seen, World};
use crate::registration::{Reason, Unhurried, register};

const WEST: Seen = Seen {
    low: [-0.2, -0.2],
    high: [15.6, 14.2],
};
const EAST: Seen = Seen {
    low: [6.3, -0.2],
    high: [22.2, 14.2],
};

/// The frame of the fixed map in the world.
fn fixed_frame() -> Pose2 {
    Pose2::new(10.5, 6.9, Angle::from_degrees(17.0))
}

fn default_method() -> HoughPeaks {
    HoughPeaks::new(HoughPeaksParams::default()).expect("defaults")
}

/// The west of the office and its east, whose frame has the given pose in the west's frame.
fn office_pair(pose_fixed_moving: Pose2, resolution: f64) -> (OccupancyGrid, OccupancyGrid) {
    let fixed = World::office().map(WEST, fixed_frame(), 0.05);
    let moving = World::office().map(EAST, fixed_frame() * pose_fixed_moving, resolution);
    (fixed, moving)
}

/// RMS displacement of the moving map's occupied cells between two poses.
fn error_m(method: &HoughPeaks, moving: &OccupancyGrid, a: Pose2, b: Pose2) -> f64 {
    let features = method.features(moving);
    features.of::<Features>().map.distance_between(a, b)
}

/// The answer is right within half a metre, as answers are judged, and within what the method promises.
fn assert_registers(truth: Pose2, resolution: f64) {
    let method = default_method();
    let (fixed, moving) = office_pair(truth, resolution);
    let answer = register(&method, &fixed, &moving, &Unhurried);
    let accepted = answer.accepted().unwrap_or_else(|| panic!("at {truth:?}: {answer:?}"));
    let error = error_m(&method, &moving, accepted.pose_fixed_moving, truth);
    assert!(error < 0.15, "error {error} m at {truth:?}");
    let evidence = &accepted.evidence;
    assert!(evidence.verification_index.expect("known in both") >= 0.92);
    assert!((0.5..0.7).contains(&evidence.overlap), "overlap {}", evidence.overlap);
    assert!(
        evidence.matched_wall_m > 20.0 * evidence.violated_wall_m,
        "{evidence:?}"
    );
    assert!(evidence.weaker_direction_m > 1.0, "{evidence:?}");
}

#[test]
fn small_rotations_as_in_the_papers_first_experiment_are_found() {
    for degrees in [-5.5, -3.0, 0.0, 2.4, 8.0] {
        assert_registers(Pose2::new(1.0, 0.1, Angle::from_degrees(degrees)), 0.05);
    }
}

#[test]
fn rotations_near_ninety_degrees_as_in_the_papers_real_experiment_are_found() {
    for degrees in [86.3, 90.0, 93.1, -88.2, -95.0] {
        assert_registers(Pose2::new(-0.4, 0.8, Angle::from_degrees(degrees)), 0.05);
    }
}

#[test]
fn rotations_by_half_turns_are_told_from_none() {
    for degrees in [180.0, 176.5, -174.2, -135.0] {
        assert_registers(Pose2::new(0.7, -0.6, Angle::from_degrees(degrees)), 0.05);
    }
}

#[test]
fn maps_of_two_resolutions_are_registered_in_cells_of_the_coarser_one() {
    let truth = Pose2::new(0.5, -0.3, Angle::from_degrees(-6.0));
    // in larger cells walls are thicker, and have more votes
    let params = HoughPeaksParams {
        v_gate: 60.0,
        ..HoughPeaksParams::default()
    };
    let method = HoughPeaks::new(params).expect("in range");
    let (fixed, moving) = office_pair(truth, 0.08);
    let answer = register(&method, &fixed, &moving, &Unhurried);
    let accepted = answer.accepted().unwrap_or_else(|| panic!("{answer:?}"));
    assert!(error_m(&method, &moving, accepted.pose_fixed_moving, truth) < 0.3);
}

#[test]
fn a_translation_beyond_the_gate_is_not_found() {
    let (fixed, moving) = office_pair(Pose2::new(6.0, 5.0, Angle::from_degrees(20.0)), 0.05);
    let method = default_method();
    if let Some(accepted) = register(&method, &fixed, &moving, &Unhurried).accepted() {
        // what the paper's threshold lets through is at least seen to be bad
        assert!(accepted.evidence.violated_wall_m > accepted.evidence.matched_wall_m);
    }
}

#[test]
fn maps_of_different_worlds_are_rejected() {
    let fixed = World::office().map(WEST, fixed_frame(), 0.05);
    let moving = World::hall().map(EAST, fixed_frame(), 0.05);
    let answer = register(&default_method(), &fixed, &moving, &Unhurried);
    let Registration::Rejected(rejection) = answer else {
        panic!("accepted: {answer:?}")
    };
    assert!(
        !matches!(rejection.reason, Reason::NoStructure { .. }),
        "{:?}",
        rejection.reason
    );
}

#[test]
fn a_corridor_without_ends_is_under_constrained_along_itself() {
    let corridor = World::of_walls(&[[-40.0, 0.0, 40.0, 0.0], [-40.0, 2.3, 40.0, 2.3]]);
    let seen = |from: f64, to: f64| Seen {
        low: [from, -0.2],
        high: [to, 2.5],
    };
    let frame = Pose2::new(3.0, 1.0, Angle::from_degrees(30.0));
    let fixed = corridor.map(seen(-8.0, 8.0), frame, 0.05);
    let moving = corridor.map(
        seen(-6.0, 10.0),
        frame * Pose2::new(0.4, 0.2, Angle::from_degrees(-5.0)),
        0.05,
    );
    let Registration::Rejected(rejection) = register(&default_method(), &fixed, &moving, &Unhurried) else {
        panic!("nothing holds the maps along the corridor")
    };
    let Reason::UnderConstrained {
        free_direction,
        support_m,
        needed_m,
    } = rejection.reason
    else {
        panic!("{:?}", rejection.reason)
    };
    assert!(support_m < needed_m);
    // the corridor runs along x of the world: at -30 degrees in the fixed map's frame
    let error = free_direction.radians() + 30.0_f64.to_radians();
    assert!(error.sin().abs() < 0.04, "{}", free_direction.degrees());
}

#[test]
fn maps_without_walls_have_no_structure() {
    let lattice = Lattice::new(60, 40, 0.05, Pose2::IDENTITY).expect("valid");
    let free = OccupancyGrid::new(lattice, vec![LogOdds::FREE; lattice.cell_count()]).expect("as many cells");
    let office = World::office().map(WEST, fixed_frame(), 0.05);
    for poor in [&OccupancyGrid::unknown(lattice), &free] {
        for (fixed, moving) in [(poor, &office), (&office, poor), (poor, poor)] {
            let Registration::Rejected(rejection) = register(&default_method(), fixed, moving, &Unhurried) else {
                panic!("a map without walls was placed")
            };
            assert!(
                matches!(rejection.reason, Reason::NoStructure { structure_m, needed_m } if structure_m < needed_m)
            );
            assert!(rejection.candidates.is_empty());
        }
    }
}

#[test]
fn a_map_that_is_all_wall_does_no_harm() {
    let lattice = Lattice::new(70, 50, 0.05, Pose2::new(1e8, -1e8, Angle::from_degrees(40.0))).expect("valid");
    let wall = OccupancyGrid::new(lattice, vec![LogOdds::OCCUPIED; lattice.cell_count()]).expect("as many cells");
    let office = World::office().map(WEST, fixed_frame(), 0.05);
    for (fixed, moving) in [(&wall, &office), (&office, &wall), (&wall, &wall)] {
        // any answer will do
        let _ = register(&default_method(), fixed, moving, &Unhurried);
    }
}

#[test]
fn the_literal_reading_runs_and_its_own_verification_refuses_a_partial_overlap() {
    let (fixed, moving) = office_pair(Pose2::new(0.5, 0.2, Angle::from_degrees(-5.0)), 0.05);
    let literal = HoughPeaks::new(HoughPeaksParams::literal()).expect("in range");
    assert!(register(&literal, &fixed, &moving, &Unhurried).accepted().is_none());
}

#[test]
fn the_answer_is_the_same_on_any_number_of_threads() {
    let (fixed, moving) = office_pair(Pose2::new(0.5, -0.7, Angle::from_degrees(88.0)), 0.05);
    let on_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| register(&default_method(), &fixed, &moving, &Unhurried))
    };
    let alone = on_threads(1);
    assert!(alone.accepted().is_some());
    for threads in [2, 5] {
        assert_eq!(on_threads(threads), alone);
    }
}

#[test]
fn the_method_can_be_stopped_between_any_two_stages_and_inside_them() {
    let (fixed, moving) = office_pair(Pose2::new(0.5, -0.7, Angle::from_degrees(-5.0)), 0.05);
    let names = [
        "rotation candidates",
        "rotation tuning",
        "peak matching",
        "translation tuning",
        "verification",
    ];
    let looks = assert_stops_wherever_it_looks(&default_method(), (&fixed, &moving), &names);
    assert!(looks > 20, "{looks}: four candidates twice in each of four stages");
}

#[test]
fn an_answer_below_the_threshold_is_given_only_when_the_caller_asks_for_it() {
    let (fixed, moving) = office_pair(Pose2::new(0.5, 0.2, Angle::from_degrees(-5.0)), 0.05);
    let answer = |accept_unverified| {
        let params = HoughPeaksParams {
            verification_threshold: 1.0,
            accept_unverified,
            ..HoughPeaksParams::default()
        };
        let method = HoughPeaks::new(params).expect("in range");
        (
            method.required_verification(),
            register(&method, &fixed, &moving, &Unhurried),
        )
    };
    let (required, Registration::Rejected(rejection)) = answer(false) else {
        panic!("no two maps agree in every cell")
    };
    assert_eq!(required, Some(1.0));
    let Reason::VerificationFailed { verification_index, .. } = rejection.reason else {
        panic!("{:?}", rejection.reason)
    };
    let (required, answer) = answer(true);
    let accepted = answer.accepted().expect("asked for");
    assert_eq!(
        (required, accepted.evidence.verification_index),
        (None, Some(verification_index))
    );
    assert_eq!(accepted.pose_fixed_moving, rejection.candidates[0].pose_fixed_moving);
}
