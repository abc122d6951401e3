//! The spectrum h(theta) of a Hough image and the circular cross-correlation of two of them (eq. 22 to 26).
//!
//! **Convention.** The moving map rotated by psi has the spectrum `h'(theta) = h(theta - psi)` (Property 1), so the
//! correlation `C(psi) = sum h_fixed(theta) h_moving(theta - psi)` is greatest at the rotation that lays the moving map's
//! walls along those of the fixed one.
//!
//! **Method.**
//!
//! 1. `h(theta) = f(column theta)`, f invariant to the order of a column (eq. 22): the translation moves the bins of a
//!    column and leaves h as it is.
//! 2. `C` over all whole degrees, circular with period 180 degrees (eq. 24), means removed.
//! 3. Its local maxima, the greatest first (eq. 25).
//! 4. The choice (eq. 26): the candidate nearest to psi-hat among them and their half turns, or all of them.
//!
//! **Cost.** 180 x 180 products.
//!
//! **Fails when** the walls have all directions alike: the spectrum is flat.
//!
//! **Differences from the paper.** h has period 180 degrees, so each maximum stands for two rotations, half a turn apart;
//! the four candidates of the paper's example over 360 degrees are two maxima twice. One hypothesis chosen by psi-hat is
//! mostly the wrong one, so by default all go on and the verification decides.

use super::hough_image::{COLUMNS, HoughImage, to_f64};
use super::params::{HoughPeaksParams, RotationChoice, Spectrum};
use crate::geometry::Angle;

/// `f` of one column (eq. 22).
pub(super) fn value_of(column: &[u32], f: Spectrum) -> f64 {
    let sum: u64 = column.iter().map(|votes| u64::from(*votes)).sum();
    #[expect(clippy::cast_precision_loss, reason = "votes stay far below 2^52")]
    let sum = sum as f64;
    match f {
        Spectrum::Max => f64::from(column.iter().copied().max().unwrap_or(0)),
        Spectrum::MeanOfNonZeros => {
            let non_zeros = column.iter().filter(|votes| **votes > 0).count();
            if non_zeros == 0 { 0.0 } else { sum / to_f64(non_zeros) }
        }
        Spectrum::Entropy => -column
            .iter()
            .filter(|votes| **votes > 0)
            .map(|votes| f64::from(*votes) / sum)
            .map(|p| p * p.log2())
            .sum::<f64>(),
    }
}

/// h(theta) of an image (eq. 22), a value a column.
pub(super) fn spectrum(image: &HoughImage, f: Spectrum) -> Vec<f64> {
    image.columns().map(|column| value_of(column, f)).collect()
}

/// The candidate rotations of the moving map in (-90, 90] whole degrees, the best first (eq. 24 and 25).
pub(super) fn rotation_candidates(fixed: &[f64], moving: &[f64], params: &HoughPeaksParams) -> Vec<Angle> {
    let correlation = circular_correlation(fixed, moving);
    let mut order: Vec<usize> = (0..COLUMNS).filter(|k| correlation[*k] > 0.0).collect();
    order.sort_by(|a, b| correlation[*b].total_cmp(&correlation[*a])); // stable: of equal ones the smaller rotation
    let mut kept: Vec<usize> = Vec::new();
    for k in order {
        let around = [correlation[(k + 1) % COLUMNS], correlation[(k + COLUMNS - 1) % COLUMNS]];
        let is_maximum = around.iter().all(|other| *other <= correlation[k]);
        let apart = |other: &usize| to_f64(turns_apart(k, *other)) >= params.candidate_separation_degrees;
        if is_maximum && kept.iter().all(apart) {
            kept.push(k);
        }
    }
    kept.truncate(params.rotation_candidates as usize);
    kept.into_iter()
        .map(|k| {
            if k <= COLUMNS / 2 {
                to_f64(k)
            } else {
                to_f64(k) - to_f64(COLUMNS)
            }
        })
        .map(Angle::from_degrees)
        .collect()
}

/// Degrees between two rotations that are only known up to half turns.
fn turns_apart(a: usize, b: usize) -> usize {
    let difference = a.abs_diff(b);
    difference.min(COLUMNS - difference)
}

/// `C(k) = sum over t of fixed(t) moving(t - k)`, means removed, indices modulo the length (eq. 24).
pub(super) fn circular_correlation(fixed: &[f64], moving: &[f64]) -> Vec<f64> {
    let n = fixed.len();
    let centered = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / to_f64(values.len());
        values.iter().map(|value| value - mean).collect::<Vec<f64>>()
    };
    let (fixed, moving) = (centered(fixed), centered(moving));
    (0..n)
        .map(|k| (0..n).map(|t| fixed[t] * moving[(t + n - k) % n]).sum())
        .collect()
}

/// A rotation to be followed up: a maximum of the correlation, and which of its half turns.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RotationCandidate {
    /// The rotation in (-90, 90] degrees.
    pub(super) rotation: Angle,
    /// Whether to follow up the rotation itself, the rotation and a half turn, or both.
    pub(super) half_turns: Vec<bool>,
}

