//! Fourier transforms of two-dimensional arrays: whole, with the rows that are all zero left out; or rows and columns
//! apart, for who works on columns while they are in the first cache. And sizes that are fast.
//!
//! Shapes and units: an array of `height` rows of `width`; its spectrum is kept TRANSPOSED (`width` rows of `height`), so
//! that each direction needs one transposition only. Unnormalised both ways: there and back multiplies by the cell count.
//! Cost: 5 N log2 N flops for N cells, and N complex numbers moved once through memory for the transposition.

use std::sync::{Arc, Mutex};

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

/// Twiddle factors, computed once a length.
pub(crate) struct Planner(Mutex<FftPlanner<f32>>);

/// A transform of one size; cheap to clone.
#[derive(Clone)]
pub(crate) struct Plan {
    pub(crate) width: usize,
    pub(crate) height: usize,
    rows: Arc<dyn Fft<f32>>,
    columns: Arc<dyn Fft<f32>>,
    rows_back: Arc<dyn Fft<f32>>,
    columns_back: Arc<dyn Fft<f32>>,
}

/// Real images of one size, packed as real and imaginary part.
pub(super) struct Packed<'a> {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) re: &'a [f32],
    pub(super) im: &'a [f32],
}

impl Planner {
    pub(crate) fn new() -> Self {
        Self(Mutex::new(FftPlanner::new()))
    }

    pub(crate) fn plan(&self, width: usize, height: usize) -> Plan {
        let mut planner = self.0.lock().expect("invariant: planning does not panic");
        Plan {
            width,
            height,
            rows: planner.plan_fft_forward(width),
            columns: planner.plan_fft_forward(height),
            rows_back: planner.plan_fft_inverse(width),
            columns_back: planner.plan_fft_inverse(height),
        }
    }
}

impl Plan {
    pub(crate) fn len(&self) -> usize {
        self.width * self.height
    }

    /// The transposed spectrum of `data`, of which only the first `used` rows are not zero. `data` is scratch afterwards.
    pub(crate) fn forward(&self, data: &mut [Complex32], used: usize, spectrum: &mut [Complex32]) {
        process(&*self.rows, &mut data[..used * self.width]);
        transpose(data, spectrum, self.width, self.height);
        process(&*self.columns, spectrum);
    }

    /// The array of a transposed spectrum, times the cell count. `spectrum` is scratch afterwards.
    pub(crate) fn inverse(&self, spectrum: &mut [Complex32], data: &mut [Complex32]) {
        process(&*self.columns_back, spectrum);
        transpose(spectrum, data, self.height, self.width);
        process(&*self.rows_back, data);
    }

    /// What every transform needs besides its data.
    pub(super) fn scratch_len(&self) -> usize {
        [&self.rows, &self.columns, &self.rows_back, &self.columns_back]
            .map(|fft| fft.get_inplace_scratch_len())
            .into_iter()
            .fold(0, usize::max)
    }

    /// The packed image as complex rows of the array's width, transformed; only the rows that it has.
    pub(super) fn transformed_rows(&self, image: &Packed, rows: &mut Vec<Complex32>, scratch: &mut [Complex32]) {
        rows.clear();
        rows.resize(image.height * self.width, Complex32::default());
        let images = image
            .re
            .chunks_exact(image.width)
            .zip(image.im.chunks_exact(image.width));
        for (row, (re, im)) in rows.chunks_exact_mut(self.width).zip(images) {
            for (out, (&re, &im)) in row.iter_mut().zip(re.iter().zip(im)) {
                *out = Complex32::new(re, im);
            }
            self.rows.process_with_scratch(row, scratch);
        }
    }

    pub(super) fn forward_columns(&self, columns: &mut [Complex32], scratch: &mut [Complex32]) {
        self.columns.process_with_scratch(columns, scratch);
    }

    pub(super) fn inverse_columns(&self, columns: &mut [Complex32], scratch: &mut [Complex32]) {
        self.columns_back.process_with_scratch(columns, scratch);
    }

    pub(super) fn inverse_rows(&self, rows: &mut [Complex32], scratch: &mut [Complex32]) {
        self.rows_back.process_with_scratch(rows, scratch);
    }
}

fn process(fft: &dyn Fft<f32>, rows: &mut [Complex32]) {
    let mut scratch = vec![Complex32::default(); fft.get_inplace_scratch_len()];
    fft.process_with_scratch(rows, &mut scratch);
}

/// `to[x][y] = from[y][x]` in blocks that fit the first cache.
fn transpose(from: &[Complex32], to: &mut [Complex32], width: usize, height: usize) {
    const BLOCK: usize = 16;
    for x0 in (0..width).step_by(BLOCK) {
        let x1 = (x0 + BLOCK).min(width);
        for y0 in (0..height).step_by(BLOCK) {
            let y1 = (y0 + BLOCK).min(height);
            for x in x0..x1 {
                for (y, out) in (y0..y1).zip(&mut to[x * height + y0..x * height + y1]) {
                    *out = from[y * width + x];
                }
            }
        }
    }
}

/// The least 2^a 3^b 5^c at or above `least`, with few factors of 5.
pub(crate) fn good_length(least: usize) -> usize {
    let mut best = usize::MAX;
    for five in [1, 5, 25] {
        for three in [1, 3, 9, 27] {
            let mut length = five * three;
            while length < least {
                length *= 2;
            }
            best = best.min(length);
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
        fn the_skipping_transform_equals_the_sum_of_its_definition(values in proptest::collection::vec(-1.0_f32..1.0, 24)) {
            let plan = Planner::new().plan(6, 8);
            let mut data = vec![Complex32::default(); 48];
            for (cell, pair) in data.iter_mut().zip(values.chunks_exact(2)) {
                *cell = Complex32::new(pair[0], pair[1]);
            }
            let original = data.clone();
            let mut spectrum = vec![Complex32::default(); 48];
            plan.forward(&mut data, 2, &mut spectrum);
            for kx in 0..6_usize {
                for ky in 0..8_usize {
                    let mut sum = Complex32::default();
                    for y in 0..8_usize {
                        for x in 0..6_usize {
                            let turns = super::super::num::real(kx * x) / 6.0 + super::super::num::real(ky * y) / 8.0;
                            sum += original[y * 6 + x] * Complex32::from_polar(1.0, -std::f32::consts::TAU * turns);
                        }
                    }
                    prop_assert!((sum - spectrum[kx * 8 + ky]).norm() < 1e-4);
                }
            }
            let mut back = vec![Complex32::default(); 48];
            plan.inverse(&mut spectrum, &mut back);
            for (a, b) in back.iter().zip(&original) {
                prop_assert!((a / 48.0 - b).norm() < 1e-5);
            }
        }
    }

    #[test]
    fn good_lengths_are_short_products_of_small_primes() {
        assert_eq!([1, 7, 97, 241, 577].map(good_length), [1, 8, 100, 256, 600]);
        for least in 1..2000 {
            let length = good_length(least);
            assert!(length >= least && length <= least + least / 4 + 2);
        }
    }
}
