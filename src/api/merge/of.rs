//! From a weld to its document: the one place where a [`MergeResult`] is made.

use std::time::Duration;

use super::pair::{Bridge, Candidate, Evidence, PairCheck, PairOutcome, PairResult, PairRole, RunnerUp};
use super::reason::Reason;
use super::{Basis, FrameJump, FusedMap, Group, GroupMember, MapPlacement, MergeResult, PlacementStatus, Timings};
use crate::fusion::{self, Fused, Placement, Weld};
use crate::model::{Digest, MethodSpec, StageSeconds};
use crate::registration::{self, Covariance, Registration, StageTime};

/// What was welded, and how: all that a [`Weld`] does not know of itself.
#[derive(Debug, Clone, Copy)]
pub struct Welded<'a> {
    /// Name of each map, in the order of the inputs.
    pub names: &'a [String],
    /// Digest of each map, in the order of the inputs.
    pub digests: &'a [Digest],
    /// Index of the anchor among them.
    pub anchor: usize,
    /// How they were registered.
    pub method: &'a MethodSpec,
}

/// The most candidates of a rejected pair that are told, beyond one that was used.
const CANDIDATES_MAX: usize = 3;

impl MergeResult {
    /// The document of a weld that took `took` from the decoded maps to the fused one.
    ///
    /// # Panics
    /// When names, digests and anchor are not those of the weld's inputs.
    #[must_use]
    pub fn of(weld: &Weld, welded: &Welded<'_>, took: Duration) -> Self {
        let set = &weld.set;
        let names = Names(welded.names);
        let groups: Vec<Group> = set.groups.iter().map(|group| names.group(group)).collect();
        Self {
            mapweld: env!("CARGO_PKG_VERSION").to_owned(),
            method: welded.method.clone(),
            anchor: names.of(welded.anchor),
            maps: set
                .placements
                .iter()
                .enumerate()
                .map(|(map, placement)| names.placement(map, welded.digests[map], placement, &groups))
                .collect(),
            pairs: set.pairs.iter().map(|pair| names.pair(pair)).collect(),
            bridges: set.bridges.iter().map(|bridge| names.bridge(bridge)).collect(),
            groups,
            constraints: Vec::new(),
            fused: FusedMap::of(&weld.fused),
            timings: Timings {
                total_seconds: took.as_secs_f64(),
                stages: set.stages.iter().map(stage_seconds).collect(),
            },
        }
    }

    /// How many maps are placed, the anchor included.
    #[must_use]
    pub fn placed(&self) -> usize {
        let placed = |map: &&MapPlacement| map.status == PlacementStatus::Placed;
        self.maps.iter().filter(placed).count()
    }
}

/// The maps' names by their index.
struct Names<'a>(&'a [String]);

