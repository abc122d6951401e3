//! The search over one pair of maps: the stages of the paper one after the other, for all hypotheses at once.

use rayon::prelude::*;

use super::features::Features;
use super::params::{HoughPeaksParams, RotationChoice};
use super::psi_hat::psi_hat;
use super::rotation_tuning::tuned_rotation;
use super::spectrum::{RotationCandidate, choose, rotation_candidates};
use super::translation::{Fit, lines_about, matched_translation};
use super::translation_tuning::tuned_translation;
use crate::geometry::{Angle, Pose2};
use crate::registration::Reason;
use crate::registration::methods::shared::hough_image::{Directions, HoughImage};
use crate::registration::methods::shared::peaks::{Peak, local_peaks};
use crate::registration::methods::shared::search::{Found, Stages};

/// The poses of all hypotheses that have one.
pub(super) fn search(
    fixed: &Features,
    moving: &Features,
    stages: &mut Stages<'_>,
    params: &HoughPeaksParams,
) -> Result<Vec<Found>, Reason> {
    let rotations = rotations(fixed, moving, params);
    stages.done("rotation candidates")?;
    let rotations: Vec<RotationCandidate> = rotations
        .into_par_iter()
        .map(|rotation| stages.go_on().map(|()| tuned(rotation, fixed, moving, params)))
        .collect::<Result<_, Reason>>()?;
    stages.done("rotation tuning")?;
    let fits: Vec<Vec<Hypothesis>> = rotations
        .par_iter()
        .map(|rotation| stages.go_on().map(|()| matched(rotation, fixed, moving, params)))
        .collect::<Result<_, Reason>>()?;
    let fits: Vec<Hypothesis> = fits.into_iter().flatten().collect();
    stages.done("peak matching")?;
    let poses = translated(&fits, fixed.map.cell());
    if poses.is_empty() {
        return Err(no_translation(&fits, params));
    }
    let tune = |found: Found| {
        stages.go_on()?;
        let maps = (&fixed.map.states, &moving.map.states);
        Ok(Found {
            pose_fixed_moving: tuned_translation(maps.0, maps.1, found.pose_fixed_moving, params),
            ..found
        })
    };
    let poses: Vec<Found> = poses.into_par_iter().map(tune).collect::<Result<_, Reason>>()?;
    stages.done("translation tuning")?;
    Ok(poses)
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
    let points = (&fixed.map.points, &moving.map.points);
    let spectra = (&fixed.spectrum[..], &moving.spectrum[..]);
    RotationCandidate {
        rotation: tuned_rotation(candidate.rotation, points, spectra, params),
        ..candidate
    }
}

/// A rotation with what the matched peaks say of the translation.
pub(super) struct Hypothesis {
    rotation: Angle,
    pub(super) fit: Fit,
}

/// Stage 3: the peaks of the fixed map matched with those of the rotated moving map (Algorithm 2, lines 1 to 11).
pub(super) fn matched(
    candidate: &RotationCandidate,
    fixed: &Features,
    moving: &Features,
    params: &HoughPeaksParams,
) -> Vec<Hypothesis> {
    let (fixed_points, moving_points) = (&fixed.map.points, &moving.map.points);
    let directions = Directions::half_turn_of_rotated(candidate.rotation);
    let image = HoughImage::new(moving_points, directions, params.line_width_cells as usize);
    let peaks = local_peaks(&image, &params.peak_rule());
    // the pivot is the centre of the fixed map's walls
    let of_fixed = lines_about(fixed.peaks.iter().copied(), [0.0, 0.0]);
    let hypothesis = |half_turned: &bool| {
        let (rotation, turn): (Angle, fn(Peak) -> Peak) = if *half_turned {
            (candidate.rotation + Angle::HALF_TURN, Peak::half_turned)
        } else {
            (candidate.rotation, |peak| peak)
        };
        let [x, y] = Pose2::new(0.0, 0.0, rotation).apply(moving_points.center);
        let center_from_pivot = [x - fixed_points.center[0], y - fixed_points.center[1]];
        let of_moving = lines_about(peaks.iter().copied().map(turn), center_from_pivot);
        Hypothesis {
            rotation,
            fit: matched_translation(&of_fixed, &of_moving, fixed.map.cell(), params),
        }
    };
    candidate.half_turns.iter().map(hypothesis).collect()
}

/// The poses of the hypotheses whose translation is held, with the wall that holds each.
fn translated(hypotheses: &[Hypothesis], cell: f64) -> Vec<Found> {
    hypotheses
        .iter()
        .filter_map(|hypothesis| {
            let [x, y] = hypothesis.fit.translation?;
            Some(Found {
                pose_fixed_moving: Pose2::new(x * cell, y * cell, hypothesis.rotation),
                support_m: Some(hypothesis.fit.support_m),
            })
        })
        .collect()
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
