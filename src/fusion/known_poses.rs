//! The fast path: maps whose poses are known from before are looked at there, and only there.
//!
//! **Method.**
//!
//! 1. A robot's earlier map is laid over its new one, unmoved. When too much of its walls stands in the free space of the
//!    new one, the robot's own frame has moved (a loop closure, a restart); the two maps are registered, and the
//!    known pose is moved along. No registration, no known pose. When the anchor's frame moves, all poses are told in the
//!    new one.
//! 2. Of all pairs whose known poses make them overlap, each map takes part with the few that it has most in common
//!    with; `Method::verify_at` looks at each such pair at its known pose only. It holds when the pair is accepted within
//!    the reach of that pose, and the maps do not contradict each other there by the rules of `contradiction`: what a
//!    small map could not know, a grown one may.
//! 3. Maps that pairs which hold connect to the anchor are settled: no search is made among them. All others go through
//!    the full search, and so does a map whose known pose little wall speaks for as yet: it might be found elsewhere.
//!
//! **Cost.** One look at a pose for each pair of neighbours, instead of a search for each pair.

use rayon::prelude::*;

use super::input::Prior;
use super::maps::{Maps, stop_of};
use super::outcome::{FrameJump, WeldError};
use super::sketch::{look_up, overlap, walls_of};
use super::standards::Fit;
use super::union_find::UnionFind;
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::registration::Registration;

/// When a known pose still holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownPoseRules {
    /// How far from an earlier version's pose a map may be found and still be where it was: RMS in metres over its walls.
    /// Default 0.3: more than a growing map's pose improves by, less than any other place of a building is away.
    pub reach_m: f64,
    /// How many neighbours each map is looked at with, beside those that keep the maps in one piece. Default 2.
    pub neighbours: usize,
    /// The least overlap by the known poses for two maps to be neighbours, in [0, 1]. Default 0.05.
    pub overlap_min: f64,
    /// Held wall (see `standards`) of a pair that holds, in metres, at least. Default 25: three rooms; a known pose that less
    /// speaks for is looked for once more.
    pub held_min_m: f64,
    /// A robot's frame has moved when more than this share of the walls of its earlier map stand in the free space of its
    /// new one. Default 0.25.
    pub jump_share: f64,
    /// A robot's frame has moved when its new map is found this far from its earlier one: RMS in metres. Default 0.1.
    pub jump_m: f64,
}

impl Default for KnownPoseRules {
    fn default() -> Self {
        Self {
            reach_m: 0.3,
            neighbours: 2,
            overlap_min: 0.05,
            held_min_m: 25.0,
            jump_share: 0.25,
            jump_m: 0.1,
        }
    }
}

/// What the known poses gave.
pub(super) struct KnownPoses {
    /// Where each map should lie in the anchor's frame, as far as anything is known, and how far off that may be.
    pub(super) poses: Vec<Option<(Pose2, f64)>>,
    /// Maps whose own frame has moved.
    pub(super) jumps: Vec<Option<FrameJump>>,
    /// Pairs that were looked at.
    pub(super) looks: Vec<Look>,
    /// Maps that need no search among themselves.
    pub(super) settled: Vec<bool>,
}

/// A pair that was looked at where it should lie.
pub(super) struct Look {
    pub(super) fixed: usize,
    pub(super) moving: usize,
    pub(super) answer: Registration,
    /// Whether it was accepted where it should lie.
    pub(super) holds: bool,
}

pub(super) fn look(maps: &Maps<'_>) -> Result<KnownPoses, WeldError> {
    let jumps: Vec<Option<FrameJump>> = maps
        .inputs
        .par_iter()
        .enumerate()
        .map(|(map, input)| match &input.prior {
            Some(Prior::Earlier(earlier)) => frame_jump(maps, earlier.previous.as_deref()?, map),
            _ => None,
        })
        .collect();
    let mut known = KnownPoses {
        settled: vec![false; maps.len()],
        looks: Vec::new(),
        poses: poses(maps, &jumps),
        jumps,
    };
    if known.poses[1..].iter().all(Option::is_none) {
        return Ok(known);
    }
    known.looks = neighbours(maps, &known.poses)
        .into_par_iter()
        .map(|(a, b)| look_at(maps, &known.poses, a, b))
        .collect();
    maps.go_on()?;
    let mut joined = UnionFind::new(maps.len());
    for edge in maps.certain_edges() {
        joined.join(edge.a, edge.b);
    }
    for look in &known.looks {
        if let Some(stop) = stop_of(&look.answer) {
            return Err(WeldError::Stopped(stop));
        }
        if look.holds {
            joined.join(look.fixed, look.moving);
        }
    }
    for map in 0..maps.len() {
        known.settled[map] = known.poses[map].is_some() && joined.same(0, map);
    }
    if known.settled[1..].iter().all(|settled| !settled) {
        known.settled[0] = false;
    }
    Ok(known)
}

