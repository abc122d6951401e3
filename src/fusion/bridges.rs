//! Groups of maps that stand apart, joined: where a candidate lays them so that all pairs agree, or group against group.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::body::Body;
use super::contradiction::{Lying, contradict};
use super::fuse::{PlacedMap, fuse};
use super::group::{candidate_link, kept_apart};
use super::hypotheses;
use super::layout::{Layout, Link};
use super::maps::{Maps, stop_of};
use super::outcome::{BridgeRecord, PairRecord, PairRole, WeldError};
use super::standards::{Fit, Standards};
use super::{Edge, FuseOptions};
use crate::geometry::Pose2;
use crate::registration::{Candidate, MapFeatures, Registration};

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
        let standards = Standards::learn(maps, pairs, |pair| confirmed(maps, layout, pair));
        if join_by_hypotheses(maps, pairs, links, layout, &standards) {
            return Ok(true);
        }
        maps.go_on()?;
        self.join_by_groups(maps, pairs, links, layout, &standards)
    }

    fn join_by_groups(
        &mut self,
        maps: &Maps<'_>,
        pairs: &mut [PairRecord],
        links: &mut Vec<Link>,
        layout: &Layout,
        standards: &Standards,
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
                && !standards.doubted(&Fit::of(&accepted.evidence))
                && standards.trusted(&accepted.evidence, maps.len())
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
        let agreeing = hypotheses::agreeing(maps, pairs, layout, (fixed, moving), pose);
        support(maps, pairs, links, agreeing);
        Ok(true)
    }
}

/// Which candidate of a pair the layout confirms, when both of its maps are in one group.
fn confirmed(maps: &Maps<'_>, layout: &Layout, pair: &PairRecord) -> Option<usize> {
    let Some(Registration::Rejected(rejection)) = &pair.registration else {
        return None;
    };
    if layout.first[pair.fixed] != layout.first[pair.moving] {
        return None;
    }
    let pose = layout.relative(pair.fixed, pair.moving);
    let near = |candidate: &Candidate| {
        maps.moments[pair.moving].distance(candidate.pose_fixed_moving, pose) <= maps.options.standards.apart_m
    };
    rejection.candidates.iter().position(near)
}

/// Joins the two groups whose place stands out most.
fn join_by_hypotheses(
    maps: &Maps<'_>,
    pairs: &mut [PairRecord],
    links: &mut Vec<Link>,
    layout: &Layout,
    standards: &Standards,
) -> bool {
    let groups = layout.groups();
    let bodies: Vec<Body> = (groups.par_iter())
        .map(|group| Body::new(maps, group.iter().map(|&map| (map, layout.places[map].pose)).collect()))
        .collect();
    let bridges: Vec<hypotheses::Bridge> = group_pairs(maps, layout, &groups)
        .collect::<Vec<_>>()
        .into_par_iter()
        .filter_map(|(a, b)| {
            let between = hypotheses::Between {
                firsts: (groups[a][0], groups[b][0]),
                bodies: (&bodies[a], &bodies[b]),
                alone: groups[a].len() + groups[b].len() == 2,
            };
            let bridge = hypotheses::bridge(maps, pairs, layout, standards, &between)?;
            can_lie(maps, layout, groups[a][0], groups[b][0], bridge.pose_a_b).then_some(bridge)
        })
        .collect();
    let best = bridges
        .into_iter()
        .reduce(|best, next| if next.margin > best.margin { next } else { best });
    match best {
        Some(bridge) => support(maps, pairs, links, bridge.hints),
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

/// Makes links of candidates. The runner-up of an accepted pair is looked at once more, there only.
fn support(maps: &Maps<'_>, pairs: &mut [PairRecord], links: &mut Vec<Link>, hints: Vec<(usize, usize)>) -> bool {
    let before = links.len();
    for (index, candidate) in hints {
        let pair = &mut pairs[index];
        match (&pair.registration, candidate) {
            (Some(Registration::Accepted(accepted)), 1..) => {
                let Some(rival) = accepted.evidence.runner_up else {
                    continue;
                };
                let [fixed, moving] = [pair.fixed, pair.moving].map(|map| &maps.features[map]);
                let answer = maps
                    .method()
                    .verify_at(fixed, moving, rival.pose_fixed_moving, maps.control);
                if answer.accepted().is_none() {
                    continue;
                }
                pair.registration = Some(answer);
                pair.role = PairRole::Support;
                links.push(candidate_link(pair, 0, index));
            }
            (Some(Registration::Accepted(_)), _) => {
                pair.role = PairRole::Support;
                links.push(candidate_link(pair, 0, index));
            }
            _ if pair.role == PairRole::Unused => {
                pair.role = PairRole::JointSupport(candidate);
                links.push(candidate_link(pair, candidate, index));
            }
            _ => {}
        }
    }
    links.len() > before
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
