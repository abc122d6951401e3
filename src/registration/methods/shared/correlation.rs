//! Correlations of two signals over all their shifts, and where they are greatest.
//!
//! **Convention.** A shift moves the second signal: `C(k) = sum over t of first(t) second(t - k)`.
//!
//! **Cost.** Circular ones by their definition, over the 180 directions of a spectrum; linear ones by Fourier transforms.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

use super::hough_image::{COLUMNS, to_f64};
use crate::geometry::Angle;

/// `C(k) = sum over t of first(t) second(t - k)`, means removed, indices modulo the length (eq. 24).
pub(crate) fn circular_correlation(first: &[f64], second: &[f64]) -> Vec<f64> {
    let n = first.len();
    let (first, second) = (centered(first), centered(second));
    (0..n)
        .map(|k| (0..n).map(|t| first[t] * second[(t + n - k) % n]).sum())
        .collect()
}

fn centered(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / to_f64(values.len());
    values.iter().map(|value| value - mean).collect()
}

/// The local maxima above 0 of a circular correlation, the greatest first, at least `apart` from each other.
pub(crate) fn circular_maxima(correlation: &[f64], apart: f64, most: usize) -> Vec<usize> {
    let n = correlation.len();
    let mut order: Vec<usize> = (0..n).filter(|k| correlation[*k] > 0.0).collect();
    order.sort_by(|a, b| correlation[*b].total_cmp(&correlation[*a])); // stable: of equal ones the smaller shift
    let mut kept: Vec<usize> = Vec::new();
    for k in order {
        let around = [correlation[(k + 1) % n], correlation[(k + n - 1) % n]];
        let is_maximum = around.iter().all(|other| *other <= correlation[k]);
        let far = |other: &usize| {
            let difference = k.abs_diff(*other);
            to_f64(difference.min(n - difference)) >= apart
        };
        if is_maximum && kept.iter().all(far) {
            kept.push(k);
        }
    }
    kept.truncate(most);
    kept
}

/// The rotation in (-90, 90] degrees that a shift by so many columns of a Hough image means; columns may be in part.
pub(crate) fn rotation_of(columns: f64) -> Angle {
    let half_turn = to_f64(COLUMNS);
    let folded = columns.rem_euclid(half_turn);
    Angle::from_degrees(if folded <= half_turn / 2.0 {
        folded
    } else {
        folded - half_turn
    })
}

/// Where between its neighbours on a circle a maximum lies, in (-0.5, 0.5) steps.
pub(crate) fn circular_offset(values: &[f64], at: usize) -> f64 {
    let n = values.len();
    parabola_offset(&[values[(at + n - 1) % n], values[at], values[(at + 1) % n]], 1)
}

/// Where between its neighbours a maximum lies, in (-0.5, 0.5) steps.
pub(crate) fn parabola_offset(values: &[f64], at: usize) -> f64 {
    if at == 0 || at + 1 == values.len() {
        return 0.0;
    }
    let (left, middle, right) = (values[at - 1], values[at], values[at + 1]);
    let curvature = left - 2.0 * middle + right;
    if curvature < 0.0 {
        0.5 * (left - right) / curvature
    } else {
        0.0
    }
}

/// `C(k) = sum over t of first(t) second(t - k)` for every shift at which the signals meet: the value at index i belongs to
/// `k = i - (second.len() - 1)`. Neither may be empty.
pub(crate) fn linear_correlation(first: &[f64], second: &[f64]) -> Vec<f64> {
    let shifts = first.len() + second.len() - 1;
    let length = shifts.next_power_of_two();
    let mut planner = FftPlanner::new();
    let forward = planner.plan_fft_forward(length);
    let spectrum = |values: &mut dyn Iterator<Item = f64>| {
        let mut data: Vec<Complex64> = values.map(Complex64::from).collect();
        data.resize(length, Complex64::default());
        forward.process(&mut data);
        data
    };
    // a signal read backwards turns the convolution into the correlation
    let one = spectrum(&mut first.iter().copied());
    let other = spectrum(&mut second.iter().rev().copied());
    let mut product: Vec<Complex64> = one.iter().zip(&other).map(|(a, b)| a * b).collect();
    planner.plan_fft_inverse(length).process(&mut product);
    product[..shifts]
        .iter()
        .map(|value| value.re / to_f64(length))
        .collect()
}

/// The index of the greatest value; of equal ones the first.
pub(crate) fn greatest(values: &[f64]) -> usize {
    let mut best = 0;
    for (index, value) in values.iter().enumerate() {
        if *value > values[best] {
            best = index;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_linear_correlation_is_the_sum_of_its_definition(first in prop::collection::vec(-9.0..9.0_f64, 1..40),
                                                               second in prop::collection::vec(-9.0..9.0_f64, 1..30)) {
            let fast = linear_correlation(&first, &second);
            prop_assert_eq!(fast.len(), first.len() + second.len() - 1);
            for (i, value) in fast.iter().enumerate() {
                let slow: f64 = (0..first.len())
                    .filter_map(|t| Some(first[t] * second.get((t + second.len() - 1).checked_sub(i)?)?))
                    .sum();
                prop_assert!((value - slow).abs() < 1e-9);
            }
        }

        #[test]
        fn a_circular_correlation_is_greatest_at_the_shift(shift in 0_usize..180) {
            let first: Vec<f64> = (0..180_u32).map(|t| f64::from((t * t * 7 + 3 * t) % 101)).collect();
            let second: Vec<f64> = (0..180).map(|t| first[(t + shift) % 180]).collect();
            let correlation = circular_correlation(&first, &second);
            prop_assert_eq!(circular_maxima(&correlation, 6.0, 4)[0], shift);
            let turn = rotation_of(to_f64(shift)).degrees();
            prop_assert!(turn > -90.0 && turn <= 90.0 && ((turn - to_f64(shift)) / 180.0).fract().abs() < 1e-9);
        }
    }

    #[test]
    fn maxima_lie_apart_and_the_greatest_comes_first() {
        let mut values = vec![0.0; 180];
        for (at, value) in [(0, 5.0), (3, 4.0), (179, 4.5), (90, 4.2), (40, -1.0)] {
            values[at] = value;
        }
        assert_eq!(circular_maxima(&values, 6.0, 4), [0, 90]);
        assert_eq!(circular_maxima(&values, 2.0, 4), [0, 90, 3]);
        assert_eq!(circular_maxima(&values, 2.0, 1), [0]);
        assert_eq!(circular_maxima(&[0.0; 9], 2.0, 4), Vec::<usize>::new());
    }

    #[test]
    fn the_parabola_lies_between_the_neighbours() {
        assert!((parabola_offset(&[1.0, 2.0, 1.0], 1)).abs() < 1e-12);
        assert!(parabola_offset(&[1.0, 2.0, 1.9], 1) > 0.3);
        assert!((parabola_offset(&[3.0, 2.0, 1.0], 0)).abs() < 1e-12);
        assert!(circular_offset(&[3.0, 1.0, 2.9], 0) < -0.3);
    }
}
