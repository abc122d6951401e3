//! The answer of a merge on the wire: the same document from the command, the one-shot request and a version.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{CellCounts, LatticeInfo, Pose};
use crate::model::{Digest, MethodSpec, StageSeconds};

/// What is placed where, and why.
///
/// Everything but `timings` depends on the maps, their names and the parameters alone: the same files give the same
/// bytes, from the command and from any server of this version.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MergeResult {
    /// The version of mapweld that found it.
    pub mapweld: String,
    /// How the maps were registered; every parameter is named.
    pub method: MethodSpec,
    /// The map whose frame everything is told in.
    pub anchor: String,
    /// The maps in the order given.
    pub maps: Vec<MapPlacement>,
    /// Every pair that was registered, in the order of the maps.
    pub pairs: Vec<PairResult>,
    /// Maps that hang together by accepted pairs, the anchor's group first; maps alone are groups of one.
    pub groups: Vec<Vec<String>>,
    /// The fused map.
    pub fused: FusedMap,
    /// How long it took; the only part that differs from run to run.
    pub timings: Timings,
}

/// One map of a merge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MapPlacement {
    /// Its name: the robot, or the stem of the YAML file's name.
    pub name: String,
    /// SHA-256 of the map's content.
    pub digest: Digest,
    /// Whether it is part of the fused map.
    pub status: PlacementStatus,
    /// Pose of the map's frame in the anchor's frame.
    pub pose: Option<Pose>,
    /// Covariance of that pose's (x, y, yaw) in m^2, m rad and rad^2, row by row; zero for the anchor.
    pub covariance: Option<[[f64; 3]; 3]>,
    /// The verification index V (eq. 34) of the best pair that places it, in [0, 1].
    pub verification_index: Option<f64>,
    /// The overlap of that pair: area known in both maps over the smaller known area, in [0, 1].
    pub overlap: Option<f64>,
    /// How many accepted pairs agree with the pose.
    pub supporting_pairs: u32,
    /// The rival of the best pair's pose: the best one that is really different.
    pub runner_up: Option<RunnerUp>,
    /// Why it is not placed.
    pub reason: Option<Reason>,
}

/// Whether a map is part of the fused map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlacementStatus {
    /// It is, under its pose.
    Placed,
    /// It is not, for its reason.
    NotPlaced,
}

/// The registration of one pair of maps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PairResult {
    /// The map that is held.
    pub fixed: String,
    /// The map that is moved onto it.
    pub moving: String,
    /// Whether a pose was accepted.
    pub outcome: PairOutcome,
    /// Pose of the moving map's frame in the fixed map's frame, when one was accepted.
    pub pose: Option<Pose>,
    /// Covariance of that pose's (x, y, yaw), row by row.
    pub covariance: Option<[[f64; 3]; 3]>,
    /// What speaks for the accepted pose.
    pub evidence: Option<Evidence>,
    /// Why no pose was accepted.
    pub reason: Option<Reason>,
    /// The hypotheses that were considered when none was accepted, best first.
    pub candidates: Vec<Candidate>,
}

/// What became of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PairOutcome {
    /// A pose was accepted.
    Accepted,
    /// A pose was accepted, but the other pairs of the set contradict it.
    Outvoted,
    /// No pose could be trusted.
    Rejected,
}

/// A hypothesis that was looked at closely.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Candidate {
    /// Pose of the moving map's frame in the fixed map's frame.
    pub pose: Pose,
    /// What speaks for it and against it.
    pub evidence: Evidence,
}

/// What speaks for and against one pose of a pair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Evidence {
    /// The method's own score, higher is better; comparable only within one method.
    pub score: f64,
    /// The verification index V (eq. 34) over cells known in both maps, in [0, 1]; `null` when there are none.
    pub verification_index: Option<f64>,
    /// Area known in both maps over the smaller known area, in [0, 1].
    pub overlap: f64,
    /// Metres of wall of one map that lie on a wall of the other.
    pub matched_wall_m: f64,
    /// Metres of wall of one map that lie in free space of the other.
    pub violated_wall_m: f64,
    /// Metres of matched wall that hold the pose in the direction in which it is held worst.
    pub weaker_direction_m: f64,
    /// The best pose that is really different from this one.
    pub runner_up: Option<RunnerUp>,
}

/// The rival of a pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RunnerUp {
    /// Pose of the moving map's frame in the fixed map's frame.
    pub pose: Pose,
    /// Its score.
    pub score: f64,
    /// RMS distance in metres between the moving map's occupied cells under the two poses.
    pub distance_m: f64,
}

/// Why a map is not placed, or a pair not accepted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(example = json!({
    "code": "verification_failed",
    "message": "the maps contradict each other at the best pose: V is 0.61, needed is 0.7",
    "value": 0.61,
    "needed": 0.7
}))]
pub struct Reason {
    /// Stable, for programs.
    pub code: ReasonCode,
    /// For people.
    pub message: String,
    /// The number that was found, in the unit that the message tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// The number that it would have needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub needed: Option<f64>,
}

/// The kinds of [`Reason`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReasonCode {
    /// A map has too little structure to be recognised.
    NoStructure,
    /// No hypothesis explains enough of both maps.
    NoOverlap,
    /// Two quite different hypotheses explain the maps nearly as well as each other.
    Ambiguous,
    /// The maps may slide along each other.
    UnderConstrained,
    /// The maps contradict each other at the best hypothesis.
    VerificationFailed,
    /// Its accepted pairs contradict the pairs of the other maps.
    Inconsistent,
    /// It hangs together with other maps, but none of them with the anchor.
    NotConnected,
    /// The time allowed was over.
    Deadline,
    /// The work was cancelled.
    Cancelled,
}

/// The fused map: the placed maps' log odds added up in the anchor's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FusedMap {
    /// Where its cells lie in the anchor's frame.
    #[serde(flatten)]
    pub lattice: LatticeInfo,
    /// How many cells are in each state.
    pub counts: CellCounts,
    /// Cells that some maps call occupied and others free.
    pub conflicting_cells: usize,
    /// SHA-256 of its content.
    pub digest: Digest,
}

/// How long a merge took.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Timings {
    /// Seconds from the decoded maps to the fused one.
    pub total_seconds: f64,
    /// Seconds of each stage, in the order run.
    pub stages: Vec<StageSeconds>,
}
