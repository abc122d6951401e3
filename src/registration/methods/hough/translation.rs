//! Translation candidates: the signed correlation of all shifts at once.
//!
//! Convention: the moving map is turned first; a shift s of its raster puts its cell i on the fixed map's cell i + s.
//! Method, sums over all cells (f fixed, m moving, see `raster` for O and F, `spread` for Od, `eroded` for Fe):
//! (1) agreement A(s) = sum Od_f(i + s) O_m(i) + mu sum F_f(i + s) F_m(i), mu = 0.05;
//! (2) disagreement B(s) = sum Fe_f(i + s) O_m(i) + sum O_f(i + s) F_m(i);
//! (3) S(s) = A - lambda B, for a lambda that trusts free space (2) and one that does not (0.5).
//! The best local maxima (5 x 5 cells) of both lists over all rotations go on.
//! Packing: with X = FFT(Od_f + i Fe_f) and Y = FFT(mu F_f + i O_f) once, and P = FFT(O_m + i F_m) a rotation,
//! O_m^(k) = (P(k) + conj P(-k)) / 2 and F_m^(k) = (P(k) - conj P(-k)) / 2i, the inverse transform of
//! conj(O_m^) X + conj(F_m^) Y is A + i B; without the conjugations it is that of the map turned by half a turn more. So
//! one forward and two inverse transforms serve two rotations.
//! Cost: (2 + 3 R) transforms for R rotations modulo pi: nearly all of the time of a search.
//! Differences from the paper: by the projection-slice theorem the correlation of two Hough columns (paper eq. 23-27) is
//! a projection of A without the free space. The free space is what tells the right shift from the others: at low
//! overlap the truth is among the best 30 in .09 of pairs for lambda = 0, in .91 for lambda = 2.

#![expect(
    clippy::many_single_char_names,
    clippy::doc_markdown,
    reason = "the letters of the formulas"
)]

use rayon::prelude::*;
use rustfft::num_complex::Complex32;

use super::features::Features;
use super::fft::{Plan, Planner, good_length};
use super::num::{index, narrow, real, signed};
use super::params::HoughParameters;
use super::placement::Placement;
use super::raster::{Raster, bounds};

const MU: f32 = 0.05;
const LEAST_COMMON_M: f32 = 2.0;

/// A shift that may be right.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shift {
    pub(super) placement: Placement,
    /// S for each lambda of the parameters.
    pub(super) scores: [f32; 2],
}

/// The best shifts over all rotations (each modulo pi, and its half turn), at most `lists` of each lambda, no one twice.
pub(super) fn shifts(
    planner: &Planner,
    fixed: &Features,
    moving: &Features,
    rotations: &[f64],
    parameters: &HoughParameters,
) -> Vec<Shift> {
    let cell = narrow(HoughParameters::coarse_cell(fixed, moving));
    let still = Raster::new(fixed, 0.0, cell);
    let (mut width, mut height) = (0, 0);
    for &rotation in rotations {
        let (_, w, h) = bounds(moving, rotation, cell);
        (width, height) = (width.max(w), height.max(h));
    }
    // Shifts that leave less than LEAST_COMMON_M in common on an axis may wrap onto each other: they are worth nothing.
    let spare = index(LEAST_COMMON_M / cell);
    let length =
        |fixed: usize, moving: usize| good_length((fixed + moving - 1 - spare.min(fixed.min(moving) - 1)).max(2));
    let plan = planner.plan(length(still.width, width), length(still.height, height));
    let (x, y) = fixed_spectra(&plan, &still);
    let lists: Vec<Vec<Shift>> = rotations
        .par_iter()
        .map(|&rotation| {
            let turned = Raster::new(moving, rotation, cell);
            of_rotation(&plan, &still, &turned, [&x, &y], rotation, cell, parameters)
        })
        .collect();
    let all: Vec<Shift> = lists.into_iter().flatten().collect();
    best_of_both(&all, parameters.kept_shifts)
}

fn fixed_spectra(plan: &Plan, still: &Raster) -> (Vec<Complex32>, Vec<Complex32>) {
    // The factor makes up for the transforms' lack of one.
    let scale = 1.0 / real(plan.len());
    let (spread, eroded) = (still.spread(), still.eroded());
    let pack = |re: &[f32], im: &[f32], by: f32| {
        let mut data = vec![Complex32::default(); plan.len()];
        for (j, row) in data.chunks_exact_mut(plan.width).take(still.height).enumerate() {
            let from = j * still.width;
            for ((out, re), im) in row.iter_mut().zip(&re[from..from + still.width]).zip(&im[from..]) {
                *out = Complex32::new(by * scale * re, scale * im);
            }
        }
        let mut spectrum = vec![Complex32::default(); plan.len()];
        plan.forward(&mut data, still.height, &mut spectrum);
        spectrum
    };
    rayon::join(
        || pack(&spread, &eroded, 1.0),
        || pack(&still.free, &still.occupied, MU),
    )
}

