//! What is known beside the maps: pairs that must not be merged, fixed poses, guesses, and where maps were before.

use std::sync::Arc;

use super::tests::{FAR, is_placed_right, off, pose_of, reason};
use crate::fusion::scripted::{Scripted, world};
use crate::fusion::{
    Basis, Earlier, FixedPair, KnownPair, Moments, NotPlacedReason, PairCheck, PairRole, Placement, Prior, register_set,
};
use crate::geometry::{Angle, Pose2};
use crate::grid::{LogOdds, OccupancyGrid};
use crate::registration::Unhurried;

#[test]
fn maps_that_must_not_be_merged_are_kept_apart_even_by_way_of_others() {
    let (truth, inputs) = world(3);
    let mut script = Scripted::default();
    script.accept(&truth, 0, 1, 100.0);
    script.accept(&truth, 0, 2, 80.0);
    script.accept(&truth, 1, 2, 300.0);
    let (method, mut options) = script.options();
    options.forbidden.push([2, 1]);
    let set = register_set(&inputs, &options, &Unhurried).expect("it registers");
    assert_eq!(method.searched(), 2);
    assert!(is_placed_right(&set, &truth, &inputs, 1));
    assert_eq!(reason(&set, 2), NotPlacedReason::Forbidden);
}

#[test]
fn a_fixed_pose_holds_against_all_maps_and_places_what_hangs_on_it() {
    let (truth, mut inputs) = world(3);
    let mut script = Scripted::default();
    script.accept(&truth, 1, 2, 100.0);
    inputs[1].prior = Some(Prior::Fixed(truth[1]));
    let set = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    let placed = set.placements[1].placed().expect("placed");
    assert_eq!((placed.basis, placed.pose_anchor_map), (Basis::Operator, truth[1]));
    assert!(placed.verification_index.is_some() && is_placed_right(&set, &truth, &inputs, 2));
}

#[test]
fn maps_that_are_fixed_to_each_other_hang_together_wherever_one_of_them_is_placed() {
    let (truth, inputs) = world(4);
    let mut script = Scripted::default();
    script.accept(&truth, 0, 1, 100.0);
    // what the maps say of the fixed pair is wrong, and does not count
    script.accept_off(&truth, 1, 2, 100.0, off(FAR));
    let mut options = script.options().1;
    let tie = |fixed: usize, moving: usize| FixedPair {
        fixed,
        moving,
        pose_fixed_moving: truth[fixed].inverse() * truth[moving],
    };
    // told either way round, and to the anchor
    options.fixed_pairs = vec![tie(2, 1), tie(3, 0)];
    let set = register_set(&inputs, &options, &Unhurried).expect("it registers");
    for map in 1..4 {
        let wanted = truth[0].inverse() * truth[map];
        let pose = pose_of(&set, map).expect("placed");
        assert!(
            Moments::of(&inputs[map].grid).distance(pose, wanted) < 1e-4,
            "map {map}"
        );
    }
    assert_eq!(set.placements[3].placed().expect("placed").basis, Basis::Operator);
}

#[test]
fn a_guess_decides_between_hypotheses_that_the_maps_cannot_tell_apart() {
    let (truth, mut inputs) = world(2);
    let mut script = Scripted::default();
    script.ambiguous(&truth, 0, 1, &[(60.0, off(9.0)), (58.0, Pose2::IDENTITY)]);
    let about = truth[1] * Pose2::new(0.5, 0.3, Angle::from_degrees(5.0));
    inputs[1].prior = Some(Prior::Guess {
        pose_anchor_map: about,
        reach_m: 1.5,
    });
    let set = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    assert!(is_placed_right(&set, &truth, &inputs, 1));
    assert_eq!(set.pairs[0].role, PairRole::GuessSupport(1));
}

fn earlier(pose_anchor_map: Pose2, previous: Option<Arc<OccupancyGrid>>) -> Prior {
    Prior::Earlier(Earlier {
        pose_anchor_map,
        previous,
    })
}