impl Names<'_> {
    fn of(&self, map: usize) -> String {
        self.0[map].clone()
    }

    fn group(&self, group: &fusion::Group) -> Group {
        let member = |member: &fusion::Member| GroupMember {
            name: self.of(member.map),
            pose: member.pose_group_map.into(),
        };
        Group {
            members: group.members.iter().map(member).collect(),
        }
    }

    fn placement(&self, map: usize, digest: Digest, placement: &Placement, groups: &[Group]) -> MapPlacement {
        let nothing = MapPlacement {
            name: self.of(map),
            digest,
            status: PlacementStatus::NotPlaced,
            basis: None,
            pose: None,
            covariance: None,
            verification_index: None,
            overlap: None,
            supporting_pairs: Vec::new(),
            runner_up: None,
            reason: None,
            nearest_pair: None,
            frame_jump: None,
        };
        match placement {
            Placement::Placed(placed) => MapPlacement {
                status: PlacementStatus::Placed,
                basis: Some(placed.basis.into()),
                pose: Some(placed.pose_anchor_map.into()),
                covariance: Some(rows(placed.covariance)),
                verification_index: placed.verification_index,
                overlap: placed.overlap,
                supporting_pairs: placed.supporting_pairs.clone(),
                runner_up: placed.runner_up.map(RunnerUp::from),
                frame_jump: placed.frame_jump.map(FrameJump::from),
                ..nothing
            },
            Placement::NotPlaced(left_out) => MapPlacement {
                reason: Some(Reason::of_map(left_out.reason, |group| {
                    let others = groups[group].members.iter().map(|member| member.name.as_str());
                    others
                        .filter(|name| *name != self.0[map])
                        .collect::<Vec<_>>()
                        .join(", ")
                })),
                nearest_pair: left_out.nearest_pair,
                frame_jump: left_out.frame_jump.map(FrameJump::from),
                ..nothing
            },
        }
    }

    fn pair(&self, pair: &fusion::PairRecord) -> PairResult {
        let accepted = pair.registration.as_ref().and_then(Registration::accepted);
        let rejection = pair.registration.as_ref().and_then(rejected);
        let used_candidate = match pair.role {
            fusion::PairRole::JointSupport(index) | fusion::PairRole::GuessSupport(index) => Some(index),
            _ => None,
        };
        let told = CANDIDATES_MAX.max(used_candidate.map_or(0, |index| index + 1));
        PairResult {
            fixed: self.of(pair.fixed),
            moving: self.of(pair.moving),
            check: pair.check.into(),
            outcome: outcome(pair.registration.as_ref()),
            role: pair.role.into(),
            pose: accepted.map(|accepted| accepted.pose_fixed_moving.into()),
            covariance: accepted.map(|accepted| rows(accepted.covariance)),
            evidence: accepted.map(|accepted| (&accepted.evidence).into()),
            reason: rejection.map(|rejection| rejection.reason.into()),
            candidates: rejection
                .map(|rejection| rejection.candidates.iter().take(told).map(Candidate::from).collect())
                .unwrap_or_default(),
            used_candidate,
        }
    }

    fn bridge(&self, bridge: &fusion::BridgeRecord) -> Bridge {
        let accepted = bridge.registration.accepted();
        Bridge {
            fixed: bridge.fixed.iter().map(|map| self.of(*map)).collect(),
            moving: bridge.moving.iter().map(|map| self.of(*map)).collect(),
            outcome: outcome(Some(&bridge.registration)),
            joined: bridge.joined,
            pose: accepted.map(|accepted| accepted.pose_fixed_moving.into()),
            evidence: bridge.registration.best_evidence().map(Evidence::from),
            reason: rejected(&bridge.registration).map(|rejection| rejection.reason.into()),
        }
    }
}

fn rejected(registration: &Registration) -> Option<&registration::Rejection> {
    match registration {
        Registration::Accepted(_) => None,
        Registration::Rejected(rejection) => Some(rejection),
    }
}

fn outcome(registration: Option<&Registration>) -> PairOutcome {
    match registration {
        None => PairOutcome::NotAsked,
        Some(Registration::Accepted(_)) => PairOutcome::Accepted,
        Some(Registration::Rejected(_)) => PairOutcome::Rejected,
    }
}

fn rows(covariance: Covariance) -> [[f64; 3]; 3] {
    covariance.0
}

fn stage_seconds(stage: &StageTime) -> StageSeconds {
    StageSeconds {
        stage: stage.stage.to_owned(),
        seconds: stage.duration.as_secs_f64(),
    }
}

impl FusedMap {
    fn of(fused: &Fused) -> Self {
        let lattice = fused.grid.lattice();
        Self {
            width: lattice.width(),
            height: lattice.height(),
            resolution: lattice.resolution(),
            origin: lattice.origin().into(),
            counts: fused.grid.state_counts().into(),
            conflicting_cells: fused.conflicts.as_ref().map(fusion::Conflicts::cells),
            digest: Digest::of_grid(&fused.grid),
        }
    }
}

impl From<fusion::Basis> for Basis {
    fn from(basis: fusion::Basis) -> Self {
        match basis {
            fusion::Basis::Anchor => Self::Anchor,
            fusion::Basis::Registered => Self::Registered,
            fusion::Basis::KnownPose => Self::KnownPose,
            fusion::Basis::Operator => Self::Operator,
        }
    }
}

impl From<fusion::FrameJump> for FrameJump {
    fn from(jump: fusion::FrameJump) -> Self {
        Self {
            pose: jump.pose_previous_current.map(Into::into),
            distance_m: jump.distance_m,
        }
    }
}

impl From<fusion::PairCheck> for PairCheck {
    fn from(check: fusion::PairCheck) -> Self {
        match check {
            fusion::PairCheck::Registered => Self::Registered,
            fusion::PairCheck::KnownPose => Self::KnownPose,
            fusion::PairCheck::Remembered => Self::Remembered,
            fusion::PairCheck::NotNeeded => Self::NotNeeded,
            fusion::PairCheck::Forbidden => Self::Forbidden,
        }
    }
}