fn of_rotation(
    plan: &Plan,
    still: &Raster,
    turned: &Raster,
    [x, y]: [&[Complex32]; 2],
    rotation: f64,
    cell: f32,
    parameters: &HoughParameters,
) -> Vec<Shift> {
    let (width, height) = (plan.width, plan.height);
    let mut data = vec![Complex32::default(); plan.len()];
    for (j, row) in data.chunks_exact_mut(width).take(turned.height).enumerate() {
        let from = j * turned.width;
        let cells = turned.occupied[from..from + turned.width]
            .iter()
            .zip(&turned.free[from..]);
        for (out, (&occupied, &free)) in row.iter_mut().zip(cells) {
            *out = Complex32::new(occupied, free);
        }
    }
    let mut spectrum = vec![Complex32::default(); plan.len()];
    plan.forward(&mut data, turned.height, &mut spectrum);
    let mut half_turn = vec![Complex32::default(); plan.len()];
    multiply(&mut spectrum, &mut half_turn, x, y, height);
    let mut found = Vec::new();
    let list = parameters.shifts_per_rotation;
    // The raster's cell i lies at corner + (i + 0.5) cell; turned by half a turn, at -corner - (i + 0.5) cell.
    for (product, turn, sign) in [
        (&mut spectrum, 0.0, 1.0),
        (&mut half_turn, std::f64::consts::PI, -1.0_f32),
    ] {
        plan.inverse(product, &mut data);
        for peak in peaks(&data, width, height, parameters.lambdas, list) {
            let mut at = [peak.column, peak.row].map(|i| isize::try_from(i).expect("invariant: arrays are small"));
            if turn == 0.0 {
                // shifts run from -(moving - 1) to fixed - 1; the negative ones stand at the end
                for (i, (size, used)) in at.iter_mut().zip([(width, still.width), (height, still.height)]) {
                    if *i >= isize::try_from(used).expect("invariant: arrays are small") {
                        *i -= isize::try_from(size).expect("invariant: arrays are small");
                    }
                }
            }
            let [sx, sy] = at.map(signed);
            let extra = if turn == 0.0 { 0.0 } else { cell };
            found.push(Shift {
                placement: Placement {
                    x: f64::from(still.corner.0 - sign * turned.corner.0 + extra + sx * cell),
                    y: f64::from(still.corner.1 - sign * turned.corner.1 + extra + sy * cell),
                    yaw: rotation + turn,
                },
                scores: peak.scores,
            });
        }
    }
    found
}

/// Turns P (in `product`) into conj(O^) X + conj(F^) Y, and fills `half_turn` with O^ X + F^ Y.
fn multiply(product: &mut [Complex32], half_turn: &mut [Complex32], x: &[Complex32], y: &[Complex32], height: usize) {
    let width = product.len() / height;
    for kx in 0..=width / 2 {
        let mirror = (width - kx) % width;
        for ky in 0..height {
            let (a, b) = (kx * height + ky, mirror * height + (height - ky) % height);
            if kx == mirror && a > b {
                continue;
            }
            let (p, q) = (product[a], product[b].conj());
            let occupied = (p + q) * 0.5;
            let free = Complex32::new(0.5 * (p.im - q.im), -0.5 * (p.re - q.re));
            product[a] = occupied.conj() * x[a] + free.conj() * y[a];
            half_turn[a] = occupied * x[a] + free * y[a];
            // at -k the spectra of the real O and F are the conjugates
            product[b] = occupied * x[b] + free * y[b];
            half_turn[b] = occupied.conj() * x[b] + free.conj() * y[b];
        }
    }
}

struct Peak {
    column: usize,
    row: usize,
    scores: [f32; 2],
}

/// The best `list` local maxima of re - lambda im for each lambda.
fn peaks(data: &[Complex32], width: usize, height: usize, lambdas: [f32; 2], list: usize) -> Vec<Peak> {
    const CHUNK: usize = 16;
    let mut found = Vec::new();
    for lambda in lambdas {
        let score = |cell: Complex32| cell.re - lambda * cell.im;
        let mut best: Vec<(f32, usize)> = Vec::with_capacity(list + 1);
        let mut least = 1.0_f32; // a fifth of a metre of wall
        for (chunk, cells) in data.chunks(CHUNK).enumerate() {
            let top = cells.iter().map(|&cell| score(cell)).fold(f32::MIN, f32::max);
            if top <= least {
                continue;
            }
            for (offset, &cell) in cells.iter().enumerate() {
                let (value, index) = (score(cell), chunk * CHUNK + offset);
                if value > least && is_peak(data, width, height, index, value, score) {
                    let place = best.partition_point(|&(other, _)| other >= value);
                    best.insert(place, (value, index));
                    best.truncate(list);
                    if best.len() == list {
                        least = best[list - 1].0;
                    }
                }
            }
        }
        found.extend(best.into_iter().map(|(_, index)| Peak {
            column: index % width,
            row: index / width,
            scores: lambdas.map(|lambda| data[index].re - lambda * data[index].im),
        }));
    }
    found
}

