//! Rotation tuning: a fraction of a degree on top of a candidate rotation (Algorithm 1 lines 16 to 19, eq. 27).
//!
//! **Convention.** The tuned rotation is the candidate plus delta psi; a positive one turns the moving map further
//! counter-clockwise.
//!
//! **Method** (`WallDirections`). Up to four directions in which both maps, the moving one rotated by the candidate, have
//! their strongest walls. Around each a spectrum of both maps at `tuning_step_degrees` within +-Lambda. delta psi is the
//! shift of greatest correlation of these spectra, all windows together, with a parabola through its maximum. With one
//! window and one wall this is eq. 27, the difference of two places of the maximum; with several it asks all of them.
//!
//! **Cost.** Four windows of a few dozen columns of both maps: about one more Hough image each.
//!
//! **Fails when** no wall is in both maps; it then stays within +-Lambda of the candidate.
//!
//! **Differences from the paper.** Lines 16 to 18 put the window around the rotation itself. But the peaks of the
//! fixed map's image lie at the directions of its walls, which have nothing to do with it: both places of the maximum
//! are then noise. `PaperWindow` does just that.

use super::params::{HoughPeaksParams, RotationTuning};
use crate::geometry::Angle;
use crate::registration::methods::shared::correlation::{greatest, parabola_offset};
use crate::registration::methods::shared::hough_image::{COLUMNS, Directions, HoughImage, WallPoints, to_f64};
use crate::registration::methods::shared::spectrum::spectrum;

/// Wall directions that are asked.
const WINDOWS_MAX: usize = 4;
/// Their distance in columns.
const WINDOWS_APART: usize = 10;

/// The rotation of `candidate`, tuned within +-Lambda. `spectra` are those of the fixed and the moving map's images.
pub(super) fn tuned_rotation(
    candidate: Angle,
    points: (&WallPoints, &WallPoints),
    spectra: (&[f64], &[f64]),
    params: &HoughPeaksParams,
) -> Angle {
    match params.rotation_tuning {
        RotationTuning::Off => candidate,
        RotationTuning::PaperWindow => candidate + paper_window(candidate, points, params),
        RotationTuning::WallDirections => {
            // Departs from lines 16 to 18: the windows are around directions of walls, not around the rotation.
            let windows = common_directions(candidate, spectra);
            candidate + wall_directions(candidate, &windows, points, params)
        }
    }
}

/// Steps of the tuning's resolution in Lambda.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "0.1 to 5 degrees over 0.01 to 1 degree"
)]
fn steps_in_lambda(params: &HoughPeaksParams) -> usize {
    (params.lambda_degrees / params.tuning_step_degrees).round().max(1.0) as usize
}

/// The spectrum within `reach` steps around `theta` of a map that is rotated by `rotation`.
fn fine_spectrum(
    points: &WallPoints,
    rotation: Angle,
    theta: Angle,
    reach: usize,
    params: &HoughPeaksParams,
) -> Vec<f64> {
    let step = Angle::from_degrees(params.tuning_step_degrees).radians();
    let directions = Directions {
        first: theta.radians() - rotation.radians() - to_f64(reach) * step,
        step,
        count: 2 * reach + 1,
    };
    // lines a cell wide: the wider the line, the flatter the place of its maximum
    spectrum(&HoughImage::new(points, directions, 1), params.spectrum)
}

/// Eq. 27 as printed.
fn paper_window(candidate: Angle, (fixed, moving): (&WallPoints, &WallPoints), params: &HoughPeaksParams) -> Angle {
    let reach = steps_in_lambda(params);
    let place = |spectrum: Vec<f64>| to_f64(greatest(&spectrum));
    let of_fixed = place(fine_spectrum(fixed, Angle::ZERO, candidate, reach, params));
    let of_moving = place(fine_spectrum(moving, candidate, candidate, reach, params));
    Angle::from_degrees((of_fixed - of_moving) * params.tuning_step_degrees)
}

