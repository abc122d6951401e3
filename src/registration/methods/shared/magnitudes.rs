//! Rotation by a one-dimensional phase correlation of the Hough images, and what of them no motion changes.
//!
//! **Method.** A translation shifts each column of a Hough image (Property 1), which changes the phases of its Fourier
//! transform along rho and not the magnitudes.
//!
//! 1. `A(theta, f) = |sum over rho of H(theta, rho) exp(-2 pi i f rho)|`, so that a map which is rotated by psi and moved has
//!    `A'(theta, f) = A(theta - psi, f)`.
//! 2. For each frequency f the transforms along theta, `B(u, f)`, and their cross power of magnitude 1,
//!    `Q(u, f) = B_fixed conj(B_moving) / |B_fixed conj(B_moving)|`.
//! 3. `q(psi) = sum over f and u of Q(u, f) exp(2 pi i u psi / 180)`; its maxima are the candidate rotations.
//!
//! Frequency 0 is left out: every column has all the cells. So is u = 0, which says nothing of psi.
//!
//! **Cost.** 180 transforms of a column's length a map; two of 180 points for each frequency of a pair.

use rayon::prelude::*;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

use crate::geometry::Angle;
use crate::registration::methods::shared::correlation::{circular_maxima, circular_offset, rotation_of};
use crate::registration::methods::shared::hough_image::{COLUMNS, HoughImage, to_f64};

/// A(theta, f) of one map at the frequencies `k / length`, k = 1, 2, ..., up to the highest that is used.
#[derive(Debug, Clone)]
pub(crate) struct Magnitudes {
    /// Cells of the transforms, a power of two.
    length: usize,
    /// A row a frequency, from k = 1 on; 180 columns each.
    rows: Vec<Vec<f64>>,
}

impl Magnitudes {
    pub(crate) fn new(image: &HoughImage, frequency_max: f64) -> Self {
        Self::of_length(image, frequency_max, image.bins().next_power_of_two())
    }

    /// With transforms of this length, a power of two and no shorter than the columns: those of several images then have the
    /// same frequencies.
    pub(crate) fn of_length(image: &HoughImage, frequency_max: f64, length: usize) -> Self {
        debug_assert!(length.is_power_of_two() && length >= image.bins());
        let fft = FftPlanner::new().plan_fft_forward(length);
        let columns: Vec<&[u32]> = image.columns().collect();
        let spectra: Vec<Vec<f64>> = columns
            .into_par_iter()
            .map(|column| {
                let mut data: Vec<Complex64> = column.iter().map(|votes| Complex64::from(f64::from(*votes))).collect();
                data.resize(length, Complex64::default());
                fft.process(&mut data);
                data.iter().map(|value| value.norm()).collect()
            })
            .collect();
        let rows = (1..=length / 2)
            .take_while(|k| to_f64(*k) <= frequency_max * to_f64(length))
            .map(|k| spectra.iter().map(|spectrum| spectrum[k]).collect())
            .collect();
        Self { length, rows }
    }

    /// The magnitudes of the transforms along theta too, at `u = 1..=harmonics` for each frequency, each frequency's of length 1:
    /// what no motion of the map changes.
    pub(crate) fn invariants(&self, harmonics: usize) -> Vec<f32> {
        let fft = FftPlanner::new().plan_fft_forward(COLUMNS);
        let mut out = Vec::with_capacity(self.rows.len() * harmonics);
        for row in &self.rows {
            let mut data: Vec<Complex64> = row.iter().copied().map(Complex64::from).collect();
            fft.process(&mut data);
            let magnitudes: Vec<f64> = data[1..=harmonics].iter().map(|value| value.norm()).collect();
            let length = magnitudes.iter().map(|value| value * value).sum::<f64>().sqrt();
            out.extend(
                magnitudes
                    .iter()
                    .map(|value| if length > 0.0 { narrow(value / length) } else { 0.0 }),
            );
        }
        out
    }

