//! Labelled pairs of simulated maps in frames as the paper's method needs them, for the experiments with many pairs.

use rayon::prelude::*;

use super::frames::near;
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::simulation::{PairRequest, Random, Relation, Truth, WorldKind, generate_pair};

/// Two maps, and where the second lies in the first one's frame; `None` when they have nothing in common.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LabelledPair {
    /// For tables.
    pub(super) name: String,
    /// The map that stays.
    pub(super) fixed: OccupancyGrid,
    /// The map that is registered to it.
    pub(super) moving: OccupancyGrid,
    /// Pose of the moving map's frame in the fixed map's.
    pub(super) truth: Option<Pose2>,
}

/// As many matching pairs (overlap 10 to 92 %, as `mapweld simulate` makes them) and pairs of two buildings, over all kinds
/// of worlds in turn. The truth's translation is at most 20 cells on each axis, its rotation any. Pairs that no world
/// offers are left out.
pub(super) fn near_pairs(seed: u64, matching: usize, different: usize) -> Vec<LabelledPair> {
    let kinds = WorldKind::ALL;
    let wanted = [
        (Relation::Matching, matching),
        (Relation::DifferentBuildings, different),
    ];
    let requests: Vec<PairRequest> = wanted
        .into_iter()
        .flat_map(|(relation, count)| (0..count).map(move |k| (relation, k)))
        .map(|(relation, k)| PairRequest {
            seed,
            relation,
            kind: kinds[k % kinds.len()],
            worlds: 16,
            number: (k / kinds.len()) as u64,
        })
        .collect();
    requests.par_iter().filter_map(made).collect()
}

fn made(request: &PairRequest) -> Option<LabelledPair> {
    let pair = generate_pair(request).ok()?;
    let mut random = Random::new(request.seed, &[21, request.kind as u64, request.number]);
    let (moving, truth) = match pair.truth {
        Truth::Match { pose_fixed_moving, .. } => {
            let (moving, truth) = near(&pair.moving, pose_fixed_moving, &mut random);
            (moving, Some(truth))
        }
        Truth::Apart { .. } => (pair.moving, None),
    };
    Some(LabelledPair {
        name: format!("{}-{}-{}", request.relation, request.kind, request.number),
        fixed: pair.fixed,
        moving,
        truth,
    })
}
