//! Correlation of two pictures over all their shifts, by Fourier transforms.
//!
//! **Convention.** A shift moves the second picture: `C(s) = sum over cells of first(p) second(p - s)`.
//!
//! **Method.** Both pictures are real: one forward transform of `first + i second` holds both spectra,
//! `F = (P(k) + conj P(-k)) / 2` and `S = (P(k) - conj P(-k)) / 2i`; the inverse transform of `F conj S` is C, that of
//! `F conj S / |F conj S|` the phase correlation. Padded so that no shift wraps onto another.
//!
//! **Cost.** Two transforms of 5 N log2 N flops, N the padded number of cells.

use rustfft::num_complex::Complex32;
use serde::{Deserialize, Serialize};

use super::correlation::parabola_offset;
use super::hough_image::to_f64;
use crate::geometry::Point;
use crate::registration::methods::hough::fft::{Planner, good_length};

/// What becomes of the cross power spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FourierCorrelation {
    /// It stays as it is: the plain correlation, the convolution with the mirrored picture.
    #[default]
    Cross,
    /// Its magnitudes are set to 1: the phase correlation.
    Phase,
}

/// A picture of square cells, row by row from the lowest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plane {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Lower-left corner of cell (0, 0), in cells.
    pub(crate) corner: Point,
    pub(crate) values: Vec<f32>,
}

impl Plane {
    /// 1 in every cell with a point and 0 elsewhere; `points` in cells. One cell of 0 when there are none.
    pub(crate) fn of_points(points: &[Point]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            for k in 0..2 {
                low[k] = low[k].min(point[k].floor());
                high[k] = high[k].max(point[k].floor());
            }
        }
        if points.is_empty() {
            (low, high) = ([0.0; 2], [0.0; 2]);
        }
        let [width, height] = [0, 1].map(|k| whole(high[k] - low[k]) + 1);
        let mut values = vec![0.0; width * height];
        for point in points {
            let [column, row] = [0, 1].map(|k| whole(point[k].floor() - low[k]));
            values[row * width + column] = 1.0;
        }
        Self {
            width,
            height,
            corner: low,
            values,
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "not negative, and at most a map's diagonal in cells"
)]
fn whole(cells: f64) -> usize {
    cells as usize
}

/// A shift that may be right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shift {
    /// What to add to the second picture's coordinates, in cells, read between the cells by parabolas.
    pub(crate) by: Point,
    /// The correlation there, in cells for the plain one.
    pub(crate) value: f64,
}

/// The greatest local maxima of the correlation, the greatest first, at least `apart` cells from each other on an axis.
pub(crate) fn best_shifts(
    planner: &Planner,
    first: &Plane,
    second: &Plane,
    how: FourierCorrelation,
    (most, apart): (usize, usize),
) -> Vec<Shift> {
    let (width, height) = (
        good_length((first.width + second.width - 1).max(2)),
        good_length((first.height + second.height - 1).max(2)),
    );
    let surface = correlation(planner, first, second, how, (width, height));
    let mut best: Vec<(f32, usize)> = Vec::with_capacity(most + 1);
    for (index, cell) in surface.iter().enumerate() {
        let enough = best.len() < most || best.last().is_some_and(|(least, _)| cell.re > *least);
        if enough && is_maximum(&surface, (width, height), index, apart.max(1)) {
            let place = best.partition_point(|(other, _)| *other >= cell.re); // of equal ones the first stays first
            best.insert(place, (cell.re, index));
            best.truncate(most);
        }
    }
    let shift = |(value, index): (f32, usize)| {
        let (column, row) = (index % width, index / width);
        let at = |column: usize, row: usize| f64::from(surface[row % height * width + column % width].re);
        let offset_x = parabola_offset(&[at(column + width - 1, row), at(column, row), at(column + 1, row)], 1);
        let offset_y = parabola_offset(&[at(column, row + height - 1), at(column, row), at(column, row + 1)], 1);
        // shifts below 0 stand at the end
        let signed = |at: usize, size: usize, used: usize| {
            if at >= used {
                to_f64(at) - to_f64(size)
            } else {
                to_f64(at)
            }
        };
        let (x, y) = (signed(column, width, first.width), signed(row, height, first.height));
        Shift {
            by: [
                x + offset_x + first.corner[0] - second.corner[0],
                y + offset_y + first.corner[1] - second.corner[1],
            ],
            value: f64::from(value),
        }
    };
    best.into_iter().map(shift).collect()
}

