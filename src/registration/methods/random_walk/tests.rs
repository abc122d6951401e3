use super::*;
use crate::registration::methods::shared::contract::{self, Trial};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;

/// All tests here run with the seed of the defaults, 1, unless they say so.
fn default_method() -> RandomWalk {
    RandomWalk::new(RandomWalkParams::default()).expect("defaults")
}

#[test]
fn maps_of_one_place_are_found_at_small_rotations() {
    for (x, y, degrees) in [(0.4, -0.3, 0.0), (1.5, 2.0, 3.4), (-4.0, 1.2, -8.6)] {
        contract::assert_finds(&default_method(), &Trial::full_overlap(x, y, degrees), 0.2);
    }
}

#[test]
fn maps_of_one_place_are_found_at_large_rotations_wherever_their_frames_lie() {
    for (x, y, degrees) in [
        (60.0, -35.0, 41.7),
        (-12.0, 9.0, 93.2),
        (3.0, 250.0, -137.0),
        (7.0, 7.0, 178.8),
    ] {
        contract::assert_finds(&default_method(), &Trial::full_overlap(x, y, degrees), 0.2);
    }
}

#[test]
fn maps_without_walls_are_refused() {
    contract::assert_refuses_maps_without_walls(&default_method());
}

#[test]
fn nothing_below_the_threshold_is_accepted_unless_the_caller_asks() {
    contract::assert_nothing_below_the_threshold(|verification_threshold, accept_unverified| {
        let params = RandomWalkParams {
            verification_threshold,
            accept_unverified,
            ..RandomWalkParams::default()
        };
        Box::new(RandomWalk::new(params).expect("in range"))
    });
}

#[test]
fn the_answer_is_the_same_on_any_number_of_threads_and_inverse_for_the_inverse_pair() {
    let trial = Trial::full_overlap(5.0, -3.0, 64.0);
    contract::assert_deterministic(&default_method(), &trial);
    contract::assert_inverse_pair_has_the_inverse_answer(&default_method(), &trial);
}

#[test]
fn the_method_can_be_stopped_between_any_two_stages_and_inside_them() {
    let trial = Trial::partial_overlap(0.5, -0.7, -5.0);
    let params = RandomWalkParams {
        start_rotations: 36,
        start_translations: 6,
        walks: 3,
        steps: 300,
        ..RandomWalkParams::default()
    };
    let method = RandomWalk::new(params).expect("in range");
    let names = ["start set", "walks", "verification"];
    let looks = assert_stops_wherever_it_looks(&method, (&trial.fixed, &trial.moving), &names);
    assert!(
        looks > 50,
        "{looks}: each of 36 rotations of the set, each of 3 walks five times"
    );
}

#[test]
fn a_parameter_out_of_range_is_refused_by_name_value_and_limit() {
    assert_eq!(RandomWalkParams::default().validate(), Ok(()));
    let bad = RandomWalkParams {
        adaptation: 7.5,
        ..RandomWalkParams::default()
    };
    let message = bad.validate().expect_err("out of range").to_string();
    assert!(
        message.contains("adaptation") && message.contains("7.5") && message.contains('1'),
        "{message}"
    );
}

#[test]
fn another_seed_is_another_walk() {
    let trial = Trial::full_overlap(1.0, 2.0, 10.0);
    let pose = |seed| {
        let params = RandomWalkParams {
            seed,
            ..RandomWalkParams::default()
        };
        let answer = trial.answer(&RandomWalk::new(params).expect("in range"));
        answer.accepted().expect("all of both maps").pose_fixed_moving
    };
    assert_eq!(pose(1), pose(1));
    assert_ne!(pose(1), pose(2));
}
