//! One map's cells as registration looks them up: the state of a cell and the nearest wall cell, in one gather.
//!
//! Convention: local frame (see `placement`), row 0 the lowest. Cropped to what is known, with a border of unknown cells
//! wider than the reach of the labels, so that a lookup outside may be clamped to the border and is still right.
//!
//! Method: labels are exact nearest occupied cells within the reach k: per column the distance up or down (two sweeps),
//! then per row the minimum over 2k + 1 columns of dx^2 + dy^2, with dx and the side packed under the square in 16 bits.
//! Shapes and units: `u32` a cell: state in the upper two bits, wall number + 1 in the lower 30 (0 = none in reach).
//! Cost: (2k + 1) vectorised 16-bit operations a cell in rows near walls, nothing elsewhere. Memory 4 bytes a cell of the
//! known bounding box and one byte more while it is built.

use super::num::{narrow, real, real64};
use crate::grid::{CellState, OccupancyGrid};

pub(super) const UNKNOWN: u8 = 0;
pub(super) const FREE: u8 = 1;
pub(super) const OCCUPIED: u8 = 2;

const STATE_SHIFT: u32 = 30;
const LABEL_MASK: u32 = (1 << STATE_SHIFT) - 1;
/// Squares are packed above 7 bits, so the reach may have at most 22 cells (22^2 * 128 < 2^16).
const REACH_MAX: usize = 22;
/// A map of more cells than this (in its known bounding box) is worked on at a coarser cell.
const CELLS_MAX: usize = 1 << 26;

/// See the module.
#[derive(Debug)]
pub(super) struct CellMap {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Side of a cell in metres.
    pub(super) cell: f32,
    /// Local coordinates of the lower-left corner of cell (0, 0).
    pub(super) corner: [f32; 2],
    per_cell: f32,
    cells: Vec<u32>,
}

/// The cropped states of a map, not yet in the local frame.
pub(super) struct Cropped {
    pub(super) states: Vec<u8>,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Side of a cell in metres: the map's own, or a whole multiple.
    pub(super) cell: f64,
    /// Lattice coordinates in metres (not cells) of the lower-left corner of cell (0, 0).
    pub(super) corner: [f64; 2],
    /// Reach of the labels, cells.
    pub(super) reach: usize,
}

impl Cropped {
    /// Known cells of `map` with a border of `reach_m` metres; `None` when nothing is known.
    pub(super) fn new(map: &OccupancyGrid, reach_m: f64) -> Option<Self> {
        let lattice = map.lattice();
        let (width, height) = (lattice.width() as usize, lattice.height() as usize);
        let (mut x0, mut x1, mut y0, mut y1) = (width, 0, height, 0);
        for (y, row) in map.cells().chunks_exact(width).enumerate() {
            let Some(first) = row.iter().position(|cell| cell.state() != CellState::Unknown) else {
                continue;
            };
            let last = row
                .iter()
                .rposition(|cell| cell.state() != CellState::Unknown)
                .unwrap_or(first);
            (x0, x1) = (x0.min(first), x1.max(last + 1));
            (y0, y1) = (y0.min(y), y + 1);
        }
        if x1 == 0 {
            return None;
        }
        let resolution = lattice.resolution();
        // A finer cell than the packing of the labels allows is merged with its neighbours.
        let finest = reach_m / real64(REACH_MAX - 1);
        let mut factor = super::num::ceil64(finest / resolution).max(1);
        while ((x1 - x0) / factor + 1) * ((y1 - y0) / factor + 1) > CELLS_MAX {
            factor += 1;
        }
        let cell = resolution * real64(factor);
        let reach = super::num::ceil64(reach_m / cell).clamp(2, REACH_MAX);
        let border = reach + 1;
        let (inner_w, inner_h) = ((x1 - x0).div_ceil(factor), (y1 - y0).div_ceil(factor));
        let (w, h) = (inner_w + 2 * border, inner_h + 2 * border);
        let mut states = vec![UNKNOWN; w * h];
        for (j, out) in states.chunks_exact_mut(w).skip(border).take(inner_h).enumerate() {
            let out = &mut out[border..border + inner_w];
            if factor == 1 {
                let row = &map.cells()[(y0 + j) * width + x0..][..inner_w];
                for (state, cell) in out.iter_mut().zip(row) {
                    *state = cell.state() as u8;
                }
            } else {
                merge_row(map, out, [x0, x1], [y0 + j * factor, y1], factor);
            }
        }
        let edge = real64(border) * cell;
        Some(Self {
            states,
            width: w,
            height: h,
            cell,
            corner: [real64(x0) * resolution - edge, real64(y0) * resolution - edge],
            reach,
        })
    }

