//! What was found, in the words of `registration::outcome`.

use rayon::prelude::*;

use super::agreement::agreement;
use super::decision::{Finalist, Rule, Verdict, probability, rival};
use super::features::{Features, SAMPLE_M};
use super::num::real64;
use super::params::DecisionParameters;
use super::refine::{covariance, sandwich};
use crate::geometry::{Angle, Pose2};
use crate::registration::{Acceptance, Candidate, Covariance, Evidence, Reason, Registration, Rejection, RunnerUp};

/// Candidates told of a rejection.
const CANDIDATES: usize = 8;
/// Neighbouring samples see the same wall: the variance of their mean is this much above that of independent ones.
const INFLATION: f64 = 8.0;
/// Residuals below this share of a cell are luck, not precision.
const CELL_SHARE: f64 = 0.1;

/// One pair, with the maps in the order of the search, and whether that is the caller's.
pub(super) struct Pair<'a> {
    pub(super) fixed: &'a Features,
    pub(super) moving: &'a Features,
    pub(super) swapped: bool,
}

impl Pair<'_> {
    fn pose(&self, finalist: &Finalist) -> Pose2 {
        let pose = finalist.placement().between_maps(self.fixed.frame, self.moving.frame);
        if self.swapped { pose.inverse() } else { pose }
    }

    /// Of the moving map's own frame in the fixed map's own frame, as the caller named them.
    fn covariance(&self, finalist: &Finalist) -> Covariance {
        let cell = f64::from(self.fixed.cells.cell.max(self.moving.cells.cell));
        let local = covariance(&finalist.refined, INFLATION, CELL_SHARE * cell);
        // Left by the fixed frame: its axes. Right by the moving frame: from the local origin to the map's own.
        let pose = finalist.placement().between_maps(self.fixed.frame, self.moving.frame);
        let local_origin = self.fixed.frame * finalist.placement().pose();
        let (sin, cos) = self.fixed.frame.yaw().sin_cos();
        let axes = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
        let (lx, ly) = (pose.x() - local_origin.x(), pose.y() - local_origin.y());
        let carry = [[1.0, 0.0, -ly], [0.0, 1.0, lx], [0.0, 0.0, 1.0]];
        let mut told = sandwich(carry, sandwich(axes, local));
        if self.swapped {
            // T^-1 = (-R^T t, -yaw): d(T^-1) = -[R^T, perp(t') ; 0 1] dT with t' the inverse's translation
            let inverse = pose.inverse();
            let (sin, cos) = pose.yaw().sin_cos();
            let flip = [[-cos, -sin, inverse.y()], [sin, -cos, -inverse.x()], [0.0, 0.0, -1.0]];
            told = sandwich(flip, told);
        }
        let [[xx, xy, xt], [yx, yy, yt], [tx, ty, tt]] = told;
        let (xy, xt, yt) = (0.5 * (xy + yx), 0.5 * (xt + tx), 0.5 * (yt + ty));
        Covariance([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
    }

    fn evidence(&self, ranked: &[Finalist], index: usize, parameters: &DecisionParameters) -> Evidence {
        let finalist = &ranked[index];
        let (verification_index, overlap) = agreement(self.fixed, self.moving, finalist.placement());
        let mean = &finalist.score.mean;
        let metres = |samples: f32| f64::from(samples) * SAMPLE_M;
        Evidence {
            score: finalist.plain.into(),
            probability: Some(probability(ranked, index, self.moving.moments, &parameters.weights).into()),
            verification_index,
            overlap,
            matched_wall_m: metres(mean.found),
            violated_wall_m: metres(mean.violated()),
            weaker_direction_m: metres(finalist.support),
            runner_up: rival(ranked, index, self.moving.moments).map(|other| RunnerUp {
                pose_fixed_moving: self.pose(&ranked[other]),
                score: ranked[other].plain.into(),
                distance_m: ranked[other]
                    .placement()
                    .distance(finalist.placement(), self.moving.moments),
            }),
        }
    }

    /// The answer; `stages` are filled in by the caller, who knows the last one's end.
    pub(super) fn tell(&self, ranked: &[Finalist], verdict: Verdict, parameters: &DecisionParameters) -> Registration {
        let first = &ranked[0];
        let score = f64::from(first.plain);
        let reason = match verdict {
            Verdict::Accept(rule) => {
                let evidence = self.evidence(ranked, 0, parameters);
                let least = f64::from(parameters.verification_min);
                if rule == Rule::Known || evidence.suffices(Some(least)) {
                    return Registration::Accepted(Acceptance {
                        pose_fixed_moving: self.pose(first),
                        covariance: self.covariance(first),
                        evidence: Evidence {
                            // the other rules do not ask for it
                            probability: evidence.probability.filter(|_| rule == Rule::Likely),
                            ..evidence
                        },
                        stages: Vec::new(),
                    });
                }
                Reason::VerificationFailed {
                    verification_index: evidence.verification_index.unwrap_or(0.0),
                    threshold: least,
                }
            }
            Verdict::NoOverlap => Reason::NoOverlap {
                score,
                needed: parameters.score_min.into(),
            },
            Verdict::Ambiguous => Reason::Ambiguous {
                score,
                runner_up_score: rival(ranked, 0, self.moving.moments).map_or(0.0, |other| ranked[other].plain.into()),
            },
            Verdict::UnderConstrained => {
                let told_in = if self.swapped {
                    // the caller's fixed map is the one that moved in the search
                    -first.placement().pose().yaw() + self.moving.frame.yaw()
                } else {
                    self.fixed.frame.yaw()
                };
                Reason::UnderConstrained {
                    free_direction: Angle::from_radians(f64::from(first.free_direction)) + told_in,
                    support_m: f64::from(first.support) * SAMPLE_M,
                    needed_m: parameters.support_min_m.into(),
                }
            }
        };
        let candidates = (0..ranked.len().min(CANDIDATES))
            .into_par_iter()
            .map(|index| Candidate {
                pose_fixed_moving: self.pose(&ranked[index]),
                covariance: self.covariance(&ranked[index]),
                evidence: self.evidence(ranked, index, parameters),
            });
        Registration::Rejected(Rejection {
            reason,
            candidates: candidates.collect(),
            stages: Vec::new(),
        })
    }
}

/// A map that has too little to be recognised by.
pub(super) fn no_structure(features: [Option<&Features>; 2], needed_m: f64) -> Option<Reason> {
    let structure_m = features
        .into_iter()
        .map(|map| map.map_or(0.0, Features::structure_m))
        .fold(real64(usize::MAX), f64::min);
    (structure_m < needed_m).then_some(Reason::NoStructure { structure_m, needed_m })
}
