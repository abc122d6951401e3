//! The whole story with a scripted method: who is placed, who is not, and why.

use std::time::Duration;

use super::*;
use crate::fusion::scripted::{Scripted, evidence, nothing, world};
use crate::fusion::{Basis, FixedPair, Moments, NotPlacedReason, PairRole, Placement, Prior, RegisteredSet};
use crate::geometry::{Angle, Pose2};
use crate::registration::{Acceptance, Covariance, Registration, Stop, Unhurried};

pub(super) const FAR: f64 = 40.0;

pub(super) fn off(x: f64) -> Pose2 {
    Pose2::new(x, -x / 2.0, Angle::from_degrees(90.0))
}

pub(super) fn pose_of(set: &RegisteredSet, map: usize) -> Option<Pose2> {
    set.placements[map].placed().map(|placed| placed.pose_anchor_map)
}

pub(super) fn is_placed_right(set: &RegisteredSet, truth: &[Pose2], inputs: &[WeldInput], map: usize) -> bool {
    let wanted = truth[0].inverse() * truth[map];
    pose_of(set, map).is_some_and(|pose| Moments::of(&inputs[map].grid).distance(pose, wanted) < 1e-6)
}

pub(super) fn reason(set: &RegisteredSet, map: usize) -> NotPlacedReason {
    match &set.placements[map] {
        Placement::NotPlaced(not_placed) => not_placed.reason,
        Placement::Placed(_) => panic!("map {map} is placed"),
    }
}

pub(super) fn role(set: &RegisteredSet, a: usize, b: usize) -> PairRole {
    let pair = set.pairs.iter().find(|pair| (pair.fixed, pair.moving) == (a, b));
    pair.expect("listed").role
}

#[test]
fn maps_in_a_chain_are_placed_in_the_anchors_frame_and_fused() {
    let (truth, inputs) = world(4);
    let mut script = Scripted::default();
    (0..3).for_each(|map| script.accept(&truth, map, map + 1, 100.0));
    let (method, options) = script.options();
    let weld = weld(&inputs, &options, &Unhurried).expect("it welds");
    assert!((0..4).all(|map| is_placed_right(&weld.set, &truth, &inputs, map)));
    assert_eq!(method.searched(), 6);
    assert_eq!(pose_of(&weld.set, 0), Some(Pose2::IDENTITY));
    let placed = weld.set.placements[1].placed().expect("placed");
    assert_eq!((placed.basis, placed.supporting_pairs.len()), (Basis::Registered, 2));
    assert_eq!(placed.verification_index, Some(0.97));
    assert_eq!(weld.set.groups.len(), 1);
    assert!(weld.fused.grid.lattice().cell_count() > 2400);
    assert_eq!(weld.set.stages.last().expect("stages").stage, "fusion");
}