    /// The row of the frequency `k / length`, whose length may be shorter than that of these rows.
    fn at(&self, k: usize, length: usize) -> Option<&[f64]> {
        self.rows.get(k * (self.length / length) - 1).map(Vec::as_slice)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "within [0, 1]")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// The candidate rotations of the moving map in (-90, 90] degrees, the best first.
pub(crate) fn rotations(fixed: &Magnitudes, moving: &Magnitudes, apart: f64, most: usize) -> Vec<Angle> {
    let length = fixed.length.min(moving.length);
    let mut planner = FftPlanner::new();
    let (forward, inverse) = (planner.plan_fft_forward(COLUMNS), planner.plan_fft_inverse(COLUMNS));
    let mut sum = vec![Complex64::default(); COLUMNS];
    for k in 1.. {
        let (Some(one), Some(other)) = (fixed.at(k, length), moving.at(k, length)) else {
            break;
        };
        let [one, other] = [one, other].map(|row| {
            let mut data: Vec<Complex64> = row.iter().copied().map(Complex64::from).collect();
            forward.process(&mut data);
            data
        });
        for ((sum, a), b) in sum.iter_mut().zip(&one).zip(&other).skip(1) {
            let cross = a * b.conj();
            let norm = cross.norm();
            if norm > 0.0 {
                *sum += cross / norm;
            }
        }
    }
    inverse.process(&mut sum);
    let correlation: Vec<f64> = sum.iter().map(|value| value.re).collect();
    circular_maxima(&correlation, apart, most)
        .into_iter()
        .map(|at| rotation_of(to_f64(at) + circular_offset(&correlation, at)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Point, Pose2};
    use crate::registration::methods::shared::hough_image::{Directions, WallPoints};
    use proptest::prelude::*;

    fn walls() -> Vec<Point> {
        let mut points = Vec::new();
        for i in 0..150_u32 {
            let s = f64::from(i);
            points.push([s, 0.3]);
            points.push([s, 61.3]);
            if i < 90 {
                points.push([0.2, s]);
            }
            if i < 70 {
                points.push([20.0 + s * 0.6, 10.0 + s * 0.8]);
            }
        }
        points
    }

    fn magnitudes(points: &[Point]) -> Magnitudes {
        let directions = Directions::half_turn_of_rotated(Angle::ZERO);
        Magnitudes::new(&HoughImage::new(&WallPoints::about_center(points), directions, 1), 0.1)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn the_rotation_of_a_moved_map_is_found_up_to_half_turns(turn in -180.0..180.0_f64, x in -90.0..90.0_f64,
                                                                 y in -90.0..90.0_f64) {
            let pose = Pose2::new(x, y, Angle::from_degrees(turn));
            let moved: Vec<Point> = walls().iter().map(|p| pose.inverse().apply(*p)).collect();
            let found = rotations(&magnitudes(&walls()), &magnitudes(&moved), 6.0, 1)[0];
            let error = found.radians() - turn.to_radians();
            prop_assert!(error.sin().abs() < 1.0_f64.to_radians(), "{} instead of {turn}", found.degrees());
        }
    }

    #[test]
    fn no_motion_changes_the_invariants() {
        let pose = Pose2::new(40.0, -70.0, Angle::from_degrees(53.0));
        let moved: Vec<Point> = walls().iter().map(|p| pose.apply(*p)).collect();
        let other: Vec<Point> = walls().iter().filter(|p| p[1] > 20.0).copied().collect();
        let directions = Directions::half_turn_of_rotated(Angle::ZERO);
        let of = |points: &[Point]| {
            let image = HoughImage::new(&WallPoints::about_center(points), directions, 1);
            Magnitudes::of_length(&image, 0.05, 512).invariants(16)
        };
        let alike = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        let (here, there, elsewhere) = (of(&walls()), of(&moved), of(&other));
        let most = alike(&here, &here);
        assert!(alike(&here, &there) > 0.95 * most);
        assert!(alike(&here, &elsewhere) < alike(&here, &there));
    }

    #[test]
    fn maps_of_different_sizes_are_compared_at_the_frequencies_that_both_have() {
        let mut large = walls();
        large.extend((0..40_u32).map(|i| [400.0 + f64::from(i), 300.0]));
        let (small, large) = (magnitudes(&walls()), magnitudes(&large));
        assert!(small.length < large.length);
        let found = rotations(&small, &large, 6.0, 1)[0];
        assert!(found.magnitude() < 1.5_f64.to_radians(), "{}", found.degrees());
    }
}
