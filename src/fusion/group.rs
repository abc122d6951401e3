//! Many maps: from pairs to one consistent pose for each map that can be placed.
//!
//! **Method.**
//!
//! 1. Maps with known poses are looked at there (`known_poses`).
//! 2. All other pairs are registered, in parallel.
//! 3. Accepted pairs that look like candidates which are known to be wrong, or of which their method is not sure enough for
//!    a set, are doubted (`standards`). Of the others the
//!    heaviest set that can be true together is kept (`consistency`); none may join maps that an operator keeps apart, or
//!    groups whose walls contradict each other (`contradiction`).
//! 4. An operator's guess decides between the candidates of a pair that was not accepted.
//! 5. Groups that stand apart are joined, the surest first, where one of the candidates lays them so that all pairs
//!    between them agree (`hypotheses`), then by registering the groups themselves, each fused into one map: such a map
//!    shows more of what the other has seen, and more that contradicts a wrong place, than any of its parts (`bridges`).
//! 6. After each step the poses are those of the pose graph (`pose_graph`).
//! 7. Doubted pairs that agree with the poses make them more precise.
//!
//! **Cost.** n (n - 1) / 2 registrations when nothing is known beforehand.
//!
//! The order in which the maps are given, and the number of threads, change nothing.

use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::bridges::Bridges;
use super::contradiction::{Lying, contradict};
use super::input::{Prior, WeldInput, WeldOptions};
use super::known_poses::{self, KnownPoses};
use super::layout::{Layout, Link, lay_out};
use super::maps::{Maps, Stages, stop_of};
use super::outcome::{PairCheck, PairRecord, PairRole, RegisteredSet, WeldError};
use super::standards::{Fit, Standards};
use super::union_find::UnionFind;
use super::{Edge, Verdict, report, verdicts};
use crate::geometry::Pose2;
use crate::registration::{Candidate, Control, Registration};

/// Places all maps that can be placed.
///
/// # Errors
/// [`WeldError`] when an input is out of range, or the caller stops it.
pub fn register_set(
    inputs: &[WeldInput],
    options: &WeldOptions,
    control: &dyn Control,
) -> Result<RegisteredSet, WeldError> {
    let mut stages = Stages::start(control);
    let maps = Maps::new(inputs, options, control)?;
    stages.ended("features");
    maps.go_on()?;
    let known = known_poses::look(&maps)?;
    stages.ended("known poses");
    let mut pairs = registered_pairs(&maps, &known)?;
    stages.ended("pairs");
    let mut links = consistent_links(&maps, &mut pairs);
    follow_guesses(&maps, &known, &mut pairs, &mut links);
    let mut layout = lay_out(&maps, &mut links);
    stages.ended("placement");
    let mut bridges = Bridges::default();
    while bridges.join_one(&maps, &mut pairs, &mut links, &layout)? {
        layout = lay_out(&maps, &mut links);
    }
    if confirm(&maps, &mut pairs, &mut links, &layout) {
        layout = lay_out(&maps, &mut links);
    }
    stages.ended("bridges");
    settle_roles(&mut pairs, &links);
    Ok(report::report(&maps, &known, pairs, &links, &layout, bridges, stages))
}

/// Step 2, with the answers of step 1: every pair of maps, by index.
fn registered_pairs(maps: &Maps<'_>, known: &KnownPoses) -> Result<Vec<PairRecord>, WeldError> {
    let pairs: Vec<(usize, usize)> = (0..maps.len())
        .flat_map(|a| (a + 1..maps.len()).map(move |b| (a, b)))
        .collect();
    let (total, done) = (pairs.len(), AtomicUsize::new(0));
    let records: Vec<PairRecord> = pairs
        .into_par_iter()
        .map(|(a, b)| {
            let record = record(maps, known, a, b);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            maps.control.progress(done, total);
            record
        })
        .collect();
    maps.go_on()?;
    match records.iter().find_map(|record| stop_of(record.registration.as_ref()?)) {
        Some(stop) => Err(WeldError::Stopped(stop)),
        None => Ok(records),
    }
}

