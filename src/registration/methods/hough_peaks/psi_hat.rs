//! Peak association by votes, and the approximate rotation psi-hat (Algorithm 1, lines 3 to 11).
//!
//! **Method.** Each peak of the fixed map is associated with the peak of the moving map whose votes are nearest, when
//! they differ by less than `v_gate`. psi-hat is a mean over the associated directions' differences.
//!
//! **Cost.** The product of the numbers of peaks.
//!
//! **Fails when** many walls have about the same length: the nearest votes then belong to another wall, and the mean is
//! one of mostly wrong associations. Measured on real maps it chooses among four rotations about as well as chance.
//!
//! **Differences from the paper.** Line 11 averages `tan theta_1 - tan theta_2`, which is no angle and has no bound near
//! +-90 degrees. A line's direction has period 180 degrees, so the sound mean is half the circular mean of the doubled
//! differences; it is the default, and lies in (-90, 90] degrees. [`PsiHat::MeanOfTangents`] is the printed formula,
//! read as radians.

use super::params::{HoughPeaksParams, PsiHat};
use crate::geometry::Angle;
use crate::registration::methods::shared::hough_image::{Directions, to_f64};
use crate::registration::methods::shared::peaks::Peak;

/// Peaks of the fixed and the moving map that belong together by their votes: the paper's set C (eq. 21).
pub(super) fn associate_by_votes(fixed: &[Peak], moving: &[Peak], v_gate: f64) -> Vec<(Peak, Peak)> {
    fixed
        .iter()
        .filter_map(|peak| {
            let difference = |other: &&Peak| (peak.votes - other.votes).abs();
            let nearest = moving.iter().min_by(|a, b| difference(a).total_cmp(&difference(b)))?; // line 5
            (difference(&nearest) < v_gate).then_some((*peak, *nearest)) // lines 6 to 9
        })
        .collect()
}

/// The approximate rotation of the moving map; `None` when no peaks are associated or their differences cancel.
pub(super) fn psi_hat(fixed: &[Peak], moving: &[Peak], params: &HoughPeaksParams) -> Option<Angle> {
    let associated = associate_by_votes(fixed, moving, params.v_gate);
    if associated.is_empty() {
        return None;
    }
    let thetas = associated.iter().map(|(a, b)| {
        (
            Directions::of_column(a.column).radians(),
            Directions::of_column(b.column).radians(),
        )
    });
    match params.psi_hat {
        PsiHat::CircularMean => {
            // Departs from Algorithm 1 line 11: half the circular mean of doubled differences, not a mean of tangents.
            let (sin, cos) = thetas.fold((0.0, 0.0), |(sin, cos), (a, b)| {
                let doubled = 2.0 * (a - b);
                (sin + doubled.sin(), cos + doubled.cos())
            });
            let cancelled = sin.hypot(cos) < 1e-9 * to_f64(associated.len());
            (!cancelled).then(|| Angle::from_radians(sin.atan2(cos) / 2.0))
        }
        PsiHat::MeanOfTangents => {
            let sum: f64 = thetas.map(|(a, b)| a.tan() - b.tan()).sum();
            Angle::parse(sum / to_f64(associated.len())) // Algorithm 1 line 11 as printed
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn peak(column: usize, votes: f64) -> Peak {
        Peak {
            column,
            rho: 0.0,
            votes,
        }
    }

    #[test]
    fn peaks_are_associated_by_the_nearest_votes_within_the_gate() {
        let fixed = [peak(0, 100.0), peak(90, 60.0), peak(30, 20.0)];
        let moving = [peak(5, 98.0), peak(95, 65.0), peak(1, 40.0)];
        let associated = associate_by_votes(&fixed, &moving, 10.0);
        let votes: Vec<(f64, f64)> = associated.iter().map(|(a, b)| (a.votes, b.votes)).collect();
        assert_eq!(votes, [(100.0, 98.0), (60.0, 65.0)]);
        assert!(associate_by_votes(&fixed, &[], 10.0).is_empty());
    }

    proptest! {
        #[test]
        fn the_circular_mean_finds_any_rotation_up_to_half_turns(turn in 0_usize..180) {
            // walls of differing lengths; turned, their columns wrap, which has to change nothing
            let walls = [(3, 200.0), (40, 150.0), (91, 100.0), (133, 50.0)];
            let moving: Vec<Peak> = walls.iter().map(|(column, votes)| peak(*column, *votes)).collect();
            let fixed: Vec<Peak> = walls.iter().map(|(column, votes)| peak((column + turn) % 180, *votes)).collect();
            let psi = psi_hat(&fixed, &moving, &HoughPeaksParams::default()).expect("associated");
            let error = psi.radians() - to_f64(turn).to_radians();
            prop_assert!(error.sin().abs() < 1e-9, "{} instead of {turn}", psi.degrees());
        }
    }

    #[test]
    fn the_mean_of_tangents_is_no_angle_near_ninety_degrees() {
        let params = HoughPeaksParams {
            psi_hat: PsiHat::MeanOfTangents,
            ..HoughPeaksParams::default()
        };
        // a rotation of -5 degrees, seen by a wall at 0 degrees: about right, tan being about the angle there
        let small = psi_hat(&[peak(85, 100.0)], &[peak(90, 100.0)], &params).expect("associated");
        assert!((small.degrees() + 5.0).abs() < 0.1, "{}", small.degrees());
        // the same rotation, seen by a wall whose normal is near 90 degrees
        let large = psi_hat(&[peak(174, 100.0)], &[peak(179, 100.0)], &params).expect("associated");
        assert!((large.degrees() + 5.0).abs() > 30.0, "{}", large.degrees());
    }

    #[test]
    fn without_associations_there_is_no_psi_hat() {
        assert_eq!(
            psi_hat(&[peak(0, 100.0)], &[peak(0, 50.0)], &HoughPeaksParams::default()),
            None
        );
    }
}
