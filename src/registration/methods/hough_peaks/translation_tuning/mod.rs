//! Entropy tuning: an exhaustive search around the approximate translation (Algorithm 2 line 12; eq. 31 and 32).
//!
//! **Convention.** Shifts are whole cells along the axes of the fixed map's lattice.
//!
//! **Method.** The moving map is resampled once onto the fixed map's lattice at the approximate pose. For every shift of
//! up to `delta_x` and `delta_y` cells the cells known in both are counted by their states; the best shift by the chosen
//! objective is added to the pose:
//!
//! * `VerificationIndex`: the greatest V (eq. 34), among shifts with at least `overlap_min` of the smaller known area in
//!   common; of equal ones the smallest shift;
//! * `Entropy`: the smallest entropy `-sum p log2 p` (eq. 31) of the fused map's histogram. By eq. 14 a fused cell has one
//!   of five values: free in both, free in one, unknown or contradicted, occupied in one, occupied in both; their numbers
//!   follow from the counts over cells known in both and from the totals of each map, without fusing anything.
//!
//! **Shapes and units.** Cells; a bit a cell, one plane for known and one for occupied.
//!
//! **Cost.** `(2 delta_x + 1)(2 delta_y + 1)` times the fixed map's known box over 64, in parallel over columns of shifts.
//! Whole numbers, so the answer does not depend on the number of threads.
//!
//! **Fails when** the approximate translation is farther off than the search reaches.
//!
//! **Differences from the paper.** Entropy is a wrong objective: it is small where the maps hide each other, not where they
//! agree. At the true rotation its least value within +-10 cells is at the truth in none of 93 real pairs (at the border
//! of the search in most), that of V in 91 %. So V is the default. The paper's S has strict bounds and its text a radius
//! of ten cells; here the bounds belong to S.

use rayon::prelude::*;

use super::params::{Disagreement, HoughPeaksParams, TranslationTuning};
use super::trace::Objective;
use crate::geometry::{Angle, Pose2};
use crate::grid::{CellState, StateCounts};
use crate::registration::methods::shared::hough_image::to_f64;
use crate::registration::overlap::StateMap;

/// `pose` moved by the best shift.
pub(super) fn tuned_translation(fixed: &StateMap, moving: &StateMap, pose: Pose2, params: &HoughPeaksParams) -> Pose2 {
    if params.translation_tuning == TranslationTuning::Off {
        return pose;
    }
    let Some(window) = Window::of_known(fixed) else {
        return pose;
    };
    let reach = [params.delta_x as usize, params.delta_y as usize];
    let totals = Totals::new(fixed, moving, pose, reach, params);
    let tallies = tallies(fixed, moving, pose, &window, reach);
    let objective = |tally: &Tally| match params.translation_tuning {
        TranslationTuning::Entropy => Some(-totals.entropy(tally)),
        // Departs from eq. 32: the greatest V, not the least entropy.
        _ => totals.verification_index(tally, params),
    };
    let mut best: Option<(f64, Shift)> = None;
    for (shift, tally) in &tallies {
        let Some(value) = objective(tally) else { continue };
        let better = best.is_none_or(|(most, at)| value > most || (value >= most && shift.order() < at.order()));
        if better {
            best = Some((value, *shift));
        }
    }
    match best {
        Some((_, shift)) => shift.applied(pose, fixed),
        None => pose,
    }
}

/// The objectives of every shift around `pose`, for people to look at; the search itself needs one of them only.
pub(super) fn surface(fixed: &StateMap, moving: &StateMap, pose: Pose2, params: &HoughPeaksParams) -> Vec<Objective> {
    let Some(window) = Window::of_known(fixed) else {
        return Vec::new();
    };
    let with = |disagreement, overlap_min| HoughPeaksParams {
        disagreement,
        overlap_min,
        translation_tuning: TranslationTuning::Entropy, // its totals serve all objectives
        ..params.clone()
    };
    let in_both = with(Disagreement::KnownInBoth, params.overlap_min);
    let in_one = with(Disagreement::KnownInOne, 0.0);
    let reach = [params.delta_x as usize, params.delta_y as usize];
    let totals = Totals::new(fixed, moving, pose, reach, &in_both);
    tallies(fixed, moving, pose, &window, reach)
        .into_iter()
        .map(|(shift, tally)| Objective {
            shift: [shift.x, shift.y],
            entropy: totals.entropy(&tally),
            verification_index: totals.verification_index(&tally, &in_both),
            verification_index_over_union: totals.verification_index(&tally, &in_one),
        })
        .collect()
}

/// A shift in cells of the fixed map's lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Shift {
    x: i32,
    y: i32,
}

impl Shift {
    /// Nearer shifts first, in an order that is total.
    fn order(self) -> (i32, i32, i32) {
        (self.x * self.x + self.y * self.y, self.y, self.x)
    }

    fn applied(self, pose: Pose2, fixed: &StateMap) -> Pose2 {
        let cell = fixed.lattice().resolution();
        let along = Pose2::new(0.0, 0.0, fixed.lattice().origin().yaw());
        let [x, y] = along.apply([f64::from(self.x) * cell, f64::from(self.y) * cell]);
        Pose2::new(x, y, Angle::ZERO) * pose
    }
}

