//! The pipeline over one pair of maps: the stages of the paper one after the other, for all hypotheses at once.

use std::time::Duration;

use rayon::prelude::*;

use super::features::Features;
use super::hough_image::{Directions, HoughImage};
use super::params::{HoughPeaksParams, RotationChoice};
use super::peaks::{Peak, local_peaks};
use super::psi_hat::psi_hat;
use super::rotation_tuning::tuned_rotation;
use super::spectrum::{RotationCandidate, choose, rotation_candidates};
use super::translation::{Fit, lines_about, matched_translation};
use super::translation_tuning::tuned_translation;
use super::verification::{distance_between, verified};
use crate::geometry::{Angle, Pose2};
use crate::registration::{Acceptance, Candidate, Control, Reason, Registration, Rejection, RunnerUp, StageTime};

/// Hypotheses nearer to each other than this RMS distance in metres are one: the tolerance by which answers are judged.
const SAME_WITHIN_M: f64 = 0.5;

/// Registers two maps by the paper's pipeline.
pub(super) fn register(
    fixed: &Features,
    moving: &Features,
    control: &dyn Control,
    params: &HoughPeaksParams,
) -> Registration {
    let mut stages = Stages::start(control);
    match decide(fixed, moving, &mut stages, params) {
        Ok(Candidate {
            pose_fixed_moving,
            covariance,
            evidence,
        }) => Registration::Accepted(Acceptance {
            pose_fixed_moving,
            covariance,
            evidence,
            stages: stages.times,
        }),
        Err(Refusal { reason, candidates }) => Registration::Rejected(Rejection {
            reason,
            candidates,
            stages: stages.times,
        }),
    }
}

/// Why there is no answer, with the hypotheses that came so far.
struct Refusal {
    reason: Reason,
    candidates: Vec<Candidate>,
}

impl From<Reason> for Refusal {
    fn from(reason: Reason) -> Self {
        Self {
            reason,
            candidates: Vec::new(),
        }
    }
}

/// Takes the time of each stage and looks whether to go on.
struct Stages<'a> {
    control: &'a dyn Control,
    since: Duration,
    times: Vec<StageTime>,
}

impl<'a> Stages<'a> {
    fn start(control: &'a dyn Control) -> Self {
        Self {
            control,
            since: control.now(),
            times: Vec::new(),
        }
    }

    fn done(&mut self, stage: &'static str) -> Result<(), Reason> {
        let now = self.control.now();
        let duration = now.saturating_sub(self.since);
        self.times.push(StageTime { stage, duration });
        self.since = now;
        self.control.should_stop().map_or(Ok(()), |stop| Err(stop.into()))
    }
}

fn decide(
    fixed_map: &Features,
    moving_map: &Features,
    stages: &mut Stages<'_>,
    params: &HoughPeaksParams,
) -> Result<Candidate, Refusal> {
    let structure_m = fixed_map.wall_m().min(moving_map.wall_m());
    if structure_m < params.wall_min_m || structure_m <= 0.0 {
        return Err(Refusal::from(Reason::NoStructure {
            structure_m,
            needed_m: params.wall_min_m,
        }));
    }
    let cell = fixed_map.cell().max(moving_map.cell());
    let (fixed, moving) = (fixed_map.at_cell(cell, params), moving_map.at_cell(cell, params));
    let (fixed, moving): (&Features, &Features) = (&fixed, &moving);

    let rotations = rotations(fixed, moving, params);
    stages.done("rotation candidates")?;
    let rotations: Vec<RotationCandidate> = rotations
        .into_par_iter()
        .map(|r| tuned(r, fixed, moving, params))
        .collect();
    stages.done("rotation tuning")?;
    let fits: Vec<Hypothesis> = rotations
        .par_iter()
        .flat_map_iter(|rotation| matched(rotation, fixed, moving, params))
        .collect();
    stages.done("peak matching")?;
    let Some(poses) = translated(&fits, cell) else {
        return Err(no_translation(&fits, params).into());
    };
    let poses: Vec<(Pose2, f64)> = poses
        .into_par_iter()
        .map(|(pose, support_m)| {
            (
                tuned_translation(&fixed.states, &moving.states, pose, params),
                support_m,
            )
        })
        .collect();
    stages.done("translation tuning")?;
    let maps = (&fixed_map.states, &moving_map.states);
    let verify = |(pose, support_m)| verified(maps, (fixed, moving), pose, support_m, params);
    let candidates = ranked(poses.into_par_iter().map(verify).collect(), moving, params);
    stages.done("verification")?;
    verdict(candidates, params)
}

/// Stage 1: the rotations to follow up (Algorithm 1, lines 1 to 15).
fn rotations(fixed: &Features, moving: &Features, params: &HoughPeaksParams) -> Vec<RotationCandidate> {
    let approximate = match params.rotation_choice {
        RotationChoice::NearestToPsiHat => psi_hat(&fixed.peaks, &moving.peaks, params),
        RotationChoice::BestVerified => None,
    };
    let candidates = rotation_candidates(&fixed.spectrum, &moving.spectrum, params);
    choose(candidates, approximate, params.rotation_choice)
}

