//! Translation candidates: where walls agree and do not stand in free space.
//!
//! Convention: the moving map is turned first; a shift s of its raster puts its cell i on the fixed map's cell i + s.
//! Method, sums over all cells (f fixed, m moving, see `raster` for O and F, `spread` for Od, `eroded` for Fe):
//! (1) agreement A(s) = sum Od_f(i + s) O_m(i) + mu sum F_f(i + s) F_m(i), mu = 0.05;
//! (2) disagreement B(s) = sum Fe_f(i + s) O_m(i) + sum O_f(i + s) F_m(i);
//! (3) S(s) = A - lambda B, for a lambda that trusts free space (2) and one that does not (0.5).
//! The best local maxima (5 x 5 cells) of both lists over all rotations go on.
//! Cost: (2 + 3 R) transforms for R rotations modulo pi (see `correlation`): nearly all of the time of a search.
//! Differences from the paper: by the projection-slice theorem the correlation of two Hough columns (paper eq. 23-27) is
//! a projection of A without the free space. The free space is what tells the right shift from the others: at low
//! overlap the truth is among the best 30 in .09 of pairs for lambda = 0, in .91 for lambda = 2.

#![expect(clippy::doc_markdown, reason = "the letters of the formulas")]

use std::sync::Mutex;

use rayon::prelude::*;
use rustfft::num_complex::Complex32;

use super::correlation::{Correlator, Scratch};
use super::features::Features;
use super::fft::{Packed, Plan, Planner, good_length};
use super::num::{index, narrow, real, signed};
use super::params::HoughParameters;
use super::peaks::Tops;
use super::placement::Placement;
use super::raster::{Raster, bounds};

const MU: f32 = 0.05;
const LEAST_COMMON_M: f32 = 2.0;
/// Rotations whose rasters are made while the fixed map is transformed: as many as most pairs have.
const EARLY: usize = 2;

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
    let (axes, [width, height]) = axes(fixed, moving, rotations, cell);
    let plan = planner.plan(width, height);
    let turned = |rotation| Raster::new(moving, axes + rotation, cell);
    let (first, others) = rotations.split_at(rotations.len().min(EARLY));
    let ((still, correlator), first) = rayon::join(
        || {
            let still = Raster::new(fixed, axes, cell);
            let correlator = correlator(plan, &still);
            (still, correlator)
        },
        || first.iter().map(|&rotation| turned(rotation)).collect::<Vec<_>>(),
    );
    let scratches = Pool::default();
    let of_rotation =
        |turned: &Raster| scratches.lend(|scratch| of_rotation(&correlator, &still, turned, cell, parameters, scratch));
    let early = first.into_par_iter().map(|turned| of_rotation(&turned));
    let late = others.par_iter().map(|&rotation| of_rotation(&turned(rotation)));
    let lists: Vec<Vec<Shift>> = early.chain(late).collect();
    let mut all: Vec<Shift> = lists.into_iter().flatten().collect();
    // back from the axes of the search into those of the fixed map
    let (sin, cos) = axes.sin_cos();
    for Shift { placement, .. } in &mut all {
        *placement = Placement {
            x: cos * placement.x + sin * placement.y,
            y: cos * placement.y - sin * placement.x,
            yaw: placement.yaw - axes,
        };
    }
    best_of_both(&all, parameters.kept_shifts)
}

/// Turns of the search's axes that are looked at, over a quarter turn.
const TURNS: u8 = 16;

/// By how much both maps are turned for the search, and its width and height: as few cells as may be. A building is long
/// and wide along its walls, and seldom along the axes of its map.
fn axes(fixed: &Features, moving: &Features, rotations: &[f64], cell: f32) -> (f64, [usize; 2]) {
    // Shifts that leave less than LEAST_COMMON_M in common on an axis may wrap onto each other: they are worth nothing.
    let spare = index(LEAST_COMMON_M / cell);
    let length =
        |fixed: usize, moving: usize| good_length((fixed + moving - 1 - spare.min(fixed.min(moving) - 1)).max(2));
    let sizes = (0..TURNS).map(|turn| {
        let axes = f64::from(turn) / f64::from(TURNS) * std::f64::consts::FRAC_PI_2;
        let (_, still_width, still_height) = bounds(fixed, axes, cell);
        let (mut width, mut height) = (0, 0);
        for &rotation in rotations {
            let (_, w, h) = bounds(moving, axes + rotation, cell);
            (width, height) = (width.max(w), height.max(h));
        }
        (axes, [length(still_width, width), length(still_height, height)])
    });
    sizes
        .min_by_key(|(_, [width, height])| width * height)
        .expect("invariant: there is a turn")
}

