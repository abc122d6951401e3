//! What became of the pairs of a merge.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::Reason;
use crate::api::Pose;

/// One pair of maps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PairResult {
    /// The map that is held.
    pub fixed: String,
    /// The map that is moved onto it.
    pub moving: String,
    /// How it was looked at.
    pub check: PairCheck,
    /// What the method answered.
    pub outcome: PairOutcome,
    /// What the answer was used for.
    pub role: PairRole,
    /// Pose of the moving map's frame in the fixed map's frame, when one was accepted.
    pub pose: Option<Pose>,
    /// Covariance of that pose's (x, y, yaw), row by row.
    pub covariance: Option<[[f64; 3]; 3]>,
    /// What speaks for the accepted pose.
    pub evidence: Option<Evidence>,
    /// Why no pose was accepted.
    pub reason: Option<Reason>,
    /// The best hypotheses when none was accepted, best first.
    pub candidates: Vec<Candidate>,
    /// The candidate that was used all the same, with the word of other pairs or of an operator.
    pub used_candidate: Option<usize>,
}

/// How a pair was looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PairCheck {
    /// Registered by a full search.
    Registered,
    /// Looked at only at the pose known from before.
    KnownPose,
    /// Registered earlier, on these very maps.
    Remembered,
    /// Both maps were already in their known places.
    NotNeeded,
    /// Somebody said that the two must not be merged.
    Forbidden,
}

/// What the method answered for a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PairOutcome {
    /// A pose that can be trusted.
    Accepted,
    /// No pose that can be trusted.
    Rejected,
    /// It was not asked.
    NotAsked,
}

/// What the answer for a pair was used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PairRole {
    /// It holds its maps together.
    Support,
    /// One of its candidates holds its maps together, with the word of other pairs.
    JointSupport,
    /// One of its candidates holds its maps together: the one that an operator's guess points at.
    GuessSupport,
    /// It was accepted, but contradicts other pairs.
    Contradicted,
    /// It was accepted, but not surely enough for a set of many maps, and nothing else confirms it.
    Unconfirmed,
    /// It was accepted, but would join maps that must not be merged.
    Forbidden,
    /// It was not accepted, or not asked.
    Unused,
}

/// The registration of one group of maps, fused, against another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Bridge {
    /// Maps of the fixed group; its frame is that of its first map.
    pub fixed: Vec<String>,
    /// Maps of the moving group; its frame is that of its first map.
    pub moving: Vec<String>,
    /// What the method answered.
    pub outcome: PairOutcome,
    /// Whether it joined the two.
    pub joined: bool,
    /// Pose of the moving group's frame in the fixed group's frame, when one was accepted.
    pub pose: Option<Pose>,
    /// What speaks for that pose, or for the best candidate.
    pub evidence: Option<Evidence>,
    /// Why no pose was accepted.
    pub reason: Option<Reason>,
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
    /// How likely the pose is right by the method's own model of what it has found, in [0, 1]; left out when the method has
    /// none, or when the pose was accepted by a rule that does not ask for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
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
