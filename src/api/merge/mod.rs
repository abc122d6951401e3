//! The answer of a merge on the wire: the same document from the command, the one-shot request and a version.

mod of;
mod pair;
mod reason;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

pub use of::Welded;
pub use pair::{Bridge, Candidate, Evidence, PairCheck, PairOutcome, PairResult, PairRole, RunnerUp};
pub use reason::{Reason, ReasonCode};

use super::{CellCounts, ConstraintEffect, Pose};
use crate::model::{Digest, MethodSpec, StageSeconds};

/// What is placed where, and why.
///
/// Everything but `timings` depends on the maps, their names, the parameters and what operators say alone: the same files give the same
/// bytes, from the command and from any server of this version. Made by [`MergeResult::of`] alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MergeResult {
    /// The version of mapweld that found it.
    pub mapweld: String,
    /// How the maps were registered.
    #[serde(deserialize_with = "MethodSpec::deserialize_record")]
    pub method: MethodSpec,
    /// The map whose frame everything is told in.
    pub anchor: String,
    /// The maps in the order given.
    pub maps: Vec<MapPlacement>,
    /// Every pair of maps, and what became of it.
    pub pairs: Vec<PairResult>,
    /// Registrations of groups of maps, fused, against other groups: tried where single pairs left groups apart.
    pub bridges: Vec<Bridge>,
    /// The maps that lie in one frame, the anchor's group first; a map that is joined to nobody is a group of its own.
    pub groups: Vec<Group>,
    /// What operators have said about this merge, and what became of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constraints: Vec<ConstraintEffect>,
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
    /// On whose word it is placed.
    pub basis: Option<Basis>,
    /// Pose of the map's frame in the anchor's frame.
    pub pose: Option<Pose>,
    /// Covariance of that pose's (x, y, yaw) in m^2, m rad and rad^2, row by row; zero for the anchor.
    pub covariance: Option<[[f64; 3]; 3]>,
    /// The verification index V (eq. 34) between this map and the one that supports it best, in [0, 1].
    pub verification_index: Option<f64>,
    /// The overlap of the same two maps: area known in both over the smaller known area, in [0, 1].
    pub overlap: Option<f64>,
    /// The pairs that hold the map in its place, by their place in `pairs`, the best first.
    pub supporting_pairs: Vec<usize>,
    /// The rival of the best of them, in the frames of that pair.
    pub runner_up: Option<RunnerUp>,
    /// Why it is not placed.
    pub reason: Option<Reason>,
    /// The pair that came nearest to placing it, by its place in `pairs`.
    pub nearest_pair: Option<usize>,
    /// The robot's frame is not what it was in the version before.
    pub frame_jump: Option<FrameJump>,
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

/// On whose word a map is placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// It is the anchor.
    Anchor,
    /// The registrations of its pairs, or of its group.
    Registered,
    /// A pose known from before, confirmed by the maps.
    KnownPose,
    /// An operator's word.
    Operator,
}

/// A robot's new map does not lie on its own earlier one: its frame has moved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FrameJump {
    /// Pose of the robot's new frame in its earlier one; `null` when the two maps could not be registered.
    pub pose: Option<Pose>,
    /// How far its walls moved: RMS in metres.
    pub distance_m: Option<f64>,
}

/// Maps that lie in one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Group {
    /// Its maps.
    pub members: Vec<GroupMember>,
}

/// A map of a group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GroupMember {
    /// The map's name.
    pub name: String,
    /// Pose of its frame in the frame of the group's first map.
    pub pose: Pose,
}

/// The fused map: the placed maps' log odds added up in the anchor's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FusedMap {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Side of a cell in metres.
    pub resolution: f64,
    /// Pose of the lower-left corner of cell (0, 0) in the anchor's frame.
    pub origin: Pose,
    /// How many cells are in each state.
    pub counts: CellCounts,
    /// Cells that some map calls occupied and another free.
    pub conflicting_cells: Option<usize>,
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