/// Scratch that is lent to whoever works, and never more of it than work at a time.
#[derive(Default)]
struct Pool(Mutex<Vec<Scratch>>);

impl Pool {
    fn lend<T>(&self, work: impl FnOnce(&mut Scratch) -> T) -> T {
        let all = || self.0.lock().expect("invariant: nobody panics while holding it");
        let mut scratch = all().pop().unwrap_or_default();
        let done = work(&mut scratch);
        all().push(scratch);
        done
    }
}

fn correlator(plan: Plan, still: &Raster) -> Correlator {
    let ((spread, free), eroded) = rayon::join(
        || {
            let free: Vec<f32> = still.free.iter().map(|free| MU * free).collect();
            (still.spread(), free)
        },
        || still.eroded(),
    );
    let packed = |re, im| Packed {
        width: still.width,
        height: still.height,
        re,
        im,
    };
    Correlator::new(plan, &packed(&spread, &eroded), &packed(&free, &still.occupied))
}

fn of_rotation(
    correlator: &Correlator,
    still: &Raster,
    turned: &Raster,
    cell: f32,
    parameters: &HoughParameters,
    scratch: &mut Scratch,
) -> Vec<Shift> {
    let image = Packed {
        width: turned.width,
        height: turned.height,
        re: &turned.occupied,
        im: &turned.free,
    };
    correlator.correlate(&image, scratch);
    let plan = correlator.plan();
    let finish = |data: &mut [Complex32]| {
        let mut inner = vec![Complex32::default(); plan.scratch_len()];
        let mut tops = Tops::new(plan.width, plan.height, parameters.lambdas);
        for row in data.chunks_exact_mut(plan.width) {
            plan.inverse_rows(row, &mut inner);
            tops.push(row);
        }
        tops.peaks(data, parameters.shifts_per_rotation)
    };
    let (straight, half_turn) = rayon::join(|| finish(&mut scratch.straight), || finish(&mut scratch.half_turn));
    let int = |value: usize| isize::try_from(value).expect("invariant: arrays are small");
    let straight = straight.into_iter().map(|peak| {
        // shifts run from -(moving - 1) to fixed - 1; the negative ones stand at the end
        let unwrapped =
            |at: usize, size: usize, used: usize| signed(if at >= used { int(at) - int(size) } else { int(at) });
        let shift = [
            unwrapped(peak.column, plan.width, still.width),
            unwrapped(peak.row, plan.height, still.height),
        ];
        (peak, shift, 0.0, 1.0)
    });
    // The raster's cell i lies at corner + (i + 0.5) cell; turned by half a turn, at -corner - (i + 0.5) cell.
    let half_turn = half_turn.into_iter().map(|peak| {
        (
            peak,
            [real(peak.column + 1), real(peak.row + 1)],
            std::f64::consts::PI,
            -1.0,
        )
    });
    straight
        .chain(half_turn)
        .map(|(peak, [sx, sy], turn, sign)| Shift {
            placement: Placement {
                x: f64::from(still.corner.0 - sign * turned.corner.0 + sx * cell),
                y: f64::from(still.corner.1 - sign * turned.corner.1 + sy * cell),
                yaw: turned.rotation + turn,
            },
            scores: peak.scores,
        })
        .collect()
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
            rotation: 0.0,
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
            let correlator = correlator(plan, &still);
            let image = Packed { width: 5, height: 6, re: &turned.occupied, im: &turned.free };
            let mut scratch = Scratch::default();
            // twice: what the first left in the scratch must not matter
            correlator.correlate(&image, &mut scratch);
            correlator.correlate(&image, &mut scratch);
            let Scratch { straight, half_turn, .. } = &mut scratch;
            let plan = correlator.plan();
            let mut inner = vec![Complex32::default(); plan.scratch_len()];
            for (data, sign, shifts) in [(straight, 1, (-4..9, -5..7)), (half_turn, -1, (0..13, 0..12))] {
                plan.inverse_rows(data, &mut inner);
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