/// Chooses among the candidates (eq. 26).
pub(super) fn choose(candidates: Vec<Angle>, psi_hat: Option<Angle>, choice: RotationChoice) -> Vec<RotationCandidate> {
    let both = |rotation| RotationCandidate {
        rotation,
        half_turns: vec![false, true],
    };
    match (choice, psi_hat) {
        (RotationChoice::BestVerified, _) => candidates.into_iter().map(both).collect(),
        (RotationChoice::NearestToPsiHat, psi_hat) => {
            // without a psi-hat the paper has nothing to choose by: the best correlation then
            let distance = |(rotation, half_turned): &(Angle, bool)| {
                let rotation = if *half_turned {
                    *rotation + Angle::HALF_TURN
                } else {
                    *rotation
                };
                psi_hat.map_or(0.0, |psi| (rotation - psi).magnitude())
            };
            candidates
                .iter()
                .flat_map(|rotation| [(*rotation, false), (*rotation, true)])
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .map(|(rotation, half_turned)| RotationCandidate {
                    rotation,
                    half_turns: vec![half_turned],
                })
                .into_iter()
                .collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::hough_image::{Directions, WallPoints};
    use super::*;
    use crate::geometry::{Point, Pose2};
    use proptest::prelude::*;

    /// Walls of three lengths and directions: an L of a room and a skew wall.
    fn walls() -> Vec<Point> {
        let mut points = Vec::new();
        for i in 0..150_u32 {
            let s = f64::from(i);
            points.push([s, 0.3]);
            if i < 90 {
                points.push([0.2, s]);
            }
            if i < 70 {
                points.push([20.0 + s * 0.6, 10.0 + s * 0.8]);
            }
        }
        points
    }

    fn spectrum_of(points: &[Point], f: Spectrum) -> Vec<f64> {
        let points = WallPoints::about_center(points);
        spectrum(
            &HoughImage::new(&points, Directions::half_turn_of_rotated(Angle::ZERO), 3),
            f,
        )
    }

    proptest! {
        #[test]
        fn the_correlation_finds_the_rotation_of_a_moved_map_up_to_half_turns(turn in -180_i32..=180, x in -90.0..90.0_f64,
                                                                              y in -90.0..90.0_f64) {
            let pose = Pose2::new(x, y, Angle::from_degrees(f64::from(turn)));
            let moved: Vec<Point> = walls().iter().map(|p| pose.inverse().apply(*p)).collect();
            for f in [Spectrum::Max, Spectrum::Entropy] {
                let candidates = rotation_candidates(&spectrum_of(&walls(), f), &spectrum_of(&moved, f), &HoughPeaksParams::default());
                let error = candidates[0].radians() - f64::from(turn).to_radians();
                prop_assert!(error.sin().abs() < 1.5_f64.to_radians(), "{} instead of {turn}", candidates[0].degrees());
            }
        }
    }

    #[test]
    fn f_does_not_depend_on_the_order_of_a_column() {
        for f in [Spectrum::Max, Spectrum::MeanOfNonZeros, Spectrum::Entropy] {
            let (a, b) = (value_of(&[0, 3, 5, 0, 2], f), value_of(&[5, 0, 0, 2, 3], f));
            assert!((a - b).abs() < 1e-12);
            assert!(value_of(&[0, 0, 0], f).abs() < 1e-12);
        }
        assert!((value_of(&[0, 3, 5, 0, 1], Spectrum::MeanOfNonZeros) - 3.0).abs() < 1e-12);
        assert!((value_of(&[2, 0, 2, 2, 2], Spectrum::Entropy) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_flat_spectrum_offers_no_rotation() {
        assert_eq!(
            rotation_candidates(&[4.0; COLUMNS], &[4.0; COLUMNS], &HoughPeaksParams::default()),
            []
        );
    }

    #[test]
    fn nearest_to_psi_hat_takes_one_of_the_papers_four_candidates() {
        // section 5.1: candidates -5, 85, 175 and -95 degrees, psi-hat -15: the choice is -5
        let candidates = [-5.0, 85.0].map(Angle::from_degrees).to_vec();
        let psi = |degrees| Some(Angle::from_degrees(degrees));
        let chosen = |psi_hat| choose(candidates.clone(), psi_hat, RotationChoice::NearestToPsiHat);
        let expect = |degrees, half_turned| {
            vec![RotationCandidate {
                rotation: Angle::from_degrees(degrees),
                half_turns: vec![half_turned],
            }]
        };
        assert_eq!(chosen(psi(-15.0)), expect(-5.0, false));
        assert_eq!(chosen(psi(-80.0)), expect(85.0, true));
        assert_eq!(chosen(None), expect(-5.0, false));
        assert_eq!(choose(candidates, None, RotationChoice::BestVerified).len(), 2);
    }
}
