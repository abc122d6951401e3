//! Groups of maps that stand apart, joined: by what several of their pairs agree on, or group against group.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::contradiction::{Lying, contradict};
use super::fuse::{PlacedMap, fuse};
use super::group::{candidate_link, kept_apart};
use super::joint::{Hint, bridge};
use super::layout::{Layout, Link};
use super::maps::{Maps, stop_of};
use super::outcome::{BridgeRecord, PairRecord, PairRole, WeldError};
use super::{Edge, FuseOptions};
use crate::geometry::Pose2;
use crate::registration::{MapFeatures, Registration};

/// The registrations of groups so far.
#[derive(Debug, Default)]
pub(super) struct Bridges {
    pub(super) records: Vec<BridgeRecord>,
    /// Groups that were registered against each other: a group changes only by growing.
    tried: BTreeSet<(Vec<usize>, Vec<usize>)>,
}

impl Bridges {
    /// Joins the two groups that can be joined most surely; false when there are none.
    pub(super) fn join_one(
        &mut self,
        maps: &Maps<'_>,
        pairs: &mut [PairRecord],
        links: &mut Vec<Link>,
        layout: &Layout,
    ) -> Result<bool, WeldError> {
        if layout.groups().len() == 1 {
            return Ok(false);
        }
        if join_by_hints(maps, pairs, links, layout) {
            return Ok(true);
        }
        maps.go_on()?;
        self.join_by_groups(maps, pairs, links, layout)
    }

    fn join_by_groups(
        &mut self,
        maps: &Maps<'_>,
        pairs: &mut [PairRecord],
        links: &mut Vec<Link>,
        layout: &Layout,
    ) -> Result<bool, WeldError> {
        let groups = layout.groups();
        let untried: Vec<(usize, usize)> = group_pairs(maps, layout, &groups)
            .filter(|&(a, b)| groups[a].len() + groups[b].len() > 2)
            .filter(|&(a, b)| self.tried.insert((groups[a].clone(), groups[b].clone())))
            .collect();
        let wanted: BTreeSet<usize> = untried.iter().flat_map(|&(a, b)| [a, b]).collect();
        let features: Vec<Option<MapFeatures>> = (0..groups.len())
            .into_par_iter()
            .map(|group| {
                wanted
                    .contains(&group)
                    .then(|| features(maps, layout, &groups[group]))
                    .flatten()
            })
            .collect();
        let answers: Vec<BridgeRecord> = untried
            .into_par_iter()
            .filter_map(|(a, b)| {
                let (fixed, moving) = (features[a].as_ref()?, features[b].as_ref()?);
                Some(BridgeRecord {
                    fixed: groups[a].clone(),
                    moving: groups[b].clone(),
                    registration: maps.method().register(fixed, moving, maps.control),
                    joined: false,
                })
            })
            .collect();
        if let Some(stop) = answers.iter().find_map(|answer| stop_of(&answer.registration)) {
            return Err(WeldError::Stopped(stop));
        }
        self.records.extend(answers);
        // the surest of all that still apply: both groups are as they were when they were registered
        let applies =
            |record: &BridgeRecord| !record.joined && groups.contains(&record.fixed) && groups.contains(&record.moving);
        let mut best: Option<(f64, usize)> = None;
        for (index, record) in self.records.iter().enumerate().filter(|(_, record)| applies(record)) {
            if let Some(accepted) = record.registration.accepted()
                && best.is_none_or(|(score, _)| accepted.evidence.score > score)
                && can_lie(
                    maps,
                    layout,
                    record.fixed[0],
                    record.moving[0],
                    accepted.pose_fixed_moving,
                )
            {
                best = Some((accepted.evidence.score, index));
            }
        }
        let Some((_, index)) = best else { return Ok(false) };
        let record = &mut self.records[index];
        record.joined = true;
        let Some(accepted) = record.registration.accepted() else {
            unreachable!("invariant: only accepted registrations are the best")
        };
        links.push(Link {
            edge: Edge {
                a: record.fixed[0],
                b: record.moving[0],
                pose_a_b: accepted.pose_fixed_moving,
                covariance: accepted.covariance,
                weight: accepted.evidence.score,
                certain: false,
            },
            pair: None,
        });
        let pose = accepted.pose_fixed_moving;
        let (fixed, moving) = (record.fixed[0], record.moving[0]);
        let agreeing: Vec<(usize, usize)> = hints(maps, pairs, layout, fixed, moving)
            .filter(|hint| distance(maps, layout, moving, hint.pose_a_b, pose) <= maps.options.joint.tolerance_m)
            .map(|hint| (hint.pair, hint.candidate))
            .collect();
        support(pairs, links, agreeing);
        Ok(true)
    }
}