/// Stage 2: a candidate with its rotation tuned (lines 16 to 19). Half turns share it: an image has period 180 degrees.
fn tuned(
    candidate: RotationCandidate,
    fixed: &Features,
    moving: &Features,
    params: &HoughPeaksParams,
) -> RotationCandidate {
    let points = (&fixed.points, &moving.points);
    let spectra = (&fixed.spectrum[..], &moving.spectrum[..]);
    RotationCandidate {
        rotation: tuned_rotation(candidate.rotation, points, spectra, params),
        ..candidate
    }
}

/// A rotation with what the matched peaks say of the translation.
struct Hypothesis {
    rotation: Angle,
    fit: Fit,
}

/// Stage 3: the peaks of the fixed map matched with those of the rotated moving map (Algorithm 2, lines 1 to 11).
fn matched(
    candidate: &RotationCandidate,
    fixed: &Features,
    moving: &Features,
    params: &HoughPeaksParams,
) -> Vec<Hypothesis> {
    let directions = Directions::half_turn_of_rotated(candidate.rotation);
    let image = HoughImage::new(&moving.points, directions, params.line_width_cells as usize);
    let peaks = local_peaks(&image, params);
    // the pivot is the centre of the fixed map's walls
    let of_fixed = lines_about(fixed.peaks.iter().copied(), [0.0, 0.0]);
    let hypothesis = |half_turned: &bool| {
        let (rotation, turn): (Angle, fn(Peak) -> Peak) = if *half_turned {
            (candidate.rotation + Angle::HALF_TURN, Peak::half_turned)
        } else {
            (candidate.rotation, |peak| peak)
        };
        let [x, y] = Pose2::new(0.0, 0.0, rotation).apply(moving.points.center);
        let center_from_pivot = [x - fixed.points.center[0], y - fixed.points.center[1]];
        let of_moving = lines_about(peaks.iter().copied().map(turn), center_from_pivot);
        Hypothesis {
            rotation,
            fit: matched_translation(&of_fixed, &of_moving, fixed.cell(), params),
        }
    };
    candidate.half_turns.iter().map(hypothesis).collect()
}

/// The poses of the hypotheses whose translation is held, with the wall that holds each; `None` when there is none.
fn translated(hypotheses: &[Hypothesis], cell: f64) -> Option<Vec<(Pose2, f64)>> {
    let poses: Vec<(Pose2, f64)> = hypotheses
        .iter()
        .filter_map(|hypothesis| {
            let [x, y] = hypothesis.fit.translation?;
            let pose = Pose2::new(x * cell, y * cell, hypothesis.rotation);
            Some((pose, hypothesis.fit.support_m))
        })
        .collect();
    (!poses.is_empty()).then_some(poses)
}

/// Why no hypothesis has a translation.
fn no_translation(tried: &[Hypothesis], params: &HoughPeaksParams) -> Reason {
    let mut most: Option<&Hypothesis> = None;
    for hypothesis in tried {
        if hypothesis.fit.associated > most.map_or(0, |best| best.fit.associated) {
            most = Some(hypothesis);
        }
    }
    match most {
        Some(Hypothesis { fit, .. }) => Reason::UnderConstrained {
            free_direction: fit.weaker_direction,
            support_m: fit.support_m,
            needed_m: params.support_min_m,
        },
        None => Reason::NoOverlap {
            score: 0.0,
            needed: params.verification_threshold,
        },
    }
}

/// The hypotheses, the best first, each with its rival: those of enough overlap before the others, then by V.
fn ranked(mut candidates: Vec<Candidate>, moving: &Features, params: &HoughPeaksParams) -> Vec<Candidate> {
    let enough = |candidate: &Candidate| candidate.evidence.overlap >= params.overlap_min;
    candidates.sort_by(|a, b| {
        let by_score = b.evidence.score.total_cmp(&a.evidence.score);
        enough(b).cmp(&enough(a)).then(by_score) // stable: of equal ones the better correlated rotation
    });
    let rivals: Vec<Option<RunnerUp>> = candidates
        .iter()
        .map(|candidate| {
            candidates.iter().find_map(|other| {
                let distance_m = distance_between(moving, candidate.pose_fixed_moving, other.pose_fixed_moving);
                (distance_m > SAME_WITHIN_M).then_some(RunnerUp {
                    pose_fixed_moving: other.pose_fixed_moving,
                    score: other.evidence.score,
                    distance_m,
                })
            })
        })
        .collect();
    for (candidate, rival) in candidates.iter_mut().zip(rivals) {
        candidate.evidence.runner_up = rival;
    }
    candidates
}

/// The threshold of eq. 34.
fn verdict(candidates: Vec<Candidate>, params: &HoughPeaksParams) -> Result<Candidate, Refusal> {
    let best = candidates.first().expect("invariant: at least one pose was verified");
    let reason = match best.evidence.verification_index {
        Some(_) if best.evidence.overlap < params.overlap_min => Reason::NoOverlap {
            score: best.evidence.overlap,
            needed: params.overlap_min,
        },
        Some(index) if index >= params.verification_threshold => {
            return Ok(best.clone());
        }
        Some(verification_index) => Reason::VerificationFailed {
            verification_index,
            threshold: params.verification_threshold,
        },
        None => Reason::NoOverlap {
            score: 0.0,
            needed: params.verification_threshold,
        },
    };
    Err(Refusal { reason, candidates })
}
