//! The answer, told in the caller's order.

use super::bridges::Bridges;
use super::known_poses::KnownPoses;
use super::layout::{Layout, Link};
use super::maps::{Maps, Stages};
use super::outcome::{
    Basis, BridgeRecord, FrameJump, Group, Member, NotPlaced, NotPlacedReason, PairCheck, PairRecord, PairRole, Placed,
    Placement, RegisteredSet,
};
use crate::geometry::Pose2;
use crate::registration::overlap::{StateMap, compare};
use crate::registration::{Evidence, Reason, Registration};

pub(super) fn report(
    maps: &Maps<'_>,
    known: &KnownPoses,
    pairs: Vec<PairRecord>,
    links: &[Link],
    layout: &Layout,
    bridges: Bridges,
    stages: Stages<'_>,
) -> RegisteredSet {
    let groups = layout.groups();
    let teller = Teller {
        maps,
        known,
        pairs: &pairs,
        links,
        layout,
        groups: &groups,
    };
    let placements = given_order(maps, (0..maps.len()).map(|map| teller.placement(map)).collect());
    let features = given_order(maps, maps.features.clone());
    let given = |map: &usize| maps.given[*map];
    RegisteredSet {
        placements,
        groups: groups
            .iter()
            .map(|group| Group {
                members: group
                    .iter()
                    .map(|map| Member {
                        map: given(map),
                        pose_group_map: layout.places[*map].pose,
                    })
                    .collect(),
            })
            .collect(),
        pairs: pairs
            .into_iter()
            .map(|pair| PairRecord {
                fixed: maps.given[pair.fixed],
                moving: maps.given[pair.moving],
                ..pair
            })
            .collect(),
        bridges: bridges
            .records
            .into_iter()
            .map(|record| BridgeRecord {
                fixed: record.fixed.iter().map(given).collect(),
                moving: record.moving.iter().map(given).collect(),
                ..record
            })
            .collect(),
        features,
        stages: stages.times(),
    }
}

fn given_order<T>(maps: &Maps<'_>, values: Vec<T>) -> Vec<T> {
    let mut values: Vec<(usize, T)> = maps.given.iter().copied().zip(values).collect();
    values.sort_by_key(|(given, _)| *given);
    values.into_iter().map(|(_, value)| value).collect()
}

struct Teller<'a> {
    maps: &'a Maps<'a>,
    known: &'a KnownPoses,
    pairs: &'a [PairRecord],
    links: &'a [Link],
    layout: &'a Layout,
    groups: &'a [Vec<usize>],
}

