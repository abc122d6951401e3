//! What goes into a weld: the maps, what is known of their poses beforehand, and the rules.

use std::sync::Arc;

use super::{ConsistencyRules, ContradictionRules, FuseOptions, KnownPoseRules, StandardRules};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::registration::{MapFeatures, Method, Registration};

/// One map to be welded.
#[derive(Debug, Clone)]
pub struct WeldInput {
    /// What people call it. Maps are gone through in the order of their names (the anchor first), so that the order in
    /// which they are given changes nothing; of equal names the one given first comes first.
    pub name: String,
    /// The map.
    pub grid: Arc<OccupancyGrid>,
    /// What the method has computed of the map before, by the same method with the same parameters; computed when absent.
    pub features: Option<MapFeatures>,
    /// What is known of its pose beforehand.
    pub prior: Option<Prior>,
}

impl WeldInput {
    /// A map of which nothing is known beforehand.
    #[must_use]
    pub fn new(name: impl Into<String>, grid: Arc<OccupancyGrid>) -> Self {
        Self {
            name: name.into(),
            grid,
            features: None,
            prior: None,
        }
    }
}

/// What is known of a map's pose before the maps are looked at. Poses are those of the map's frame in the anchor map's.
#[derive(Debug, Clone, PartialEq)]
pub enum Prior {
    /// An operator's word: the map lies there, whatever the maps say.
    Fixed(Pose2),
    /// An operator's guess: looked at first, and it decides between hypotheses that the maps alone cannot tell apart.
    Guess {
        /// Where about the map lies.
        pose_anchor_map: Pose2,
        /// How far off the guess may be: RMS over the map's walls, in metres.
        reach_m: f64,
    },
    /// An earlier version placed a map of this robot.
    Earlier(Earlier),
}

/// Where an earlier version placed a robot's map, and what that map looked like.
#[derive(Debug, Clone, PartialEq)]
pub struct Earlier {
    /// Pose that the earlier version gave it; the identity for the anchor.
    pub pose_anchor_map: Pose2,
    /// The robot's map of then, in the same frame unless the robot has changed its frame since (a loop closure, a
    /// restart): that is noticed. `None`: the map is the same still.
    pub previous: Option<Arc<OccupancyGrid>>,
}

/// An operator's word about two maps: so they lie to each other, whatever the maps say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixedPair {
    /// Index of the map in whose frame the pose is told.
    pub fixed: usize,
    /// Index of the map whose pose is told.
    pub moving: usize,
    /// Pose of the moving map's frame in the fixed map's frame.
    pub pose_fixed_moving: Pose2,
}

/// A pair that was registered before, by the same method, on these very maps.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownPair {
    /// Index of the fixed map among the inputs.
    pub fixed: usize,
    /// Index of the moving map among the inputs.
    pub moving: usize,
    /// What the method answered.
    pub registration: Registration,
}

/// How maps are welded.
#[derive(Clone)]
pub struct WeldOptions {
    /// How pairs are registered.
    pub method: Arc<dyn Method>,
    /// Index of the anchor among the inputs: the map whose frame is the fused map's. Default 0.
    pub anchor: usize,
    /// Pairs of inputs that must not end up in one fused map, directly or by way of others.
    pub forbidden: Vec<[usize; 2]>,
    /// Pairs of inputs that an operator has fixed to each other.
    pub fixed_pairs: Vec<FixedPair>,
    /// Pairs that need no registering again.
    pub known_pairs: Vec<KnownPair>,
    /// What edges can be true together.
    pub consistency: ConsistencyRules,
    /// When maps contradict each other.
    pub contradiction: ContradictionRules,
    /// What the set's pairs are held to.
    pub standards: StandardRules,
    /// When a known pose still holds.
    pub known_poses: KnownPoseRules,
    /// How placed maps are added up.
    pub fuse: FuseOptions,
}

impl WeldOptions {
    /// The defaults, with this method.
    #[must_use]
    pub fn new(method: Arc<dyn Method>) -> Self {
        Self {
            method,
            anchor: 0,
            forbidden: Vec::new(),
            fixed_pairs: Vec::new(),
            known_pairs: Vec::new(),
            consistency: ConsistencyRules::default(),
            contradiction: ContradictionRules::default(),
            standards: StandardRules::default(),
            known_poses: KnownPoseRules::default(),
            fuse: FuseOptions::default(),
        }
    }
}
