//! The signed correlation of two maps at all shifts and half turns at once, by Fourier transforms.
//!
//! Convention: a shift s puts the moving raster's cell i on the fixed raster's cell i + s; with half a turn, on s - i.
//! Method, D, E, G, H of the fixed raster and O, F of the moving one (see `translation` for what they are): (1)
//! A = corr(D, O) + corr(G, F) and B = corr(E, O) + corr(H, F). Packed: (2) O + iF are transformed along the rows
//! together, R; with R' = conj R(-kx), O = (R + R') / 2 and F = (R - R') / 2i are half-transformed each by itself, for the
//! non-negative kx only; (3) along the columns, A^ = conj(O^) D^ + conj(F^) G^, the same for B^; without the conjugations,
//! A and B of the map turned by half a turn more; (4) A^ + iB^ is the column kx of the packed answer A + iB, and
//! A^ - iB^, transformed back, the conjugate of its column -kx.
//! So one forward and two inverse transforms serve two rotations, and (3) and (4) happen column by column, in the first
//! cache.
//! Shapes and units: arrays of `height` rows of `width`, shifts modulo both.
//! Cost: of each array one pass along its rows and one along its columns, in strips that fill cache lines; 5 N log2 N
//! flops a transform of N cells, of which the forward one skips the rows that are all zero.

#![expect(clippy::many_single_char_names, reason = "the letters of the formulas")]

use rayon::prelude::*;
use rustfft::num_complex::Complex32;

use super::fft::{Packed, Plan};
use super::simd::widest;

/// Columns that are worked on together: as many as fill a cache line.
const STRIP: usize = 8;

/// The fixed map's part: D, E, G and H transformed, for each non-negative kx a column of each.
pub(super) struct Correlator {
    plan: Plan,
    still: Vec<Complex32>,
}

/// What one rotation needs while it is worked on; to be used again for the next.
#[derive(Default)]
pub(super) struct Scratch {
    rows: Vec<Complex32>,
    columns: Vec<Complex32>,
    back: Vec<Complex32>,
    inner: Vec<Complex32>,
    /// A + iB of the shifts.
    pub(super) straight: Vec<Complex32>,
    /// The same for the map turned by half a turn more.
    pub(super) half_turn: Vec<Complex32>,
}

impl Correlator {
    /// Of D + iE and G + iH. The answers are multiplied by `scale`.
    pub(super) fn new(plan: Plan, with_occupied: &Packed, with_free: &Packed) -> Self {
        let (width, height) = (plan.width, plan.height);
        let fresh = || vec![Complex32::default(); plan.scratch_len()];
        let rows_of = |image| {
            let mut rows = Vec::new();
            plan.transformed_rows(image, &mut rows, &mut fresh());
            rows
        };
        let (occupied, free) = rayon::join(|| rows_of(with_occupied), || rows_of(with_free));
        // The transforms back lack this factor.
        let scale = 1.0 / super::num::real(plan.len());
        let mut still = vec![Complex32::default(); 4 * height * (width / 2 + 1)];
        still
            .par_chunks_exact_mut(4 * height)
            .enumerate()
            .with_min_len(STRIP)
            .for_each_init(fresh, |inner, (kx, columns)| {
                for (rows, columns) in [&occupied, &free].into_iter().zip(columns.chunks_exact_mut(2 * height)) {
                    unpack(rows, width, kx, columns, height);
                    plan.forward_columns(columns, inner);
                }
                for value in columns {
                    *value *= scale;
                }
            });
        Self { plan, still }
    }

    pub(super) fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Equation (1) for O + iF, still to be transformed along the rows by [`Plan::inverse_rows`].
    pub(super) fn correlate(&self, turned: &Packed, scratch: &mut Scratch) {
        let (width, height) = (self.plan.width, self.plan.height);
        let Scratch {
            rows,
            columns,
            back,
            inner,
            straight,
            half_turn,
        } = scratch;
        inner.resize(self.plan.scratch_len(), Complex32::default());
        self.plan.transformed_rows(turned, rows, inner);
        columns.resize(2 * height, Complex32::default());
        back.resize(4 * height * STRIP, Complex32::default());
        straight.resize(self.plan.len(), Complex32::default());
        half_turn.resize(self.plan.len(), Complex32::default());
        for first in (0..=width / 2).step_by(STRIP) {
            let strip = first..(first + STRIP).min(width / 2 + 1);
            for (kx, back) in strip.clone().zip(back.chunks_exact_mut(4 * height)) {
                unpack(rows, width, kx, columns, height);
                self.plan.forward_columns(columns, inner);
                combine(columns, &self.still[4 * height * kx..][..4 * height], back, height);
                self.plan.inverse_columns(back, inner);
            }
            store(back, straight, 0, strip.clone(), self.plan.width, height);
            store(back, half_turn, 2 * height, strip, self.plan.width, height);
        }
    }
}