    /// Row-major indices of the occupied cells, in order.
    pub(super) fn occupied(&self) -> Vec<u32> {
        let mut found = Vec::new();
        for (index, &state) in (0_u32..).zip(&self.states) {
            if state == OCCUPIED {
                found.push(index);
            }
        }
        found
    }
}

/// A block is occupied when any of its cells is, else free when at least half of it is.
fn merge_row(map: &OccupancyGrid, out: &mut [u8], [x0, x1]: [usize; 2], [y0, y1]: [usize; 2], factor: usize) {
    let width = map.lattice().width() as usize;
    for (i, state) in out.iter_mut().enumerate() {
        let (mut free, mut occupied) = (0, 0);
        for y in y0..(y0 + factor).min(y1) {
            for x in x0 + i * factor..(x0 + (i + 1) * factor).min(x1) {
                match map.cells()[y * width + x].state() {
                    CellState::Unknown => {}
                    CellState::Free => free += 1,
                    CellState::Occupied => occupied += 1,
                }
            }
        }
        *state = match (occupied, free) {
            (1.., _) => OCCUPIED,
            (0, free) if 2 * free >= factor * factor => FREE,
            _ => UNKNOWN,
        };
    }
}

impl CellMap {
    /// Labels every cell in reach of an occupied one; `occupied` as from [`Cropped::occupied`]. `middle` is the local
    /// frame's origin in lattice metres.
    pub(super) fn new(cropped: &Cropped, occupied: &[u32], middle: [f64; 2]) -> Self {
        let (width, height) = (cropped.width, cropped.height);
        let mut cells: Vec<u32> = cropped
            .states
            .iter()
            .map(|&state| u32::from(state) << STATE_SHIFT)
            .collect();
        for (label, &index) in (1_u32..).zip(occupied) {
            cells[index as usize] |= label & LABEL_MASK;
        }
        label_nearest(&mut cells, cropped);
        Self {
            width,
            height,
            cell: narrow(cropped.cell),
            corner: [
                narrow(cropped.corner[0] - middle[0]),
                narrow(cropped.corner[1] - middle[1]),
            ],
            per_cell: narrow(1.0 / cropped.cell),
            cells,
        }
    }

    /// State and wall number + 1 (0 = none in reach) at a point of the local frame; unknown outside.
    #[inline]
    pub(super) fn at(&self, x: f32, y: f32) -> (u8, u32) {
        let u = ((x - self.corner[0]) * self.per_cell).clamp(0.0, real(self.width - 1));
        let v = ((y - self.corner[1]) * self.per_cell).clamp(0.0, real(self.height - 1));
        let cell = self.cells[super::num::index(v) * self.width + super::num::index(u)];
        (state_of(cell), cell & LABEL_MASK)
    }

    /// The state of a cell.
    #[inline]
    pub(super) fn state(&self, column: usize, row: usize) -> u8 {
        state_of(self.cells[row * self.width + column])
    }

    /// Local coordinates of the centre of a cell.
    #[inline]
    pub(super) fn center(&self, column: usize, row: usize) -> (f32, f32) {
        (
            self.corner[0] + (real(column) + 0.5) * self.cell,
            self.corner[1] + (real(row) + 0.5) * self.cell,
        )
    }
}

#[inline]
fn state_of(cell: u32) -> u8 {
    (cell >> STATE_SHIFT).to_le_bytes()[0]
}