impl From<fusion::PairRole> for PairRole {
    fn from(role: fusion::PairRole) -> Self {
        match role {
            fusion::PairRole::Support => Self::Support,
            fusion::PairRole::JointSupport(_) => Self::JointSupport,
            fusion::PairRole::GuessSupport(_) => Self::GuessSupport,
            fusion::PairRole::Contradicted => Self::Contradicted,
            fusion::PairRole::Unconfirmed => Self::Unconfirmed,
            fusion::PairRole::Forbidden => Self::Forbidden,
            fusion::PairRole::Unused => Self::Unused,
        }
    }
}

impl From<&registration::Candidate> for Candidate {
    fn from(candidate: &registration::Candidate) -> Self {
        Self {
            pose: candidate.pose_fixed_moving.into(),
            evidence: (&candidate.evidence).into(),
        }
    }
}

impl From<&registration::Evidence> for Evidence {
    fn from(evidence: &registration::Evidence) -> Self {
        Self {
            score: evidence.score,
            probability: evidence.probability,
            verification_index: evidence.verification_index,
            overlap: evidence.overlap,
            matched_wall_m: evidence.matched_wall_m,
            violated_wall_m: evidence.violated_wall_m,
            weaker_direction_m: evidence.weaker_direction_m,
            runner_up: evidence.runner_up.map(RunnerUp::from),
        }
    }
}

impl From<registration::RunnerUp> for RunnerUp {
    fn from(rival: registration::RunnerUp) -> Self {
        Self {
            pose: rival.pose_fixed_moving.into(),
            score: rival.score,
            distance_m: rival.distance_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::api::{PlacementStatus, ReasonCode};
    use crate::fusion::{WeldInput, WeldOptions, weld};
    use crate::geometry::Pose2;
    use crate::grid::{Lattice, LogOdds, OccupancyGrid};
    use crate::registration::{MapFeatures, Method, MethodName, Reason, Rejection, Unhurried};

    /// Says no to every pair.
    struct Never;

    impl Method for Never {
        fn name(&self) -> MethodName {
            MethodName::ALL[0]
        }

        fn features(&self, _: &OccupancyGrid) -> MapFeatures {
            MapFeatures::new(())
        }

        fn register(&self, _: &MapFeatures, _: &MapFeatures, _: &dyn registration::Control) -> Registration {
            Registration::Rejected(Rejection {
                reason: Reason::NoOverlap {
                    score: 0.25,
                    needed: 0.5,
                },
                candidates: Vec::new(),
                stages: Vec::new(),
            })
        }

        fn required_verification(&self) -> Option<f64> {
            None
        }
    }

    #[test]
    fn the_document_says_of_each_map_whether_it_is_placed_and_why_not() {
        let lattice = Lattice::new(4, 3, 0.05, Pose2::IDENTITY).expect("valid");
        let grid = Arc::new(OccupancyGrid::new(lattice, vec![LogOdds::FREE; 12]).expect("as many"));
        let names = ["ada".to_owned(), "bob".to_owned()];
        let inputs: Vec<_> = names
            .iter()
            .map(|name| WeldInput::new(name, Arc::clone(&grid)))
            .collect();
        let weld = weld(&inputs, &WeldOptions::new(Arc::new(Never)), &Unhurried).expect("two maps");
        let welded = Welded {
            names: &names,
            digests: &[Digest::of_grid(&grid), Digest::of_grid(&grid)],
            anchor: 0,
            method: &MethodSpec::default(),
        };
        let result = MergeResult::of(&weld, &welded, Duration::from_millis(1500));

        assert_eq!((result.anchor.as_str(), result.placed()), ("ada", 1));
        assert_eq!(result.maps[0].basis, Some(Basis::Anchor));
        assert_eq!(result.maps[1].status, PlacementStatus::NotPlaced);
        let reason = result.maps[1].reason.as_ref().expect("there is a reason");
        assert_eq!((reason.code, reason.value), (ReasonCode::NoOverlap, Some(0.25)));
        assert_eq!(result.pairs[0].outcome, PairOutcome::Rejected);
        assert_eq!((result.fused.counts.free, result.groups.len()), (12, 2));

        let text = serde_json::to_string(&result).expect("serialises");
        assert_eq!(serde_json::from_str::<MergeResult>(&text).expect("parses"), result);
    }
}
