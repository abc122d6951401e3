//! The paper's verification index (eq. 34) and the overlap of two maps, from the cells that the search looks at anyway.
//!
//! Method. As `registration::overlap` (which is its oracle in the tests), but only every k-th cell of every k-th row of the
//! map with the smaller known area is looked up, with k such that about 6000 are: V of many candidates is needed, and
//! a share is told to half a percent by so many.

use rayon::prelude::*;

use super::cells::CellMap;
use super::cropped::UNKNOWN;
use super::features::Features;
use super::num::real64;
use super::placement::{Placement, Rigid};
use super::simd::{LANES, widest};

const LOOKUPS: usize = 6_000;
/// Rows that one task looks up at least.
const TOGETHER: usize = 16;

/// V in [0, 1], `None` without common cells; and the overlap in [0, 1].
pub(super) fn agreement(fixed: &Features, moving: &Features, placement: Placement) -> (Option<f64>, f64) {
    let area = |map: &Features| real64(map.known) * f64::from(map.cells.cell).powi(2);
    let to_fixed = placement.rigid();
    if area(fixed) < area(moving) {
        walk(&fixed.cells, fixed.known, &moving.cells, to_fixed.inverse())
    } else {
        walk(&moving.cells, moving.known, &fixed.cells, to_fixed)
    }
}

fn walk(smaller: &CellMap, known: usize, larger: &CellMap, to_larger: Rigid) -> (Option<f64>, f64) {
    let step = (known / LOOKUPS).isqrt().max(1);
    let counts = (0..smaller.height.div_ceil(step))
        .into_par_iter()
        .with_min_len(TOGETHER)
        .fold(Counts::default, |mut counts, row| {
            compare_row(smaller, larger, to_larger, row * step, step, &mut counts);
            counts
        })
        .reduce(Counts::default, |a, b| Counts {
            visited: a.visited + b.visited,
            agreeing: a.agreeing + b.agreeing,
            common: a.common + b.common,
        });
    let share = |part: usize, whole: usize| real64(part) / real64(whole.max(1));
    let Counts {
        visited,
        agreeing,
        common,
    } = counts;
    ((common > 0).then(|| share(agreeing, common)), share(common, visited))
}

#[derive(Default)]
struct Counts {
    visited: usize,
    agreeing: usize,
    common: usize,
}

widest! {
    fn compare_row(smaller: &CellMap, larger: &CellMap, to_larger: Rigid, row: usize, step: usize, counts: &mut Counts) {
        let cells = smaller.row(row);
        for start in (0..cells.len()).step_by(step * LANES) {
            let mut here = [0; LANES];
            for (here, cell) in here.iter_mut().zip(cells[start..].iter().step_by(step)) {
                *here = CellMap::state_of(*cell);
            }
            if here == [UNKNOWN; LANES] {
                continue;
            }
            let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
            for i in 0..LANES {
                let (cx, cy) = smaller.center(start + i * step, row);
                (x[i], y[i]) = to_larger.apply(cx, cy);
            }
            let there = larger.at_all(&x, &y);
            for (here, there) in here.into_iter().zip(there) {
                let there = CellMap::state_of(there);
                let known = here != UNKNOWN;
                counts.visited += usize::from(known);
                counts.common += usize::from(known && there != UNKNOWN);
                counts.agreeing += usize::from(known && there == here);
            }
        }
    }
}