/// Cells known in both maps under one shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Tally {
    common: u32,
    agreeing: u32,
    both_occupied: u32,
}

/// The rectangle of the fixed map's lattice that holds all its known cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Window {
    column: usize,
    row: usize,
    width: usize,
    height: usize,
}

impl Window {
    fn of_known(map: &StateMap) -> Option<Self> {
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for (row, states) in map.states().chunks(map.lattice().width() as usize).enumerate() {
            let known = |state: &CellState| *state != CellState::Unknown;
            if let (Some(first), Some(last)) = (states.iter().position(known), states.iter().rposition(known)) {
                low = [low[0].min(first), low[1].min(row)];
                high = [high[0].max(last + 1), high[1].max(row + 1)];
            }
        }
        (high[0] > 0).then(|| Self {
            column: low[0],
            row: low[1],
            width: high[0] - low[0],
            height: high[1] - low[1],
        })
    }
}

/// Known and occupied cells of a rectangle, a bit a cell, each row from a new word and with a spare one at its end.
struct Planes {
    words: usize,
    known: Vec<u64>,
    occupied: Vec<u64>,
}

impl Planes {
    /// `state(column, row)` tells the cells.
    fn new(width: usize, height: usize, state: impl Fn(usize, usize) -> CellState + Sync) -> Self {
        let words = width.div_ceil(64) + 1;
        let (mut known, mut occupied) = (vec![0; words * height], vec![0; words * height]);
        known
            .par_chunks_mut(words)
            .zip(occupied.par_chunks_mut(words))
            .enumerate()
            .for_each(|(row, (known, occupied))| {
                for column in 0..width {
                    let (word, bit) = (column / 64, 1_u64 << (column % 64));
                    match state(column, row) {
                        CellState::Unknown => {}
                        CellState::Free => known[word] |= bit,
                        CellState::Occupied => {
                            known[word] |= bit;
                            occupied[word] |= bit;
                        }
                    }
                }
            });
        Self { words, known, occupied }
    }

    /// The planes with the first `columns` columns cut off, `words` words a row.
    fn cut(&self, columns: usize, words: usize) -> Self {
        let cut = |plane: &[u64]| {
            let mut out = Vec::with_capacity(plane.len() / self.words * words);
            for row in plane.chunks(self.words) {
                out.extend((0..words).map(|word| {
                    let (from, bits) = (word + columns / 64, columns % 64);
                    let at = |word: usize| row.get(word).copied().unwrap_or(0);
                    if bits == 0 {
                        at(from)
                    } else {
                        at(from) >> bits | at(from + 1) << (64 - bits)
                    }
                }));
            }
            out
        };
        Self {
            words,
            known: cut(&self.known),
            occupied: cut(&self.occupied),
        }
    }
}

