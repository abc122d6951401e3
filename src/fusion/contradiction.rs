//! Whether two groups of maps can lie like that: every map of one is laid over every map of the other.
//!
//! A pair that is wrong may look right by itself: rooms repeat, floors repeat. But it also says where all other maps of
//! its group lie, and where those meet the maps of the other group their walls must agree. That is evidence which no
//! pair has.

use rayon::prelude::*;

use super::maps::Maps;
use super::sketch::{WallAgreement, agreement};
use crate::geometry::Pose2;

/// When maps contradict each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContradictionRules {
    /// Walls within this distance are the same one, in metres, also where groups are laid over each other in search of
    /// their place. Default 0.25: poses in a large group are off by more than those of a pair, and maps are bent.
    pub tolerance_m: f64,
    /// The largest share of compared wall that may stand in the other group's free space. Default 0.12: right joins of
    /// recorded and simulated maps stay below 0.02, wrong ones between repeated floors lie above 0.18.
    pub share_max: f64,
    /// Less wall than this in free space contradicts nothing, in metres. Default 3: people and chairs move.
    pub violated_min_m: f64,
}

impl Default for ContradictionRules {
    fn default() -> Self {
        Self {
            tolerance_m: 0.25,
            share_max: 0.12,
            violated_min_m: 3.0,
        }
    }
}

/// A map of a group, and where it lies in the group's frame.
pub(super) type Lying = (usize, Pose2);

/// Whether two groups contradict each other under a pose. The pair `except` has been judged already, by its method.
pub(super) fn contradict(
    maps: &Maps<'_>,
    fixed: &[Lying],
    moving: &[Lying],
    pose_fixed_moving: Pose2,
    except: Option<(usize, usize)>,
) -> bool {
    let rules = &maps.options.contradiction;
    let pairs: Vec<(Lying, Lying)> = fixed
        .iter()
        .flat_map(|&one| moving.iter().map(move |&other| (one, other)))
        .filter(|((a, _), (b, _))| except.is_none_or(|(x, y)| (*a, *b) != (x, y) && (*a, *b) != (y, x)))
        .collect();
    let looks: Vec<WallAgreement> = pairs
        .into_par_iter()
        .map(|((a, pose_a), (b, pose_b))| {
            let pose_a_b = pose_a.inverse() * pose_fixed_moving * pose_b;
            agreement(maps.sketched(a), maps.sketched(b), pose_a_b)
        })
        .collect();
    let all = looks.into_iter().fold(WallAgreement::default(), WallAgreement::plus);
    all.violated_m >= rules.violated_min_m && all.violated_share() > rules.share_max
}