/// C over all shifts, in the real parts.
fn correlation(
    planner: &Planner,
    first: &Plane,
    second: &Plane,
    how: FourierCorrelation,
    (width, height): (usize, usize),
) -> Vec<Complex32> {
    let plan = planner.plan(width, height);
    let mut data = vec![Complex32::default(); width * height];
    for (row, values) in first.values.chunks(first.width).enumerate() {
        for (cell, value) in data[row * width..].iter_mut().zip(values) {
            cell.re = *value;
        }
    }
    for (row, values) in second.values.chunks(second.width).enumerate() {
        for (cell, value) in data[row * width..].iter_mut().zip(values) {
            cell.im = *value;
        }
    }
    let mut spectrum = vec![Complex32::default(); width * height];
    plan.forward(&mut data, first.height.max(second.height), &mut spectrum);
    let mut product = vec![Complex32::default(); width * height];
    for kx in 0..width {
        let mirror = (width - kx) % width * height;
        for ky in 0..height {
            let (p, q) = (
                spectrum[kx * height + ky],
                spectrum[mirror + (height - ky) % height].conj(),
            );
            let (f, s) = ((p + q) * 0.5, Complex32::new(0.5 * (p.im - q.im), -0.5 * (p.re - q.re)));
            product[kx * height + ky] = f * s.conj();
        }
    }
    let cells = to_f32(width * height);
    match how {
        FourierCorrelation::Cross => product.iter_mut().for_each(|value| *value /= cells),
        FourierCorrelation::Phase => {
            // what is below single precision's noise has no phase
            let least = product.iter().map(|value| value.norm()).fold(0.0, f32::max) * 1e-6;
            for value in &mut product {
                let norm = value.norm();
                *value = if norm > least {
                    *value / (norm * cells)
                } else {
                    Complex32::default()
                };
            }
        }
    }
    plan.inverse(&mut product, &mut data);
    data
}

#[expect(clippy::cast_precision_loss, reason = "a factor")]
fn to_f32(count: usize) -> f32 {
    count as f32
}

/// Whether no cell within `apart` on both axes has more, and none before it as much. Shifts wrap around.
fn is_maximum(surface: &[Complex32], (width, height): (usize, usize), index: usize, apart: usize) -> bool {
    let (column, row) = (index % width, index / width);
    let (reach_x, reach_y) = (apart.min((width - 1) / 2), apart.min((height - 1) / 2));
    let value = surface[index].re;
    (0..=2 * reach_y).all(|dy| {
        let line = (row + height + dy - reach_y) % height * width;
        (0..=2 * reach_x).all(|dx| {
            let other = line + (column + width + dx - reach_x) % width;
            surface[other].re < value || other == index || (surface[other].re <= value && other > index)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(width: usize, height: usize, values: &[u8]) -> Plane {
        Plane {
            width,
            height,
            corner: [0.0, 0.0],
            values: values.iter().map(|value| f32::from(*value) / 16.0).collect(),
        }
    }

    proptest! {
        #[test]
        fn the_packed_transform_is_the_sum_of_its_definition(first in prop::collection::vec(0_u8..64, 7 * 5),
                                                             second in prop::collection::vec(0_u8..64, 4 * 6)) {
            let (first, second) = (plane(7, 5, &first), plane(4, 6, &second));
            let (width, height) = (10, 10);
            let fast = correlation(&Planner::new(), &first, &second, FourierCorrelation::Cross, (width, height));
            for sy in -5_isize..5 {
                for sx in -3_isize..7 {
                    let mut slow = 0.0;
                    for y in 0..5_isize {
                        for x in 0..7_isize {
                            let (i, j) = (x - sx, y - sy);
                            if (0..4).contains(&i) && (0..6).contains(&j) {
                                slow += first.values[(y * 7 + x) as usize] * second.values[(j * 4 + i) as usize];
                            }
                        }
                    }
                    let at = sy.rem_euclid(10) * 10 + sx.rem_euclid(10);
                    prop_assert!((fast[at as usize].re - slow).abs() < 1e-3 * (1.0 + slow), "at {sx}, {sy}");
                }
            }
        }

        #[test]
        fn both_correlations_find_a_picture_where_it_was_shifted_to(seed in 1_u32..1000, x in -70_i32..70, y in -50_i32..50) {
            let points: Vec<Point> = (0..60_u32)
                .map(|i| (i * 7919 + seed).wrapping_mul(2_654_435_761))
                .map(|hash| [f64::from(hash >> 26) + 0.3, f64::from((hash >> 12) % 40) + 0.6])
                .collect();
            let moved: Vec<Point> = points.iter().map(|p| [p[0] + f64::from(x), p[1] + f64::from(y)]).collect();
            let planner = Planner::new();
            for how in [FourierCorrelation::Cross, FourierCorrelation::Phase] {
                let (first, second) = (Plane::of_points(&moved), Plane::of_points(&points));
                let found = best_shifts(&planner, &first, &second, how, (3, 2));
                let [fx, fy] = found[0].by;
                prop_assert!((fx - f64::from(x)).abs() < 0.5 && (fy - f64::from(y)).abs() < 0.5, "{how:?}: {:?}", found[0]);
                prop_assert!(found.windows(2).all(|pair| pair[0].value >= pair[1].value));
            }
        }
    }

    #[test]
    fn no_points_are_an_empty_picture() {
        let nothing = Plane::of_points(&[]);
        assert_eq!((nothing.width, nothing.height, &nothing.values[..]), (1, 1, &[0.0][..]));
        let shifts = best_shifts(&Planner::new(), &nothing, &nothing, FourierCorrelation::Phase, (2, 1));
        assert!(shifts.iter().all(|shift| shift.value.abs() < 1e-6));
    }
}