/// The tally of every shift, in the order of x, then y.
fn tallies(
    fixed: &StateMap,
    moving: &StateMap,
    pose: Pose2,
    window: &Window,
    reach: [usize; 2],
) -> Vec<(Shift, Tally)> {
    let [rx, ry] = reach;
    let of_fixed = Planes::new(window.width, window.height, |column, row| {
        fixed.states()[(window.row + row) * fixed.lattice().width() as usize + window.column + column]
    });
    let seen = Seen::new(fixed, moving, pose);
    let of_moving = Planes::new(window.width + 2 * rx, window.height + 2 * ry, |column, row| {
        let x = to_f64(window.column + column) - to_f64(rx);
        let y = to_f64(window.row + row) - to_f64(ry);
        seen.at(x, y)
    });
    (0..=2 * rx)
        .into_par_iter()
        .flat_map_iter(|step_x| {
            // shifted by x = step_x - rx, the cell that comes to column i is the present i - x = i + 2 rx - step_x - rx
            let shifted = of_moving.cut(2 * rx - step_x, of_fixed.words);
            (0..=2 * ry)
                .map(|step_y| {
                    let skipped = (2 * ry - step_y) * shifted.words;
                    let shift = Shift {
                        x: signed(step_x) - signed(rx),
                        y: signed(step_y) - signed(ry),
                    };
                    (
                        shift,
                        tally(&of_fixed, &shifted.known[skipped..], &shifted.occupied[skipped..]),
                    )
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

fn signed(steps: usize) -> i32 {
    i32::try_from(steps).expect("invariant: at most 2 x 64 steps")
}

fn tally(fixed: &Planes, known: &[u64], occupied: &[u64]) -> Tally {
    let mut tally = Tally::default();
    let words = fixed.known.iter().zip(&fixed.occupied).zip(known.iter().zip(occupied));
    for ((known_1, occupied_1), (known_2, occupied_2)) in words {
        let common = known_1 & known_2;
        tally.common += common.count_ones();
        tally.agreeing += (common & !(occupied_1 ^ occupied_2)).count_ones();
        tally.both_occupied += (occupied_1 & occupied_2).count_ones();
    }
    tally
}

/// The moving map at the approximate pose, as cells of the fixed map's lattice.
struct Seen<'a> {
    moving: &'a StateMap,
    /// Lattice coordinates in the moving map of the fixed lattice's corner, and of one step along its columns.
    start: [f64; 2],
    step: [f64; 2],
}

impl<'a> Seen<'a> {
    fn new(fixed: &StateMap, moving: &'a StateMap, pose_fixed_moving: Pose2) -> Self {
        let (from, to) = (fixed.lattice(), moving.lattice());
        let pose_to_from = (to.origin().inverse() * pose_fixed_moving.inverse() * from.origin()).motion();
        let scale = from.resolution() / to.resolution();
        Self {
            moving,
            start: [pose_to_from.x / to.resolution(), pose_to_from.y / to.resolution()],
            step: [pose_to_from.cos * scale, pose_to_from.sin * scale],
        }
    }

    /// The state under the middle of a cell of the fixed map's lattice, which may lie outside of the fixed map.
    #[inline]
    fn at(&self, column: f64, row: f64) -> CellState {
        let (x, y) = (column + 0.5, row + 0.5);
        let [du, dv] = self.step;
        self.moving
            .lattice()
            .cell_of([self.start[0] + du * x - dv * y, self.start[1] + dv * x + du * y])
            .map_or(CellState::Unknown, |(i, j)| self.moving.at(i, j))
    }
}

/// What does not change with the shift.
struct Totals {
    fixed: StateCounts,
    moving: StateCounts,
    /// Cells of the canvas on which the histogram is taken: the boxes of both maps under all shifts.
    canvas: f64,
}

impl Totals {
    fn new(fixed: &StateMap, moving: &StateMap, pose: Pose2, [rx, ry]: [usize; 2], params: &HoughPeaksParams) -> Self {
        let (low, high) = moved_box(fixed, moving, pose);
        let counts = if params.translation_tuning == TranslationTuning::Entropy {
            resampled_counts(fixed, moving, pose, low, high)
        } else {
            moving.counts()
        };
        let (width, height) = (f64::from(fixed.lattice().width()), f64::from(fixed.lattice().height()));
        let span = |low: f64, high: f64, own: f64, reach: usize| {
            (high + to_f64(reach)).max(own) - (low - to_f64(reach)).min(0.0)
        };
        Self {
            fixed: fixed.counts(),
            moving: counts,
            canvas: span(low[0], high[0], width, rx) * span(low[1], high[1], height, ry),
        }
    }

    fn verification_index(&self, tally: &Tally, params: &HoughPeaksParams) -> Option<f64> {
        let smaller = to_f64(self.fixed.known().min(self.moving.known()));
        let common = f64::from(tally.common);
        if tally.common == 0 || common < params.overlap_min * smaller {
            return None;
        }
        let known = match params.disagreement {
            Disagreement::KnownInBoth => common,
            Disagreement::KnownInOne => to_f64(self.fixed.known() + self.moving.known()) - common,
        };
        Some(f64::from(tally.agreeing) / known)
    }

    /// The entropy in bits of the fused map (eq. 31).
    fn entropy(&self, tally: &Tally) -> f64 {
        let both_occupied = f64::from(tally.both_occupied);
        let both_free = f64::from(tally.agreeing - tally.both_occupied);
        let contradicted = f64::from(tally.common - tally.agreeing);
        let known = to_f64(self.fixed.known() + self.moving.known());
        let occupied = to_f64(self.fixed.occupied + self.moving.occupied);
        // each contradicted cell takes one occupied and one free cell out of the maps' totals
        let occupied_once = occupied - 2.0 * both_occupied - contradicted;
        let free_once = known - occupied - 2.0 * both_free - contradicted;
        let unknown = self.canvas - both_occupied - both_free - occupied_once - free_once;
        [both_free, free_once, unknown, occupied_once, both_occupied]
            .into_iter()
            .filter(|count| *count > 0.0)
            .map(|count| count / self.canvas)
            .map(|p| -p * p.log2())
            .sum()
    }
}

/// The box of the moving map's lattice at the pose, in whole cells of the fixed map's lattice.
fn moved_box(fixed: &StateMap, moving: &StateMap, pose: Pose2) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in moving.lattice().corners() {
        let [u, v] = fixed.lattice().to_cells(pose.apply(corner));
        low = [low[0].min(u.floor()), low[1].min(v.floor())];
        high = [high[0].max(u.ceil()), high[1].max(v.ceil())];
    }
    (low, high)
}

/// The states of all cells of the moving map, once they are cells of the fixed map's lattice.
fn resampled_counts(fixed: &StateMap, moving: &StateMap, pose: Pose2, low: [f64; 2], high: [f64; 2]) -> StateCounts {
    let seen = Seen::new(fixed, moving, pose);
    let mut counts = StateCounts::default();
    let mut y = low[1];
    while y < high[1] {
        let mut x = low[0];
        while x < high[0] {
            match seen.at(x, y) {
                CellState::Unknown => counts.unknown += 1,
                CellState::Free => counts.free += 1,
                CellState::Occupied => counts.occupied += 1,
            }
            x += 1.0;
        }
        y += 1.0;
    }
    counts
}

#[cfg(test)]
mod tests;
