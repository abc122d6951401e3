//! What a weld answers: for each map where it lies or why nobody knows, and all that was looked at.

use crate::geometry::Pose2;
use crate::registration::{Covariance, MapFeatures, Reason, Registration, RunnerUp, StageTime, Stop};

use super::{FuseError, Fused};

/// Maps placed and fused.
#[derive(Debug, Clone)]
pub struct Weld {
    /// Where each map lies.
    pub set: RegisteredSet,
    /// The placed maps, added up in the anchor's frame.
    pub fused: Fused,
}

/// Where each map of a set lies, or why nobody knows. Maps are named by their index among the inputs.
#[derive(Debug, Clone)]
pub struct RegisteredSet {
    /// One a map, in the order of the inputs.
    pub placements: Vec<Placement>,
    /// Every pair of maps, and what became of it. In the order of the maps' names, the anchor first.
    pub pairs: Vec<PairRecord>,
    /// Registrations of groups of maps, fused, against other groups: tried where single pairs left groups apart.
    pub bridges: Vec<BridgeRecord>,
    /// The maps that lie in one frame; the anchor's group first. A map that is joined to nobody is a group of its own.
    pub groups: Vec<Group>,
    /// What the method computed of each map, in the order of the inputs, to be given back with the next weld.
    pub features: Vec<MapFeatures>,
    /// Time of each stage, in the order run.
    pub stages: Vec<StageTime>,
}

/// What became of one map.
#[derive(Debug, Clone, PartialEq)]
pub enum Placement {
    /// It lies there.
    Placed(Placed),
    /// It is left out.
    NotPlaced(NotPlaced),
}

impl Placement {
    /// The place, if there is one.
    #[must_use]
    pub fn placed(&self) -> Option<&Placed> {
        match self {
            Self::Placed(placed) => Some(placed),
            Self::NotPlaced(_) => None,
        }
    }
}

/// Where a map lies, and what speaks for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Pose of the map's frame in the anchor map's frame; exactly the identity for the anchor.
    pub pose_anchor_map: Pose2,
    /// How well it is known, by the whole pose graph; zero for the anchor and for a pose that an operator has fixed.
    pub covariance: Covariance,
    /// On whose word.
    pub basis: Basis,
    /// The paper's V (eq. 34) between this map and the one that supports it best, in [0, 1]: the evidence of
    /// `supporting_pairs[0]`, else measured against the placed map with which it has most in common. `None` when it has
    /// nothing in common with any.
    pub verification_index: Option<f64>,
    /// The overlap of the same two maps: area known in both over the smaller known area, in [0, 1].
    pub overlap: Option<f64>,
    /// Indices of the pairs that hold this map in its place, the one with the highest score first.
    pub supporting_pairs: Vec<usize>,
    /// The rival of the best supporting pair, if its method found any. Poses are in that pair's frames.
    pub runner_up: Option<RunnerUp>,
    /// The robot's own frame is not what it was in the earlier version.
    pub frame_jump: Option<FrameJump>,
}

/// On whose word a map is placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameJump {
    /// Pose of the robot's new frame in its earlier one; `None` when the two maps could not be registered.
    pub pose_previous_current: Option<Pose2>,
    /// How far its walls moved: RMS in metres; `None` as above.
    pub distance_m: Option<f64>,
}

/// Why a map is left out.
#[derive(Debug, Clone, PartialEq)]
pub struct NotPlaced {
    /// Why.
    pub reason: NotPlacedReason,
    /// Index of the pair that came nearest to placing it, if any was looked at.
    pub nearest_pair: Option<usize>,
    /// The robot's own frame is not what it was in the earlier version.
    pub frame_jump: Option<FrameJump>,
}

/// Why a map is left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NotPlacedReason {
    /// None of its pairs was accepted; this is what the pair that came nearest says.
    Pairs(Reason),
    /// It was registered, but to maps that contradict each other about it.
    Contradicted,
    /// It was registered, but not surely enough for a set of many maps, and nothing else confirms it.
    Unconfirmed,
    /// It is joined to other maps, but none of them to the anchor: the index of its group.
    OtherGroup(usize),
    /// It would have joined two maps that must not be merged.
    Forbidden,
    /// It was never looked at together with another map.
    NotCompared,
}

/// What became of one pair.
#[derive(Debug, Clone, PartialEq)]
pub struct PairRecord {
    /// The fixed map.
    pub fixed: usize,
    /// The moving map.
    pub moving: usize,
    /// How it was looked at.
    pub check: PairCheck,
    /// What the method answered; `None` where it was not asked.
    pub registration: Option<Registration>,
    /// What the answer was used for.
    pub role: PairRole,
}

/// How a pair was looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

/// What the answer for a pair was used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PairRole {
    /// It was accepted and holds its maps together.
    Support,
    /// It was not accepted by itself; its candidate of this index holds its maps together with the word of other pairs.
    JointSupport(usize),
    /// It was not accepted by itself; its candidate of this index is the one that an operator's guess points at.
    GuessSupport(usize),
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
#[derive(Debug, Clone, PartialEq)]
pub struct BridgeRecord {
    /// Maps of the fixed group; its frame is that of its first map.
    pub fixed: Vec<usize>,
    /// Maps of the moving group; its frame is that of its first map.
    pub moving: Vec<usize>,
    /// What the method answered.
    pub registration: Registration,
    /// Whether it joined the two.
    pub joined: bool,
}

/// Maps that lie in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Its maps, and where they lie in the frame of the first.
    pub members: Vec<Member>,
}

/// A map of a group.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Member {
    /// Index among the inputs.
    pub map: usize,
    /// Pose of the map's frame in the frame of the group's first map.
    pub pose_group_map: Pose2,
}

/// Why there is no weld at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WeldError {
    /// There is nothing to weld.
    #[error("there is no map to weld")]
    NoMaps,
    /// An index points at no map.
    #[error("{what} names map {index}, but there are only {maps} maps, counted from 0")]
    NoSuchMap {
        /// Where the index stands.
        what: &'static str,
        /// The index.
        index: usize,
        /// How many maps there are.
        maps: usize,
    },
    /// An operator fixes what he forbids.
    #[error("maps {0:?} and {1:?} must not be merged, but both have a fixed pose")]
    FixedAndForbidden(String, String),
    /// The anchor was given another pose than its own frame.
    #[error("the anchor {0:?} lies in its own frame; it cannot be fixed at another pose")]
    AnchorFixedElsewhere(String),
    /// The placed maps cannot be added up.
    #[error(transparent)]
    Fuse(#[from] FuseError),
    /// The caller stopped it.
    #[error("stopped: {}", match .0 { Stop::Deadline => "the deadline has passed", Stop::Cancelled => "cancelled" })]
    Stopped(Stop),
}