fn label_nearest(cells: &mut [u32], cropped: &Cropped) {
    let (width, height, k) = (cropped.width, cropped.height, cropped.reach);
    let far = u8::try_from(k + 1).expect("invariant: the reach is at most 22 cells");
    // below[y]: how many cells below y the nearest occupied one of the same column stands.
    let mut below = vec![far; width * height];
    for y in 0..height {
        let (before, row) = below.split_at_mut(y * width);
        let states = &cropped.states[y * width..][..width];
        if y == 0 {
            for (d, &state) in row.iter_mut().zip(states) {
                *d = if state == OCCUPIED { 0 } else { far };
            }
        } else {
            let last = &before[(y - 1) * width..];
            for ((d, &l), &state) in row.iter_mut().zip(last).zip(states) {
                *d = if state == OCCUPIED { 0 } else { (l + 1).min(far) };
            }
        }
    }
    let limit = u16::try_from(k * k * 128 + 127).expect("invariant: the reach is at most 22 cells");
    let mut above = vec![far; width];
    let mut column_key = vec![u16::MAX; width.next_multiple_of(LANES) + 2 * k];
    for y in (0..height).rev() {
        let states = &cropped.states[y * width..][..width];
        let below = &below[y * width..][..width];
        let mut near = far;
        for (((a, &b), &state), key) in above.iter_mut().zip(below).zip(states).zip(&mut column_key[k..]) {
            *a = if state == OCCUPIED { 0 } else { (*a + 1).min(far) };
            let d = (*a).min(b);
            near = near.min(d);
            // bit 0: the nearest stands above
            let packed = ((u16::from(d) * u16::from(d)) << 7) | u16::from(*a < b);
            *key = if d < far { packed } else { u16::MAX };
        }
        if near == far {
            continue;
        }
        for x0 in (0..width).step_by(LANES) {
            let Some(best) = nearest_of_lanes(&column_key[x0..x0 + LANES + 2 * k], k) else {
                continue;
            };
            for (x, key) in (x0..width).zip(best) {
                if key > limit || states[x] == OCCUPIED {
                    continue;
                }
                let column = x + usize::from((key >> 1) & 0x3f) - k;
                let label = if key & 1 == 1 {
                    cells[(y + usize::from(above[column])) * width + column]
                } else {
                    cells[(y - usize::from(below[column])) * width + column]
                };
                cells[y * width + x] |= label & LABEL_MASK;
            }
        }
    }
}

/// Cells of a row that are worked on together: few enough for their best keys to stay in registers.
const LANES: usize = 16;

/// For each of the lanes `min over dx in -k..=k of column_key[x + dx] + dx^2`, with dx + k packed in bits 1..7; `None`
/// when no column in reach of any lane has a key.
fn nearest_of_lanes(column_key: &[u16], k: usize) -> Option<[u16; LANES]> {
    if column_key.iter().all(|&key| key == u16::MAX) {
        return None;
    }
    let mut best = [u16::MAX; LANES];
    for shift in 0..=2 * k {
        let dx = shift.abs_diff(k);
        let add = u16::try_from(dx * dx * 128 + shift * 2).expect("invariant: the reach is at most 22 cells");
        for (best, &key) in best.iter_mut().zip(&column_key[shift..shift + LANES]) {
            *best = (*best).min(key.saturating_add(add));
        }
    }
    Some(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose2;
    use crate::grid::{Lattice, LogOdds};
    use proptest::prelude::*;

    fn grid(width: u32, height: u32, states: &[u8]) -> OccupancyGrid {
        let lattice = Lattice::new(width, height, 0.05, Pose2::IDENTITY).expect("valid");
        let cells = states
            .iter()
            .map(|state| [LogOdds::UNKNOWN, LogOdds::FREE, LogOdds::OCCUPIED][usize::from(*state)]);
        OccupancyGrid::new(lattice, cells.collect()).expect("as many cells")
    }

    proptest! {
        #[test]
        fn the_label_is_a_nearest_occupied_cell_or_none_is_in_reach(states in proptest::collection::vec(0_u8..12, 30 * 20)) {
            let states: Vec<u8> = states.into_iter().map(|s| if s == 2 { 2 } else { u8::from(s > 5) }).collect();
            let map = grid(30, 20, &states);
            let Some(cropped) = Cropped::new(&map, 0.3) else { return Ok(()) };
            let occupied = cropped.occupied();
            let cells = CellMap::new(&cropped, &occupied, [0.0, 0.0]);
            for row in 0..cells.height {
                for column in 0..cells.width {
                    let (x, y) = cells.center(column, row);
                    let square = |index: u32| {
                        let (c, r) = (index as usize % cells.width, index as usize / cells.width);
                        c.abs_diff(column).pow(2) + r.abs_diff(row).pow(2)
                    };
                    let nearest = occupied.iter().map(|&index| square(index)).min();
                    let (state, label) = cells.at(x, y);
                    prop_assert_eq!(state, cropped.states[row * cells.width + column]);
                    match nearest {
                        Some(nearest) if nearest <= cropped.reach.pow(2) => {
                            prop_assert!(label > 0);
                            prop_assert_eq!(square(occupied[label as usize - 1]), nearest);
                        }
                        _ => prop_assert_eq!(label, 0),
                    }
                }
            }
        }
    }

    #[test]
    fn a_map_that_knows_nothing_has_no_cells() {
        assert!(Cropped::new(&grid(3, 2, &[0; 6]), 0.5).is_none());
    }
}
