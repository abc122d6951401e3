//! Fusion: many maps placed consistently, and made into one.
//!
//! Imports `geometry`, `grid` and `registration`. Pure: no clock, randomness, files or logging.
//!
//! [`weld()`] is the one story that every door tells (the command, the service's one shot, the worker): features of each
//! map, registrations of the pairs, one consistent pose for each map that can be placed, and the fused map in the
//! anchor's frame. Below it: [`register_set`] places maps, [`fuse()`] adds them up, [`verdicts`] and [`optimise`] work on
//! bare graphs.

mod bitmap;
mod body;
mod bridges;
mod conflicts;
mod consistency;
mod contradiction;
mod fuse;
mod group;
mod hypotheses;
mod input;
mod known_poses;
mod layout;
mod maps;
mod moments;
mod names;
mod outcome;
mod pose_graph;
mod report;
#[cfg(test)]
mod scripted;
mod sketch;
mod standards;
#[cfg(test)]
mod threshold_tests;
mod union_find;
mod weld;

pub use conflicts::{Conflicts, Votes};
pub use consistency::{ConsistencyRules, Verdict, verdicts};
pub use contradiction::ContradictionRules;
pub use fuse::{FuseError, FuseOptions, Fused, PlacedMap, fuse};
pub use group::register_set;
pub use input::{Earlier, FixedPair, KnownPair, Prior, WeldInput, WeldOptions};
pub use known_poses::KnownPoseRules;
pub use moments::Moments;
pub use names::distinct_names;
pub use outcome::{
    Basis, BridgeRecord, FrameJump, Group, Member, NotPlaced, NotPlacedReason, PairCheck, PairRecord, PairRole, Placed,
    Placement, RegisteredSet, Weld, WeldError,
};
pub use pose_graph::{Edge, Estimate, optimise, spanning_poses};
pub use standards::StandardRules;
pub use weld::weld;