#[test]
fn maps_with_known_poses_are_only_looked_at_there() {
    let (truth, mut inputs) = world(4);
    let mut script = Scripted::default();
    for (a, b) in [(0, 1), (1, 2), (0, 2), (2, 3)] {
        script.accept(&truth, a, b, 100.0);
    }
    for (map, input) in inputs.iter_mut().enumerate().take(3) {
        input.prior = Some(earlier(truth[map], Some(input.grid.clone())));
    }
    let (method, options) = script.options();
    let set = register_set(&inputs, &options, &Unhurried).expect("it registers");
    assert!((0..4).all(|map| is_placed_right(&set, &truth, &inputs, map)));
    // only the new map is searched for, against all three
    assert_eq!((method.looked(), method.searched()), (3, 3));
    assert_eq!(set.placements[1].placed().expect("placed").basis, Basis::KnownPose);
    assert_eq!(set.placements[3].placed().expect("placed").basis, Basis::Registered);
    assert_eq!(set.pairs[0].check, PairCheck::KnownPose);
}

#[test]
fn a_known_pose_that_holds_no_longer_is_searched_for_again() {
    let (truth, mut inputs) = world(3);
    let mut script = Scripted::default();
    for (a, b) in [(0, 1), (1, 2), (0, 2)] {
        script.accept(&truth, a, b, 100.0);
    }
    inputs[1].prior = Some(earlier(truth[1], None));
    inputs[2].prior = Some(earlier(truth[2] * Pose2::new(1.5, 0.0, Angle::ZERO), None));
    let (method, options) = script.options();
    let set = register_set(&inputs, &options, &Unhurried).expect("it registers");
    assert!((0..3).all(|map| is_placed_right(&set, &truth, &inputs, map)));
    assert_eq!(method.searched(), 2);
    assert_eq!(set.placements[2].placed().expect("placed").basis, Basis::Registered);
}

#[test]
fn pairs_that_were_registered_before_are_not_registered_again() {
    let (truth, inputs) = world(3);
    let mut script = Scripted::default();
    script.accept(&truth, 0, 1, 100.0);
    script.accept(&truth, 1, 2, 100.0);
    let first = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    let (method, mut options) = Scripted::default().options();
    options.known_pairs = first
        .pairs
        .iter()
        .map(|pair| KnownPair {
            fixed: pair.fixed,
            moving: pair.moving,
            registration: pair.registration.clone().expect("registered"),
        })
        .collect();
    let second = register_set(&inputs, &options, &Unhurried).expect("it registers");
    assert_eq!(method.searched(), 0);
    assert_eq!(first.placements, second.placements);
}

#[test]
fn a_robot_whose_own_frame_has_moved_is_found_out() {
    let (truth, mut inputs) = world(2);
    // a wall across the map, and the same wall a metre further in the earlier map
    let wall = |row: usize| {
        let mut grid = OccupancyGrid::clone(&inputs[1].grid);
        grid.cells_mut()[row * 60..row * 60 + 60].fill(LogOdds::OCCUPIED);
        Arc::new(grid)
    };
    let (previous, current) = (wall(30), wall(20));
    inputs[1].grid = current;
    inputs[1].prior = Some(earlier(truth[1], Some(previous.clone())));
    let (_, options) = Scripted::default().options();
    let set = register_set(&inputs, &options, &Unhurried).expect("it registers");
    let Placement::NotPlaced(not_placed) = &set.placements[1] else {
        panic!("nothing joins the maps")
    };
    assert_eq!(not_placed.frame_jump.expect("noticed").pose_previous_current, None);
    inputs[1].prior = Some(earlier(truth[1], Some(inputs[1].grid.clone())));
    let set = register_set(&inputs, &options, &Unhurried).expect("it registers");
    let Placement::NotPlaced(not_placed) = &set.placements[1] else {
        panic!("nothing joins the maps")
    };
    assert_eq!(not_placed.frame_jump, None);
}