#[test]
fn the_order_of_the_maps_and_the_number_of_threads_change_no_byte() {
    let (truth, inputs) = world(5);
    let script = || {
        let mut script = Scripted::default();
        for map in 0..4 {
            script.accept_off(
                &truth,
                map,
                map + 1,
                100.0,
                Pose2::new(0.013, 0.007, Angle::from_radians(0.001)),
            );
        }
        script.accept_off(&truth, 0, 2, 70.0, Pose2::new(-0.02, 0.01, Angle::ZERO));
        script.accept_off(&truth, 1, 4, 60.0, Pose2::new(0.02, 0.03, Angle::from_radians(-0.002)));
        script.options().1
    };
    let weld_in = |order: &[usize]| {
        let given: Vec<WeldInput> = order.iter().map(|&map| inputs[map].clone()).collect();
        let mut options = script();
        options.anchor = order.iter().position(|&map| map == 0).expect("the anchor is there");
        weld(&given, &options, &Unhurried).expect("it welds")
    };
    let first = weld_in(&[0, 1, 2, 3, 4]);
    let order = [3, 1, 4, 0, 2];
    let second = weld_in(&order);
    assert_eq!(first.fused, second.fused);
    for (at, &map) in order.iter().enumerate() {
        assert_eq!(first.set.placements[map], second.set.placements[at]);
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    let alone = pool.install(|| weld_in(&[0, 1, 2, 3, 4]));
    assert_eq!(alone.fused, first.fused);
    assert_eq!(alone.set.pairs, first.set.pairs);
}

#[test]
fn one_wrong_pair_among_well_connected_maps_is_found_out() {
    let (truth, inputs) = world(4);
    let mut script = Scripted::default();
    for (a, b) in [(0, 1), (1, 2), (0, 2), (1, 3), (2, 3)] {
        script.accept(&truth, a, b, 100.0);
    }
    script.accept_off(&truth, 0, 3, 150.0, off(5.0));
    let set = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    assert!((0..4).all(|map| is_placed_right(&set, &truth, &inputs, map)));
    let wrong = set
        .pairs
        .iter()
        .find(|pair| (pair.fixed, pair.moving) == (0, 3))
        .expect("listed");
    assert_eq!(wrong.role, PairRole::Contradicted);
}

#[test]
fn a_pair_that_its_method_is_not_sure_of_joins_two_maps_but_none_of_a_set() {
    let (truth, inputs) = world(3);
    let script = || {
        let mut script = Scripted::default();
        script.accept_with(&truth, (0, 1), 0.99, Pose2::IDENTITY);
        script.accept_with(&truth, (1, 2), 0.9, off(6.0));
        script
    };
    let set = register_set(&inputs, &script().options().1, &Unhurried).expect("it registers");
    assert!(is_placed_right(&set, &truth, &inputs, 1));
    assert_eq!(reason(&set, 2), NotPlacedReason::Unconfirmed);
    assert_eq!(role(&set, 1, 2), PairRole::Unconfirmed);
    // alone, the two maps have nobody to be confirmed by
    let mut script = Scripted::default();
    script.accept_with(&truth, (0, 1), 0.9, Pose2::IDENTITY);
    let two = register_set(&inputs[..2], &script.options().1, &Unhurried).expect("it registers");
    assert!(is_placed_right(&two, &truth, &inputs, 1));
}

#[test]
fn a_pair_that_its_method_is_not_sure_of_counts_where_surer_ones_confirm_it() {
    let (truth, inputs) = world(3);
    let mut script = Scripted::default();
    script.accept_with(&truth, (0, 1), 0.99, Pose2::IDENTITY);
    script.accept_with(&truth, (1, 2), 0.99, Pose2::IDENTITY);
    script.accept_with(&truth, (0, 2), 0.8, Pose2::new(0.02, 0.0, Angle::ZERO));
    let set = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    assert_eq!(role(&set, 0, 2), PairRole::Support);
    let mut script = Scripted::default();
    script.accept_with(&truth, (0, 1), 0.99, Pose2::IDENTITY);
    script.accept_with(&truth, (1, 2), 0.99, Pose2::IDENTITY);
    script.accept_with(&truth, (0, 2), 0.8, off(3.0));
    let set = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    assert_eq!(role(&set, 0, 2), PairRole::Unconfirmed);
    assert!((0..3).all(|map| is_placed_right(&set, &truth, &inputs, map)));
}

#[test]
fn a_map_that_contradicting_pairs_want_elsewhere_is_left_out() {
    let (truth, inputs) = world(3);
    let mut script = Scripted::default();
    script.accept(&truth, 0, 1, 300.0);
    script.accept(&truth, 1, 2, 60.0);
    script.accept_off(&truth, 0, 2, 50.0, off(6.0));
    let set = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    assert!(is_placed_right(&set, &truth, &inputs, 1));
    assert_eq!(reason(&set, 2), NotPlacedReason::Contradicted);
}

#[test]
fn groups_that_cannot_be_joined_are_told_as_groups() {
    let (truth, inputs) = world(5);
    let mut script = Scripted::default();
    script.accept(&truth, 0, 1, 100.0);
    script.accept(&truth, 2, 3, 100.0);
    let set = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    let members: Vec<Vec<usize>> = set
        .groups
        .iter()
        .map(|group| group.members.iter().map(|m| m.map).collect())
        .collect();
    assert_eq!(members, [vec![0, 1], vec![2, 3], vec![4]]);
    assert_eq!(reason(&set, 3), NotPlacedReason::OtherGroup(1));
    assert!(matches!(
        reason(&set, 4),
        NotPlacedReason::Pairs(crate::registration::Reason::NoOverlap { .. })
    ));
    let wanted = truth[2].inverse() * truth[3];
    assert!(Moments::of(&inputs[3].grid).distance(set.groups[1].members[1].pose_group_map, wanted) < 1e-6);
}

#[test]
fn an_anchor_that_nobody_joins_is_alone_and_the_others_are_not_placed() {
    let (truth, inputs) = world(3);
    let mut script = Scripted::default();
    script.accept(&truth, 1, 2, 100.0);
    let weld = weld(&inputs, &script.options().1, &Unhurried).expect("it welds");
    assert_eq!(weld.fused.grid, *inputs[0].grid);
    assert_eq!(reason(&weld.set, 1), NotPlacedReason::OtherGroup(1));
    assert_eq!(weld.set.groups[0].members.len(), 1);
}

#[test]
fn undecided_pairs_whose_place_stands_out_bridge_two_groups() {
    let (truth, inputs) = world(4);
    let mut script = Scripted::default();
    script.accept(&truth, 0, 1, 100.0);
    script.accept(&truth, 2, 3, 100.0);
    script.ambiguous(&truth, 0, 2, &[(20.0, off(9.0)), (90.0, Pose2::IDENTITY)]);
    script.ambiguous(&truth, 1, 3, &[(95.0, Pose2::IDENTITY), (20.0, off(-7.0))]);
    let set = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    assert!((0..4).all(|map| is_placed_right(&set, &truth, &inputs, map)));
    assert_eq!(role(&set, 0, 2), PairRole::JointSupport(1));
    assert_eq!(role(&set, 1, 3), PairRole::JointSupport(0));
}

#[test]
fn one_ambiguous_pair_bridges_nothing() {
    let (truth, inputs) = world(3);
    let mut script = Scripted::default();
    script.accept(&truth, 0, 1, 100.0);
    script.ambiguous(&truth, 0, 2, &[(60.0, Pose2::IDENTITY), (50.0, off(9.0))]);
    let set = register_set(&inputs, &script.options().1, &Unhurried).expect("it registers");
    assert!(matches!(
        reason(&set, 2),
        NotPlacedReason::Pairs(crate::registration::Reason::Ambiguous { .. })
    ));
}

#[test]
fn a_group_fused_into_one_map_may_be_registered_where_its_parts_were_not() {
    let (truth, inputs) = world(3);
    let mut script = Scripted::default();
    script.accept(&truth, 0, 1, 100.0);
    script.group = Some(Registration::Accepted(Acceptance {
        pose_fixed_moving: truth[0].inverse() * truth[2],
        covariance: Covariance::diagonal(0.02, 0.002),
        evidence: evidence(80.0),
        stages: Vec::new(),
    }));
    let (_, options) = script.options();
    let set = register_set(&inputs, &options, &Unhurried).expect("it registers");
    assert!(is_placed_right(&set, &truth, &inputs, 2));
    assert!(
        set.bridges
            .iter()
            .any(|bridge| bridge.joined && bridge.fixed == [0, 1] && bridge.moving == [2])
    );
}

struct Late;

impl Control for Late {
    fn now(&self) -> Duration {
        Duration::ZERO
    }

    fn should_stop(&self) -> Option<Stop> {
        Some(Stop::Deadline)
    }
}

#[test]
fn a_weld_that_is_stopped_gives_no_answer() {
    let (_, inputs) = world(2);
    let error = weld(&inputs, &Scripted::default().options().1, &Late).expect_err("stopped");
    assert_eq!(error, WeldError::Stopped(Stop::Deadline));
}

#[test]
fn inputs_out_of_range_are_refused_with_what_is_wrong() {
    let (truth, mut inputs) = world(2);
    let options = || Scripted::default().options().1;
    assert_eq!(weld(&[], &options(), &Unhurried).expect_err("none"), WeldError::NoMaps);
    let mut far = options();
    far.anchor = 7;
    let error = weld(&inputs, &far, &Unhurried).expect_err("no such map").to_string();
    assert_eq!(
        error,
        "the anchor names map 7, but there are only 2 maps, counted from 0"
    );
    inputs[1].prior = Some(Prior::Fixed(truth[1]));
    let mut apart = options();
    apart.forbidden.push([0, 1]);
    assert!(weld(&inputs, &apart, &Unhurried).is_err());
    inputs[1].prior = None;
    let tied = FixedPair {
        fixed: 1,
        moving: 0,
        pose_fixed_moving: Pose2::IDENTITY,
    };
    apart.fixed_pairs.push(tied);
    let error = weld(&inputs, &apart, &Unhurried).expect_err("fixed and apart");
    assert!(matches!(error, WeldError::FixedAndForbidden(..)), "{error:?}");
    let mut odd = options();
    odd.fixed_pairs.push(FixedPair { moving: 5, ..tied });
    let error = weld(&inputs, &odd, &Unhurried).expect_err("no such map").to_string();
    assert!(error.contains("a fixed pair names map 5"), "{error}");
    inputs[1].prior = Some(Prior::Fixed(Pose2::new(FAR * 1e6, 0.0, Angle::ZERO)));
    let error = weld(&inputs, &options(), &Unhurried)
        .expect_err("too large")
        .to_string();
    assert!(error.contains("limit of 400000000 cells"), "{error}");
    assert_eq!(nothing().accepted(), None);
}
