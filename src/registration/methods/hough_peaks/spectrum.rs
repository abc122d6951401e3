//! The circular cross-correlation of the spectra of two Hough images, and the choice among its maxima (eq. 22 to 26).
//!
//! **Convention.** The moving map rotated by psi has the spectrum `h'(theta) = h(theta - psi)` (Property 1), so the
//! correlation `C(psi) = sum h_fixed(theta) h_moving(theta - psi)` is greatest at the rotation that lays the moving map's
//! walls along those of the fixed one.
//!
//! **Method.**
//!
//! 1. h(theta) of both maps (eq. 22, `shared::spectrum`).
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

use super::params::{HoughPeaksParams, RotationChoice};
use crate::geometry::Angle;
use crate::registration::methods::shared::correlation::{circular_correlation, circular_maxima, rotation_of};
use crate::registration::methods::shared::hough_image::to_f64;

/// The candidate rotations of the moving map in (-90, 90] whole degrees, the best first (eq. 24 and 25).
pub(super) fn rotation_candidates(fixed: &[f64], moving: &[f64], params: &HoughPeaksParams) -> Vec<Angle> {
    let correlation = circular_correlation(fixed, moving);
    let (apart, most) = (params.candidate_separation_degrees, params.rotation_candidates as usize);
    circular_maxima(&correlation, apart, most)
        .into_iter()
        .map(|columns| rotation_of(to_f64(columns)))
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
    // Departs from section 5.1: h has period 180 degrees, so each maximum is followed up with its half turn.
    let both = |rotation| RotationCandidate {
        rotation,
        half_turns: vec![false, true],
    };
    match (choice, psi_hat) {
        // Departs from line 15, eq. 26: all candidates are followed up, and psi-hat chooses none.
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
    use super::super::params::Spectrum;
    use super::*;
    use crate::geometry::{Point, Pose2};
    use crate::registration::methods::shared::hough_image::{COLUMNS, Directions, HoughImage, WallPoints};
    use crate::registration::methods::shared::spectrum::spectrum;
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
