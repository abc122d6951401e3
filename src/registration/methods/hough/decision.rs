//! The decision: accept the best hypothesis, or say why not.

use super::params::HoughParameters;
use super::placement::{Moments, Placement};
use super::refine::Refined;
use super::score::Score;

/// Hypotheses nearer than this are one, metres.
pub(super) const RIVAL_M: f64 = 0.7;

/// A hypothesis after the fine refinement.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finalist {
    pub(super) refined: Refined,
    pub(super) score: Score,
}

impl Finalist {
    pub(super) fn placement(&self) -> Placement {
        self.refined.placement
    }
}

/// What to answer; the finalists are ranked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Verdict {
    Accept,
    NoOverlap,
    Ambiguous,
    UnderConstrained { free_direction: f32 },
}

/// Best first; hypotheses that came to lie together are one.
pub(super) fn rank(mut finalists: Vec<Finalist>, moving: Moments) -> Vec<Finalist> {
    finalists.sort_by(|a, b| {
        let soft = |f: &Finalist| f.score.mean.soft - 0.25 * f.score.mean.violated();
        b.score
            .significance
            .total_cmp(&a.score.significance)
            .then(soft(b).total_cmp(&soft(a)))
    });
    let mut ranked: Vec<Finalist> = Vec::new();
    for finalist in finalists {
        let apart =
            |other: &Finalist| other.placement().distance(finalist.placement(), moving) > super::shortlist::SAME_M;
        if ranked.iter().all(apart) {
            ranked.push(finalist);
        }
    }
    ranked
}

/// The best hypothesis that is really different from the one at `index`.
pub(super) fn rival(ranked: &[Finalist], index: usize, moving: Moments) -> Option<usize> {
    let me = ranked[index].placement();
    (0..ranked.len()).find(|&other| other != index && ranked[other].placement().distance(me, moving) > RIVAL_M)
}

/// Decides on the first of the ranked finalists.
pub(super) fn decide(ranked: &[Finalist], moving: Moments, parameters: &HoughParameters) -> Verdict {
    let best = &ranked[0];
    let s1 = best.score.significance;
    if s1 <= parameters.score_min {
        return Verdict::NoOverlap;
    }
    let (support, free_direction) = best.score.mean.weaker_direction();
    if 0.1 * support <= parameters.support_min_m {
        return Verdict::UnderConstrained { free_direction };
    }
    let s2 = rival(ranked, 0, moving).map_or(0.0, |index| ranked[index].score.significance);
    let ratio = (s2 + 5.0) / (s1 + 5.0);
    if ratio < parameters.ratio_max || (ratio < parameters.ratio_weak_max && s2 < parameters.rival_max) {
        Verdict::Accept
    } else {
        Verdict::Ambiguous
    }
}