/// Whether no cell within two has more, and none before it as much. Shifts wrap around.
fn is_peak(
    data: &[Complex32],
    width: usize,
    height: usize,
    index: usize,
    value: f32,
    score: impl Fn(Complex32) -> f32,
) -> bool {
    let (column, row) = (index % width, index / width);
    (0..5).all(|dy| {
        let line = (row + height + dy - 2) % height * width;
        (0..5).all(|dx| {
            let other = line + (column + width + dx - 2) % width;
            let rival = score(data[other]);
            rival < value || other == index || (rival <= value && other > index)
        })
    })
}

/// The best `kept[i]` by `scores[i]` for both i, in a fixed order, no shift twice.
fn best_of_both(all: &[Shift], kept: [usize; 2]) -> Vec<Shift> {
    let mut chosen = vec![false; all.len()];
    for (list, most) in kept.into_iter().enumerate() {
        let mut order: Vec<usize> = (0..all.len()).collect();
        order.sort_by(|&a, &b| all[b].scores[list].total_cmp(&all[a].scores[list]).then(a.cmp(&b)));
        let mut count = 0;
        let mut last: Option<Placement> = None;
        for index in order {
            // a shift that is in both lists of its rotation stands beside itself in the order
            if count == most {
                break;
            }
            if last == Some(all[index].placement) {
                continue;
            }
            last = Some(all[index].placement);
            chosen[index] = true;
            count += 1;
        }
    }
    let mut shifts: Vec<Shift> = Vec::new();
    for (shift, chosen) in all.iter().zip(chosen) {
        if chosen && !shifts.iter().any(|other| other.placement == shift.placement) {
            shifts.push(*shift);
        }
    }
    shifts
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn raster(width: usize, height: usize, values: &[u8]) -> Raster {
        let part = |value: &u8, low: u8| {
            if *value >= low && *value < low + 40 {
                f32::from(*value - low) / 40.0
            } else {
                0.0
            }
        };
        Raster {
            width,
            height,
            corner: (0.0, 0.0),
            occupied: values.iter().map(|value| part(value, 0)).collect(),
            free: values.iter().map(|value| part(value, 60)).collect(),
        }
    }

    /// A and B of equations (1) and (2) for one shift, by their definition; `sign` -1 turns the moving map by half a turn.
    fn direct(still: &Raster, turned: &Raster, (sx, sy): (isize, isize), sign: isize) -> (f32, f32) {
        let (spread, eroded) = (still.spread(), still.eroded());
        let (mut agreement, mut disagreement) = (0.0, 0.0);
        let int = |value: usize| isize::try_from(value).expect("small");
        for j in 0..turned.height {
            for i in 0..turned.width {
                let (x, y) = (sign * int(i) + sx, sign * int(j) + sy);
                let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else {
                    continue;
                };
                if x >= still.width || y >= still.height {
                    continue;
                }
                let (m, f) = (j * turned.width + i, y * still.width + x);
                agreement += spread[f] * turned.occupied[m] + MU * still.free[f] * turned.free[m];
                disagreement += eroded[f] * turned.occupied[m] + still.occupied[f] * turned.free[m];
            }
        }
        (agreement, disagreement)
    }

    proptest! {
        #[test]
        fn the_packed_transforms_equal_the_direct_sums(still in proptest::collection::vec(0_u8..120, 9 * 7),
                                                       turned in proptest::collection::vec(0_u8..120, 5 * 6)) {
            let (still, turned) = (raster(9, 7, &still), raster(5, 6, &turned));
            let plan = Planner::new().plan(good_length(9 + 5 - 1), good_length(7 + 6 - 1));
            let (x, y) = fixed_spectra(&plan, &still);
            let mut data = vec![Complex32::default(); plan.len()];
            for j in 0..6 {
                for i in 0..5 {
                    data[j * plan.width + i] = Complex32::new(turned.occupied[j * 5 + i], turned.free[j * 5 + i]);
                }
            }
            let mut spectrum = vec![Complex32::default(); plan.len()];
            plan.forward(&mut data, 6, &mut spectrum);
            let mut half_turn = spectrum.clone();
            multiply(&mut spectrum, &mut half_turn, &x, &y, plan.height);
            for (product, sign, shifts) in [(&mut spectrum, 1, (-4..9, -5..7)), (&mut half_turn, -1, (0..13, 0..12))] {
                plan.inverse(product, &mut data);
                for sy in shifts.1 {
                    for sx in shifts.0.clone() {
                        let at = |s: isize, size: usize| {
                            usize::try_from(s.rem_euclid(isize::try_from(size).expect("small"))).expect("in range")
                        };
                        let cell = data[at(sy, plan.height) * plan.width + at(sx, plan.width)];
                        let (agreement, disagreement) = direct(&still, &turned, (sx, sy), sign);
                        prop_assert!((cell.re - agreement).abs() < 1e-3 && (cell.im - disagreement).abs() < 1e-3);
                    }
                }
            }
        }
    }
}