/// Joins by joint evidence.
fn join_by_hints(maps: &Maps<'_>, pairs: &mut [PairRecord], links: &mut Vec<Link>, layout: &Layout) -> bool {
    let groups = layout.groups();
    let best = group_pairs(maps, layout, &groups)
        .filter_map(|(a, b)| {
            let (a, b) = (groups[a][0], groups[b][0]);
            let hints: Vec<Hint> = hints(maps, pairs, layout, a, b).collect();
            bridge(
                &hints,
                |one, other| distance(maps, layout, b, one, other),
                &maps.options.joint,
            )
        })
        .reduce(|best, next| if next.score > best.score { next } else { best });
    match best {
        Some(bridge) => {
            support(pairs, links, bridge.hints);
            true
        }
        None => false,
    }
}

/// Whether two groups (named by their first maps) do not contradict each other under a pose.
fn can_lie(maps: &Maps<'_>, layout: &Layout, a: usize, b: usize, pose_a_b: Pose2) -> bool {
    let group = |first: usize| -> Vec<Lying> {
        let members = (0..maps.len()).filter(|&map| layout.first[map] == first);
        members.map(|map| (map, layout.places[map].pose)).collect()
    };
    !contradict(maps, &group(a), &group(b), pose_a_b, None)
}

/// Makes links of candidates; of a pair's candidates the first one counts.
fn support(pairs: &mut [PairRecord], links: &mut Vec<Link>, hints: Vec<(usize, usize)>) {
    for (pair, candidate) in hints {
        if pairs[pair].role == PairRole::Unused {
            pairs[pair].role = PairRole::JointSupport(candidate);
            links.push(candidate_link(&pairs[pair], candidate, pair));
        }
    }
}

/// Pairs of groups that may be joined, by their place in `groups`.
fn group_pairs<'a>(
    maps: &'a Maps<'_>,
    layout: &'a Layout,
    groups: &'a [Vec<usize>],
) -> impl Iterator<Item = (usize, usize)> + 'a {
    (0..groups.len())
        .flat_map(|a| (a + 1..groups.len()).map(move |b| (a, b)))
        .filter(|&(a, b)| !kept_apart(maps, layout, groups[a][0], groups[b][0]))
}

/// What the candidates of all rejected pairs between two groups (named by their first maps) say of how they lie; not those
/// that the method would never publish.
fn hints<'a>(
    maps: &'a Maps<'_>,
    pairs: &'a [PairRecord],
    layout: &'a Layout,
    a: usize,
    b: usize,
) -> impl Iterator<Item = Hint> + 'a {
    let required = maps.method().required_verification();
    pairs.iter().enumerate().flat_map(move |(index, pair)| {
        let [fixed, moving] = [pair.fixed, pair.moving].map(|map| layout.first[map]);
        let candidates = match &pair.registration {
            Some(Registration::Rejected(rejection)) if [fixed, moving] == [a, b] || [fixed, moving] == [b, a] => {
                rejection.candidates.as_slice()
            }
            _ => &[],
        };
        let candidates = candidates.iter().enumerate();
        let publishable = candidates.filter(move |(_, hypothesis)| hypothesis.evidence.suffices(required));
        publishable.map(move |(candidate, hypothesis)| {
            let [at_fixed, at_moving] = [pair.fixed, pair.moving].map(|map| layout.places[map].pose);
            let pose = at_fixed * hypothesis.pose_fixed_moving * at_moving.inverse();
            Hint {
                pair: index,
                candidate,
                pose_a_b: if fixed == a { pose } else { pose.inverse() },
                score: hypothesis.evidence.score,
                matched_m: hypothesis.evidence.matched_wall_m,
                violated_m: hypothesis.evidence.violated_wall_m,
            }
        })
    })
}

/// How far apart two poses of a group lay its maps, at most.
fn distance(maps: &Maps<'_>, layout: &Layout, first: usize, one: Pose2, other: Pose2) -> f64 {
    (0..maps.len())
        .filter(|&map| layout.first[map] == first)
        .map(|map| {
            let place = layout.places[map].pose;
            maps.moments[map].distance(one * place, other * place)
        })
        .fold(0.0, f64::max)
}

/// The features of a group, fused in the frame of its first map; `None` when it is too large to be fused.
fn features(maps: &Maps<'_>, layout: &Layout, group: &[usize]) -> Option<MapFeatures> {
    let &[first, ref others @ ..] = group else { return None };
    if others.is_empty() {
        return Some(maps.features[first].clone());
    }
    let placed: Vec<PlacedMap<'_>> = others
        .iter()
        .map(|&map| PlacedMap {
            grid: &maps.inputs[map].grid,
            pose_anchor_map: layout.relative(first, map),
        })
        .collect();
    let options = FuseOptions {
        conflicts: false,
        resolution: None,
        ..maps.options.fuse
    };
    let fused = fuse(&maps.inputs[first].grid, &placed, &options).ok()?;
    Some(maps.method().features(&fused.grid))
}