impl Teller<'_> {
    fn placement(&self, map: usize) -> Placement {
        let frame_jump = self.known.jumps[map];
        if self.layout.first[map] == 0 {
            Placement::Placed(self.placed(map, frame_jump))
        } else {
            let nearest_pair = self.nearest_pair(map);
            Placement::NotPlaced(NotPlaced {
                reason: self.reason(map, nearest_pair),
                nearest_pair,
                frame_jump,
            })
        }
    }

    fn placed(&self, map: usize, frame_jump: Option<FrameJump>) -> Placed {
        let supporting_pairs = self.supporting_pairs(map);
        let best = supporting_pairs.first().and_then(|&pair| evidence(&self.pairs[pair]));
        let (verification_index, overlap) = match best {
            Some(evidence) => (evidence.verification_index, Some(evidence.overlap)),
            None => self.measured(map),
        };
        let place = self.layout.places[map];
        Placed {
            pose_anchor_map: place.pose,
            covariance: place.covariance,
            basis: match map {
                0 => Basis::Anchor,
                _ if self.maps.is_fixed(map) => Basis::Operator,
                _ if self.known.settled[map] => Basis::KnownPose,
                _ => Basis::Registered,
            },
            verification_index,
            overlap,
            runner_up: best.and_then(|evidence| evidence.runner_up),
            supporting_pairs,
            frame_jump,
        }
    }

    fn supporting_pairs(&self, map: usize) -> Vec<usize> {
        let touching = self
            .links
            .iter()
            .filter(|link| link.edge.a == map || link.edge.b == map);
        let mut supporting: Vec<usize> = touching.filter_map(|link| link.pair).collect();
        supporting.sort_by(|&x, &y| {
            let score = |pair: usize| evidence(&self.pairs[pair]).map_or(0.0, |evidence| evidence.score);
            score(y).total_cmp(&score(x)).then(x.cmp(&y))
        });
        supporting
    }

    /// V and overlap with the placed map that this one has most in common with.
    fn measured(&self, map: usize) -> (Option<f64>, Option<f64>) {
        let states = |map: usize| StateMap::new(&self.maps.inputs[map].grid);
        let own = states(map);
        let mut best: Option<crate::registration::overlap::Comparison> = None;
        for &other in self.groups[0].iter().filter(|&&other| other != map) {
            let comparison = compare(&states(other), &own, self.layout.relative(other, map));
            if comparison.common() > best.map_or(0, |best| best.common()) {
                best = Some(comparison);
            }
        }
        (
            best.and_then(|best| best.verification_index()),
            best.map(|best| best.overlap()),
        )
    }

    /// The pair that came nearest to placing a map: contradicted, forbidden, then by reason and score.
    fn nearest_pair(&self, map: usize) -> Option<usize> {
        let rank = |pair: &PairRecord| match (&pair.registration, pair.role) {
            (_, PairRole::Contradicted | PairRole::Forbidden) => 7,
            (_, PairRole::Unconfirmed) => 6,
            (Some(Registration::Rejected(rejection)), _) => match rejection.reason {
                Reason::Ambiguous { .. } => 5,
                Reason::UnderConstrained { .. } => 4,
                Reason::VerificationFailed { .. } => 3,
                Reason::NoOverlap { .. } => 2,
                _ => 1,
            },
            _ => 0,
        };
        let score = |pair: &PairRecord| evidence(pair).map_or(f64::NEG_INFINITY, |evidence| evidence.score);
        // pairs inside of the map's own group say nothing of why it is not with the anchor
        let asked = self.pairs.iter().enumerate().filter(|(_, pair)| {
            let mine = pair.fixed == map || pair.moving == map;
            mine && self.layout.first[pair.fixed] != self.layout.first[pair.moving]
                && (pair.registration.is_some() || pair.check == PairCheck::Forbidden)
        });
        asked
            .max_by(|(i, x), (j, y)| {
                (rank(x).cmp(&rank(y)))
                    .then(score(x).total_cmp(&score(y)))
                    .then(j.cmp(i))
            })
            .map(|(index, _)| index)
    }

    fn reason(&self, map: usize, nearest: Option<usize>) -> NotPlacedReason {
        let group = self.groups.iter().position(|group| group.contains(&map));
        if let Some(group) = group.filter(|&group| self.groups[group].len() > 1) {
            return NotPlacedReason::OtherGroup(group);
        }
        let Some(nearest) = nearest else {
            return NotPlacedReason::NotCompared;
        };
        let pair = &self.pairs[nearest];
        match (pair.role, &pair.registration) {
            (PairRole::Forbidden, _) | (_, None) => NotPlacedReason::Forbidden,
            (_, Some(Registration::Rejected(rejection))) => NotPlacedReason::Pairs(rejection.reason),
            (PairRole::Unconfirmed, Some(Registration::Accepted(_))) => NotPlacedReason::Unconfirmed,
            (_, Some(Registration::Accepted(_))) => NotPlacedReason::Contradicted,
        }
    }
}

/// The evidence of the pose that a pair's answer was used for; else of its best candidate.
fn evidence(pair: &PairRecord) -> Option<&Evidence> {
    match (&pair.registration, pair.role) {
        (
            Some(Registration::Rejected(rejection)),
            PairRole::JointSupport(candidate) | PairRole::GuessSupport(candidate),
        ) => Some(&rejection.candidates[candidate].evidence),
        (Some(registration), _) => registration.best_evidence(),
        (None, _) => None,
    }
}

/// The pose that a pair's answer was used for, or would be.
impl PairRecord {
    /// Pose of the moving map's frame in the fixed map's frame that the answer stands for: the accepted one, or that of
    /// the candidate which other evidence speaks for.
    #[must_use]
    pub fn pose_fixed_moving(&self) -> Option<Pose2> {
        match (self.registration.as_ref()?, self.role) {
            (Registration::Accepted(accepted), _) => Some(accepted.pose_fixed_moving),
            (
                Registration::Rejected(rejection),
                PairRole::JointSupport(candidate) | PairRole::GuessSupport(candidate),
            ) => Some(rejection.candidates[candidate].pose_fixed_moving),
            _ => None,
        }
    }
}