fn look_at(maps: &Maps<'_>, poses: &[Option<(Pose2, f64)>], a: usize, b: usize) -> Look {
    let remembered = maps
        .remembered()
        .find(|(fixed, moving, _)| [*fixed, *moving] == [a, b] || [*fixed, *moving] == [b, a]);
    let (fixed, moving) = remembered.map_or((a, b), |(fixed, moving, _)| (fixed, moving));
    let (pose, reach) = relative(poses, fixed, moving);
    let answer = match remembered {
        Some((_, _, pair)) if pair.registration.accepted().is_some() => pair.registration.clone(),
        _ => {
            let [fixed, moving] = [fixed, moving].map(|map| &maps.features[map]);
            maps.method().verify_at(fixed, moving, pose, maps.control)
        }
    };
    let rules = &maps.options.known_poses;
    let holds = answer.accepted().is_some_and(|accepted| {
        let found = accepted.pose_fixed_moving;
        let fit = Fit::of(&accepted.evidence);
        maps.moments[moving].distance(found, pose) <= reach
            && fit.held_m() >= rules.held_min_m
            && fit.share() <= maps.options.contradiction.share_max
    });
    Look {
        fixed,
        moving,
        answer,
        holds,
    }
}

/// Where map b should lie in map a's frame, and how far off that may be. Both must be known.
pub(super) fn relative(poses: &[Option<(Pose2, f64)>], a: usize, b: usize) -> (Pose2, f64) {
    let known = |map: usize| poses[map].expect("invariant: only maps with known poses are neighbours");
    let ((pose_a, reach_a), (pose_b, reach_b)) = (known(a), known(b));
    (pose_a.inverse() * pose_b, reach_a.max(reach_b))
}

/// Step 1, for one map.
fn frame_jump(maps: &Maps<'_>, previous: &OccupancyGrid, map: usize) -> Option<FrameJump> {
    let rules = &maps.options.known_poses;
    let earlier = walls_of(previous);
    let unmoved = look_up(&earlier, maps.sketched(map), Pose2::IDENTITY);
    if unmoved.violated_share() <= rules.jump_share {
        return None;
    }
    let method = maps.method();
    let answer = method.register(&method.features(previous), &maps.features[map], maps.control);
    let Some(accepted) = answer.accepted() else {
        return Some(FrameJump {
            pose_previous_current: None,
            distance_m: None,
        });
    };
    let found = accepted.pose_fixed_moving;
    let distance = maps.moments[map].distance(found, Pose2::IDENTITY);
    (distance > rules.jump_m).then_some(FrameJump {
        pose_previous_current: Some(found),
        distance_m: Some(distance),
    })
}

/// Step 1, for all: where each map should lie in the anchor's frame of now.
fn poses(maps: &Maps<'_>, jumps: &[Option<FrameJump>]) -> Vec<Option<(Pose2, f64)>> {
    let moved = |map: usize| match &jumps[map] {
        None => Some(Pose2::IDENTITY),
        Some(jump) => jump.pose_previous_current,
    };
    let anchor_moved = moved(0);
    let reach = maps.options.known_poses.reach_m;
    let known = |map: usize| match &maps.inputs[map].prior {
        _ if map == 0 => Some((Pose2::IDENTITY, reach)),
        None => None,
        Some(Prior::Fixed(pose)) => Some((*pose, reach)),
        Some(Prior::Guess {
            pose_anchor_map,
            reach_m,
        }) => Some((*pose_anchor_map, *reach_m)),
        Some(Prior::Earlier(earlier)) => Some((anchor_moved?.inverse() * earlier.pose_anchor_map * moved(map)?, reach)),
    };
    (0..maps.len()).map(known).collect()
}

/// Step 2: the pairs to look at, in order.
fn neighbours(maps: &Maps<'_>, poses: &[Option<(Pose2, f64)>]) -> Vec<(usize, usize)> {
    let rules = &maps.options.known_poses;
    let pairs: Vec<(usize, usize)> = (0..maps.len())
        .flat_map(|a| (a + 1..maps.len()).map(move |b| (a, b)))
        .filter(|&(a, b)| !maps.is_forbidden(a, b) && poses[a].is_some() && poses[b].is_some())
        .collect();
    let mut overlaps: Vec<(f64, usize, usize)> = pairs
        .into_par_iter()
        .filter_map(|(a, b)| {
            let overlap = overlap(maps.sketched(a), maps.sketched(b), relative(poses, a, b).0);
            (overlap >= rules.overlap_min).then_some((overlap, a, b))
        })
        .collect();
    overlaps.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    // whatever keeps the known maps in one piece, and each map's best few
    let mut taken = vec![0_usize; maps.len()];
    let mut joined = UnionFind::new(maps.len());
    let mut chosen = Vec::new();
    for (_, a, b) in overlaps {
        let bridges = joined.join(a, b);
        if bridges || taken[a].max(taken[b]) < rules.neighbours {
            taken[a] += 1;
            taken[b] += 1;
            chosen.push((a, b));
        }
    }
    chosen
}