/// The columns in which both maps have their strongest walls once the moving one is rotated.
fn common_directions(candidate: Angle, (fixed, moving): (&[f64], &[f64])) -> Vec<usize> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole degrees in (-90, 90], made positive"
    )]
    let turn = (candidate.degrees().round() + to_f64(COLUMNS)) as usize;
    let strength = |column: usize| fixed[column] * moving[(column + 2 * COLUMNS - turn) % COLUMNS];
    let mut order: Vec<usize> = (0..COLUMNS).collect();
    order.sort_by(|a, b| strength(*b).total_cmp(&strength(*a)));
    let mut kept: Vec<usize> = Vec::new();
    for column in order {
        let apart = |other: &usize| {
            let difference = column.abs_diff(*other);
            difference.min(COLUMNS - difference) >= WINDOWS_APART
        };
        if kept.len() < WINDOWS_MAX && kept.iter().all(apart) {
            kept.push(column);
        }
    }
    kept
}

fn wall_directions(
    candidate: Angle,
    windows: &[usize],
    (fixed, moving): (&WallPoints, &WallPoints),
    params: &HoughPeaksParams,
) -> Angle {
    let reach = steps_in_lambda(params);
    // correlation[s] belongs to delta psi = (s - reach) steps
    let mut correlation = vec![0.0; 2 * reach + 1];
    for column in windows {
        let theta = Directions::of_column(*column);
        let of_fixed = fine_spectrum(fixed, Angle::ZERO, theta, reach, params);
        let of_moving = fine_spectrum(moving, candidate, theta, 2 * reach, params);
        let mean = of_fixed.iter().sum::<f64>() / to_f64(of_fixed.len());
        for (s, sum) in correlation.iter_mut().enumerate() {
            // turned by delta psi, the moving spectrum at t is the present one at t - delta psi
            *sum += of_fixed
                .iter()
                .enumerate()
                .map(|(t, value)| (value - mean) * of_moving[t + 2 * reach - s])
                .sum::<f64>();
        }
    }
    let mut best = reach; // a flat correlation changes nothing
    for (s, value) in correlation.iter().enumerate() {
        if *value > correlation[best] {
            best = s;
        }
    }
    let place = to_f64(best) + parabola_offset(&correlation, best) - to_f64(reach);
    Angle::from_degrees(place * params.tuning_step_degrees)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Point, Pose2};
    use proptest::prelude::*;

    fn walls() -> Vec<Point> {
        let mut points = Vec::new();
        for i in 0..200_u32 {
            let s = f64::from(i);
            points.push([s, 0.3]);
            points.push([s, 80.3]);
            if i < 120 {
                points.push([0.2, s]);
                points.push([20.0 + s * 0.6, 10.0 + s * 0.8]);
            }
        }
        points
    }

    fn tuned(truth_degrees: f64, tuning: RotationTuning) -> f64 {
        let params = HoughPeaksParams {
            rotation_tuning: tuning,
            ..HoughPeaksParams::default()
        };
        let pose = Pose2::new(12.0, -5.0, Angle::from_degrees(truth_degrees));
        let moved: Vec<Point> = walls().iter().map(|p| pose.inverse().apply(*p)).collect();
        let (fixed, moving) = (WallPoints::about_center(&walls()), WallPoints::about_center(&moved));
        let of = |points: &WallPoints| {
            let image = HoughImage::new(points, Directions::half_turn_of_rotated(Angle::ZERO), 3);
            spectrum(&image, params.spectrum)
        };
        let spectra = (of(&fixed), of(&moving));
        let candidate = Angle::from_degrees(truth_degrees.round());
        tuned_rotation(candidate, (&fixed, &moving), (&spectra.0, &spectra.1), &params).degrees()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn the_windows_at_the_walls_find_the_fraction_of_a_degree(truth in -89.0..89.0_f64) {
            let found = tuned(truth, RotationTuning::WallDirections);
            // where a wall's cells cross from bin to bin the spectrum has steps: a third of a degree at worst
            prop_assert!((found - truth).abs() < 0.15, "{found} instead of {truth}");
        }
    }

    #[test]
    fn tuning_stays_within_lambda_of_the_candidate() {
        for tuning in [
            RotationTuning::Off,
            RotationTuning::PaperWindow,
            RotationTuning::WallDirections,
        ] {
            for truth in [-5.4, 33.3, 85.2] {
                let found = tuned(truth, tuning);
                assert!(
                    (found - truth.round()).abs() <= 2.0 + 1e-9,
                    "{tuning:?}: {found} for {truth}"
                );
            }
        }
        assert!((tuned(-5.4, RotationTuning::Off) + 5.0).abs() < 1e-9);
    }
}