fn record(maps: &Maps<'_>, known: &KnownPoses, a: usize, b: usize) -> PairRecord {
    let is_this = |fixed: usize, moving: usize| (fixed.min(moving), fixed.max(moving)) == (a, b);
    let mut record = PairRecord {
        fixed: a,
        moving: b,
        check: PairCheck::NotNeeded,
        registration: None,
        role: PairRole::Unused,
    };
    if maps.is_forbidden(a, b) {
        record.check = PairCheck::Forbidden;
        return record;
    }
    let look = known.looks.iter().find(|look| is_this(look.fixed, look.moving));
    let settled = known.settled[a] && known.settled[b];
    if let Some(look) = look.filter(|look| look.holds || settled) {
        record.check = PairCheck::KnownPose;
        (record.fixed, record.moving) = (look.fixed, look.moving);
        record.registration = Some(look.answer.clone());
    } else if let Some((fixed, moving, pair)) = maps.remembered().find(|(fixed, moving, _)| is_this(*fixed, *moving)) {
        record.check = PairCheck::Remembered;
        (record.fixed, record.moving) = (fixed, moving);
        record.registration = Some(pair.registration.clone());
    } else if !settled && maps.control.should_stop().is_none() {
        record.check = PairCheck::Registered;
        let [fixed, moving] = [a, b].map(|map| &maps.features[map]);
        record.registration = Some(maps.method().register(fixed, moving, maps.control));
    }
    record
}

/// Step 3.
fn consistent_links(maps: &Maps<'_>, pairs: &mut [PairRecord]) -> Vec<Link> {
    let certain = maps.certain_edges().into_iter();
    let mut links: Vec<Link> = certain.map(|edge| Link { edge, pair: None }).collect();
    let standards = Standards::learn(maps, pairs, |_| None);
    for (index, pair) in pairs.iter_mut().enumerate() {
        if let Some(Registration::Accepted(accepted)) = &pair.registration {
            if standards.doubted(&Fit::of(&accepted.evidence)) {
                pair.role = PairRole::Contradicted;
            } else if !standards.trusted(&accepted.evidence, maps.len()) {
                pair.role = PairRole::Unconfirmed;
            } else {
                links.push(candidate_link(pair, 0, index));
            }
        }
    }
    let edges: Vec<Edge> = links.iter().map(|link| link.edge.clone()).collect();
    let verdicts = verdicts(&maps.moments, &edges, &maps.options.consistency);
    let mut kept = Vec::new();
    for (link, verdict) in links.into_iter().zip(verdicts) {
        match (verdict, link.pair) {
            (Verdict::Kept, _) => kept.push(link),
            (_, Some(pair)) => pairs[pair].role = PairRole::Contradicted,
            (_, None) => {}
        }
    }
    joinable(maps, pairs, kept)
}

/// The links that join groups which can lie like that, the heaviest first come: no two maps that an operator keeps apart,
/// no two groups whose walls contradict each other.
fn joinable(maps: &Maps<'_>, pairs: &mut [PairRecord], mut links: Vec<Link>) -> Vec<Link> {
    links.sort_by(|x, y| {
        (y.edge.certain.cmp(&x.edge.certain))
            .then(y.edge.weight.total_cmp(&x.edge.weight))
            .then(x.pair.cmp(&y.pair))
    });
    let mut groups: Vec<Vec<Lying>> = (0..maps.len()).map(|map| vec![(map, Pose2::IDENTITY)]).collect();
    links.retain(|link| {
        let Edge { a, b, pose_a_b, .. } = link.edge;
        let of = |map: usize| {
            groups
                .iter()
                .position(|group| group.iter().any(|&(other, _)| other == map))
        };
        let (Some(group_a), Some(group_b)) = (of(a), of(b)) else {
            unreachable!("invariant: every map is in a group")
        };
        if group_a == group_b {
            return true;
        }
        let (one, other) = (&groups[group_a], &groups[group_b]);
        let pose_one_other = lies(one, a) * pose_a_b * lies(other, b).inverse();
        let apart = one
            .iter()
            .any(|&(x, _)| other.iter().any(|&(y, _)| maps.is_forbidden(x, y)));
        let contradicted = !link.edge.certain && contradict(maps, one, other, pose_one_other, Some((a, b)));
        if let Some(pair) = link.pair.filter(|_| apart || contradicted) {
            pairs[pair].role = if apart {
                PairRole::Forbidden
            } else {
                PairRole::Contradicted
            };
        }
        if apart || contradicted {
            return false;
        }
        let moved: Vec<Lying> = other.iter().map(|&(map, pose)| (map, pose_one_other * pose)).collect();
        groups[group_a].extend(moved);
        groups[group_b].clear();
        true
    });
    links
}

fn lies(group: &[Lying], map: usize) -> Pose2 {
    let lying = group.iter().find(|&&(other, _)| other == map);
    lying.expect("invariant: the map is in the group").1
}

