//! No way leads around a method's verification threshold: what it would not publish, nothing here places.

use super::scripted::{Scripted, world};
use super::{KnownPair, PairRole, Prior, WeldOptions, register_set};
use crate::geometry::{Angle, Pose2};
use crate::registration::Unhurried;

/// More than the 0.97 that all answers of a script have.
const MORE: Option<f64> = Some(0.98);
const AS_MUCH: Option<f64> = Some(0.97);

fn off(x: f64) -> Pose2 {
    Pose2::new(x, -x / 2.0, Angle::from_degrees(90.0))
}

fn placed(inputs: &[super::WeldInput], options: &WeldOptions) -> usize {
    let set = register_set(inputs, options, &Unhurried).expect("it registers");
    set.placements
        .iter()
        .filter(|placement| placement.placed().is_some())
        .count()
}

#[test]
fn hypotheses_below_the_threshold_are_no_joint_evidence() {
    for (required, expected) in [(None, 4), (AS_MUCH, 4), (MORE, 2)] {
        let (truth, inputs) = world(4);
        let mut script = Scripted::requiring(required);
        script.accept(&truth, 0, 1, 100.0);
        script.accept(&truth, 2, 3, 100.0);
        script.ambiguous(&truth, 0, 2, &[(20.0, off(9.0)), (90.0, Pose2::IDENTITY)]);
        script.ambiguous(&truth, 1, 3, &[(95.0, Pose2::IDENTITY), (20.0, off(-7.0))]);
        assert_eq!(placed(&inputs, &script.options().1), expected, "required: {required:?}");
    }
}

#[test]
fn a_guess_chooses_only_among_hypotheses_that_reach_the_threshold() {
    for (required, expected) in [(None, 2), (AS_MUCH, 2), (MORE, 1)] {
        let (truth, mut inputs) = world(2);
        let mut script = Scripted::requiring(required);
        script.ambiguous(&truth, 0, 1, &[(60.0, off(9.0)), (58.0, Pose2::IDENTITY)]);
        inputs[1].prior = Some(Prior::Guess {
            pose_anchor_map: truth[1],
            reach_m: 1.5,
        });
        assert_eq!(placed(&inputs, &script.options().1), expected, "required: {required:?}");
    }
}

#[test]
fn a_pair_that_was_accepted_by_less_is_registered_again() {
    let (truth, inputs) = world(2);
    let mut script = Scripted::default();
    script.accept(&truth, 0, 1, 100.0);
    let first = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    for (required, searched, expected) in [(AS_MUCH, 0, 2), (MORE, 1, 1)] {
        let refusing = Scripted::requiring(required);
        let (method, mut options) = refusing.options();
        options.known_pairs = vec![KnownPair {
            fixed: first.pairs[0].fixed,
            moving: first.pairs[0].moving,
            registration: first.pairs[0].registration.clone().expect("registered"),
        }];
        let set = register_set(&inputs, &options, &Unhurried).expect("it registers");
        assert_eq!(method.searched(), searched, "required: {required:?}");
        assert_eq!(set.pairs[0].role == PairRole::Support, expected == 2);
        assert_eq!(placed(&inputs, &options), expected);
    }
}
