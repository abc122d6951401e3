//! The paper's verification index (eq. 34) and the overlap of two maps, from the cells that the search looks at anyway.
//!
//! Method. As `registration::overlap` (which is its oracle in the tests), but only every k-th cell of every k-th row of the
//! map with the smaller known area is looked up, with k such that about 6000 are: V of many candidates is needed, and
//! a share is told to half a percent by so many.

use super::cells::{CellMap, UNKNOWN};
use super::features::Features;
use super::num::real64;
use super::placement::{Placement, Rigid};

const LOOKUPS: usize = 6_000;

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
    let (mut visited, mut agreeing, mut common) = (0_usize, 0_usize, 0_usize);
    for row in (0..smaller.height).step_by(step) {
        for column in (0..smaller.width).step_by(step) {
            let here = smaller.state(column, row);
            if here == UNKNOWN {
                continue;
            }
            let (x, y) = smaller.center(column, row);
            let (x, y) = to_larger.apply(x, y);
            let there = larger.at(x, y).0;
            visited += 1;
            common += usize::from(there != UNKNOWN);
            agreeing += usize::from(there == here);
        }
    }
    let share = |part: usize, whole: usize| real64(part) / real64(whole.max(1));
    ((common > 0).then(|| share(agreeing, common)), share(common, visited))
}