fn may_join(maps: &Maps<'_>, groups: &UnionFind, a: usize, b: usize) -> bool {
    let of = |map: usize| (0..maps.len()).filter(move |&other| groups.same(map, other));
    of(a).all(|one| of(b).all(|other| !maps.is_forbidden(one, other)))
}

/// Step 4.
fn follow_guesses(maps: &Maps<'_>, known: &KnownPoses, pairs: &mut [PairRecord], links: &mut Vec<Link>) {
    let guessed = |map: usize| matches!(maps.inputs[map].prior, Some(Prior::Guess { .. }));
    let mut groups = UnionFind::new(maps.len());
    for link in &*links {
        groups.join(link.edge.a, link.edge.b);
    }
    for (index, pair) in pairs.iter_mut().enumerate() {
        let (a, b) = (pair.fixed, pair.moving);
        let wanted = (guessed(a) || guessed(b)) && known.poses[a].is_some() && known.poses[b].is_some();
        let Some(Registration::Rejected(rejection)) = &pair.registration else {
            continue;
        };
        if !wanted || groups.same(a, b) || !may_join(maps, &groups, a, b) {
            continue;
        }
        let (pose, reach) = known_poses::relative(&known.poses, a, b);
        let required = maps.method().required_verification();
        let near = |candidate: &Candidate| {
            candidate.evidence.suffices(required)
                && maps.moments[b].distance(candidate.pose_fixed_moving, pose) <= reach
        };
        if let Some(chosen) = rejection.candidates.iter().position(near) {
            pair.role = PairRole::GuessSupport(chosen);
            links.push(candidate_link(pair, chosen, index));
            groups.join(a, b);
        }
    }
}

/// The link that a candidate of a pair makes; an accepted pair has only one.
pub(super) fn candidate_link(pair: &PairRecord, candidate: usize, index: usize) -> Link {
    let (pose_a_b, covariance, evidence) = match &pair.registration {
        Some(Registration::Accepted(accepted)) => (accepted.pose_fixed_moving, accepted.covariance, &accepted.evidence),
        Some(Registration::Rejected(rejection)) => {
            let candidate = &rejection.candidates[candidate];
            (candidate.pose_fixed_moving, candidate.covariance, &candidate.evidence)
        }
        None => unreachable!("invariant: only pairs with an answer have candidates"),
    };
    Link {
        edge: Edge {
            a: pair.fixed,
            b: pair.moving,
            pose_a_b,
            covariance,
            weight: evidence.score,
            certain: false,
        },
        pair: Some(index),
    }
}

/// What each pair's answer was used for, now that it is known which links last.
fn settle_roles(pairs: &mut [PairRecord], links: &[Link]) {
    for (index, pair) in pairs.iter_mut().enumerate() {
        let lasts = links.iter().any(|link| link.pair == Some(index));
        let accepted = pair
            .registration
            .as_ref()
            .is_some_and(|answer| answer.accepted().is_some());
        let settled = matches!(pair.role, PairRole::Forbidden | PairRole::Unconfirmed);
        pair.role = match (lasts, accepted) {
            (true, true) => PairRole::Support,
            (true, false) => pair.role,
            (false, _) if settled => pair.role,
            (false, true) => PairRole::Contradicted,
            (false, false) => PairRole::Unused,
        };
    }
}

/// Step 7: pairs that nothing confirmed so far, and that the layout confirms. Whether there are any.
fn confirm(maps: &Maps<'_>, pairs: &mut [PairRecord], links: &mut Vec<Link>, layout: &Layout) -> bool {
    let before = links.len();
    for (index, pair) in pairs.iter_mut().enumerate() {
        let (a, b) = (pair.fixed, pair.moving);
        if let Some(Registration::Accepted(accepted)) = &pair.registration
            && pair.role == PairRole::Unconfirmed
            && layout.first[a] == layout.first[b]
            && maps.moments[b].distance(accepted.pose_fixed_moving, layout.relative(a, b))
                <= maps.options.consistency.tolerance_m
        {
            links.push(candidate_link(pair, 0, index));
        }
    }
    links.len() > before
}

/// Whether two groups hold maps that an operator keeps apart.
pub(super) fn kept_apart(maps: &Maps<'_>, layout: &Layout, a: usize, b: usize) -> bool {
    let of = |first: usize| (0..maps.len()).filter(move |&map| layout.first[map] == first);
    of(a).any(|one| of(b).any(|other| maps.is_forbidden(one, other)))
}