/// Equation (2): column kx of the real image, then of the imaginary one; zeros below the rows that there are.
fn unpack(rows: &[Complex32], width: usize, kx: usize, columns: &mut [Complex32], height: usize) {
    let mirror = (width - kx) % width;
    let used = rows.len() / width;
    let (real, imaginary) = columns.split_at_mut(height);
    let images = real.iter_mut().zip(imaginary.iter_mut());
    for (row, (real, imaginary)) in rows.chunks_exact(width).zip(images) {
        let (here, there) = (row[kx], row[mirror]);
        *real = Complex32::new(0.5 * (here.re + there.re), 0.5 * (here.im - there.im));
        *imaginary = Complex32::new(0.5 * (here.im + there.im), 0.5 * (there.re - here.re));
    }
    real[used..].fill(Complex32::default());
    imaginary[used..].fill(Complex32::default());
}

widest! {
    /// Equation (3) and the sums of (4): columns kx and conj -kx, then both for the half turn.
    fn combine(turned: &[Complex32], still: &[Complex32], out: &mut [Complex32], height: usize) {
        let (o, f) = turned.split_at(height);
        let (with_occupied, with_free) = still.split_at(2 * height);
        let (d, e) = with_occupied.split_at(height);
        let (g, h) = with_free.split_at(height);
        let (straight, half_turn) = out.split_at_mut(2 * height);
        let (plus, minus) = straight.split_at_mut(height);
        let (plus_half, minus_half) = half_turn.split_at_mut(height);
        let (o, f, d, e, g, h) = (&o[..height], &f[..height], &d[..height], &e[..height], &g[..height], &h[..height]);
        for y in 0..height {
            let ((a, a_half), (b, b_half)) = (both(o[y], d[y], f[y], g[y]), both(o[y], e[y], f[y], h[y]));
            plus[y] = Complex32::new(a.re - b.im, a.im + b.re);
            minus[y] = Complex32::new(a.re + b.im, a.im - b.re);
            plus_half[y] = Complex32::new(a_half.re - b_half.im, a_half.im + b_half.re);
            minus_half[y] = Complex32::new(a_half.re + b_half.im, a_half.im - b_half.re);
        }
    }
}

/// conj(o) d + conj(f) g, and o d + f g.
#[inline]
fn both(o: Complex32, d: Complex32, f: Complex32, g: Complex32) -> (Complex32, Complex32) {
    let (re_re, im_im) = (o.re * d.re + f.re * g.re, o.im * d.im + f.im * g.im);
    let (re_im, im_re) = (o.re * d.im + f.re * g.im, o.im * d.re + f.im * g.re);
    (
        Complex32::new(re_re + im_im, re_im - im_re),
        Complex32::new(re_re - im_im, re_im + im_re),
    )
}

/// Puts columns of a strip, and the conjugate of their mirrored ones, in their places.
fn store(
    back: &[Complex32],
    to: &mut [Complex32],
    offset: usize,
    strip: std::ops::Range<usize>,
    width: usize,
    height: usize,
) {
    if strip.start > 0 && strip.len() == STRIP && 2 * strip.end <= width {
        return store_whole(back, to, offset, strip.start, width, height);
    }
    for (kx, column) in strip.zip(back.chunks_exact(4 * height)) {
        let (plus, minus) = column[offset..][..2 * height].split_at(height);
        for ((row, plus), minus) in to.chunks_exact_mut(width).zip(plus).zip(minus) {
            // first the mirror, so that where both are one column the answer is not a conjugate
            row[(width - kx) % width] = minus.conj();
            row[kx] = *plus;
        }
    }
}

/// A whole strip from `first` on, none of whose columns is its own mirror: cache line by cache line.
fn store_whole(back: &[Complex32], to: &mut [Complex32], offset: usize, first: usize, width: usize, height: usize) {
    let column = |c: usize, part: usize| &back[4 * height * c + offset + part * height..][..height];
    let plus: [&[Complex32]; STRIP] = std::array::from_fn(|c| column(c, 0));
    let minus: [&[Complex32]; STRIP] = std::array::from_fn(|c| column(c, 1));
    for (y, row) in to.chunks_exact_mut(width).enumerate().take(height) {
        let here: &mut [Complex32; STRIP] = row[first..].first_chunk_mut().expect("invariant: a whole strip");
        for c in 0..STRIP {
            here[c] = plus[c][y];
        }
        let mirrored = width - first - (STRIP - 1);
        let there: &mut [Complex32; STRIP] = row[mirrored..].first_chunk_mut().expect("invariant: a whole strip");
        for c in 0..STRIP {
            there[STRIP - 1 - c] = minus[c][y].conj();
        }
    }
}
