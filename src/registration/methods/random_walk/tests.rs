use super::*;
use crate::registration::methods::shared::contract::{self, Trial, keeps_the_contract};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;

// All tests here run with the seed of the defaults, 1, unless they say so.
keeps_the_contract!(RandomWalk of RandomWalkParams, within 0.2 m, refuses adaptation above 1);

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
