//! One map's cells as registration looks them up: the state of a cell and the nearest wall cell, in one gather.
//!
//! Convention: local frame (see `placement`), row 0 the lowest. Cropped to what is known, with a border of unknown cells
//! wider than the reach of the labels, so that a lookup outside may be clamped to the border and is still right.
//!
//! Method: labels are exact nearest occupied cells within the reach k. Each occupied cell puts its squared distance, with
//! its number below, into the keys of the rows that it reaches, where the least stays; behind occupied neighbours it need
//! not. A row that is done becomes cells.
//! Shapes and units: `u32` a cell: state in the upper two bits, wall number in the lower 30, from 1 (0 = none in reach).
//! Cost: up to 2 k + 1 rows of 2 k + 1 keys an occupied cell, 8 at a time, most of walls along an axis left out; and one
//! pass over the cells, of which the floor is to write 4 bytes each. Memory: those.

use rayon::prelude::*;

use super::cropped::{BAND, Cropped, FREE, OCCUPIED, UNKNOWN};
use super::num::{clamped_index, narrow, real};
use super::simd::{LANES, widest};

const STATE_SHIFT: u32 = 30;
const LABEL_MASK: u32 = (1 << STATE_SHIFT) - 1;
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
    /// `width` in 32 bits.
    columns: u32,
    cells: Vec<u32>,
}

impl CellMap {
    /// `middle` is the local frame's origin in lattice metres.
    pub(super) fn new(cropped: &Cropped, middle: [f64; 2]) -> Self {
        let (width, height) = (cropped.width, cropped.height);
        let spans = Spans::new(cropped.reach);
        let mut cells = vec![0_u32; width * height];
        cells
            .par_chunks_mut(BAND * width)
            .enumerate()
            .for_each(|(band, rows)| label_band(cropped, &spans, band * BAND, rows));
        Self {
            width,
            height,
            cell: narrow(cropped.cell),
            corner: [
                narrow(cropped.corner[0] - middle[0]),
                narrow(cropped.corner[1] - middle[1]),
            ],
            per_cell: narrow(1.0 / cropped.cell),
            columns: u32::try_from(width).expect("invariant: at most CELLS_MAX cells"),
            cells,
        }
    }

    /// Bits of a cell that number the nearest wall; all 0 when none is in reach.
    pub(super) const LABEL: u32 = LABEL_MASK;
    /// The bit of a free cell.
    pub(super) const FREE: u32 = (FREE as u32) << STATE_SHIFT;

    /// The nearest wall of a cell, counted from 1; 0 when none is in reach.
    #[inline]
    pub(super) fn label(cell: u32) -> usize {
        (cell & LABEL_MASK) as usize
    }

    #[inline]
    pub(super) fn is_free(cell: u32) -> bool {
        cell & Self::FREE != 0
    }

    /// The cells at points of the local frame, state and label together; unknown outside.
    #[expect(clippy::inline_always, reason = "must take on the vector width of its caller")]
    #[inline(always)]
    pub(super) fn at_all<const N: usize>(&self, x: &[f32; N], y: &[f32; N]) -> [u32; N] {
        let (right, top) = (real(self.width - 1), real(self.height - 1));
        let mut cells = [0_u32; N];
        for i in 0..N {
            let column = clamped_index((x[i] - self.corner[0]) * self.per_cell, right);
            let row = clamped_index((y[i] - self.corner[1]) * self.per_cell, top);
            cells[i] = row * self.columns + column;
        }
        for cell in &mut cells {
            *cell = self.cells[*cell as usize];
        }
        cells
    }

    /// The cells of a row.
    #[inline]
    pub(super) fn row(&self, row: usize) -> &[u32] {
        &self.cells[row * self.width..][..self.width]
    }

    /// The state of a cell.
    #[inline]
    pub(super) fn state_of(cell: u32) -> u8 {
        (cell >> STATE_SHIFT).to_le_bytes()[0]
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

/// A key is a squared distance in cells above the lower bits of a label, so that the least key is the nearest wall.
const LABEL_BITS: u32 = 23;
const KEY_LABEL: u32 = (1 << LABEL_BITS) - 1;
/// Nothing is in reach.
const NONE: u32 = u32::MAX;

/// Cells of a row that are written or left alone together.
const BLOCK: usize = 64;

/// Both neighbours beside a cell are occupied (see [`Spans`]).
const BOTH: usize = 3;
/// Cells of a span, at least 2 k + 1.
const SPAN: usize = 48;
const _: () = assert!(2 * Cropped::REACH_MAX < SPAN && Cropped::REACH_MAX.pow(2) < 1 << (32 - LABEL_BITS));

/// What an occupied cell says of the rows about it: squared distances, shifted to their place in a key.
struct Spans {
    reach: usize,
    /// Cells of a span in use, a multiple of [`LANES`].
    used: usize,
    /// By the distance in rows, and by which neighbours beside are occupied too (1: left, 2: right): cells beyond an
    /// occupied neighbour are nearer to that one, and `NONE` here.
    keys: Vec<[[u32; SPAN]; 4]>,
}

impl Spans {
    fn new(reach: usize) -> Self {
        let key = |dy: usize, sides: usize, i: usize| {
            let square = i.abs_diff(reach).pow(2) + dy * dy;
            let shaded = (i < reach && sides & 1 != 0) || (i > reach && sides & 2 != 0);
            let key = u32::try_from(square << LABEL_BITS).unwrap_or(NONE);
            if square > reach * reach || shaded { NONE } else { key }
        };
        Self {
            reach,
            used: (2 * reach + 1).next_multiple_of(LANES),
            keys: (0..=reach)
                .map(|dy| std::array::from_fn(|sides| std::array::from_fn(|i| key(dy, sides, i))))
                .collect(),
        }
    }
}

/// Fills the cells of a band of rows that begins at row `first`.
fn label_band(cropped: &Cropped, spans: &Spans, first: usize, cells: &mut [u32]) {
    let (width, reach) = (cropped.width, spans.reach);
    let last = first + cells.len() / width;
    // The keys of the rows that the present source row reaches, row y at y modulo their number.
    let (rows, stride) = (2 * reach + 1, width + SPAN);
    let mut ring = vec![NONE; rows * stride];
    let sources = first.saturating_sub(reach)..(last + reach).min(cropped.height);
    for source in sources.clone() {
        let targets = source.saturating_sub(reach).max(first)..(source + reach + 1).min(last);
        stamp(cropped, spans, source, targets, &mut ring, stride);
        // no later source reaches this row
        if let Some(done) = source.checked_sub(reach).filter(|done| (first..last).contains(done)) {
            emit(
                cropped,
                done,
                &mut ring[done % rows * stride..][..width],
                &mut cells[(done - first) * width..][..width],
                reach,
            );
        }
    }
    for done in sources.end.saturating_sub(reach).max(first)..last {
        emit(
            cropped,
            done,
            &mut ring[done % rows * stride..][..width],
            &mut cells[(done - first) * width..][..width],
            reach,
        );
    }
}

widest! {
    /// Puts the occupied cells of row `source` into the keys of the rows `targets`.
    fn stamp(
        cropped: &Cropped,
        spans: &Spans,
        source: usize,
        targets: std::ops::Range<usize>,
        ring: &mut [u32],
        stride: usize,
    ) {
        let (reach, used) = (spans.reach, spans.used);
        let rows = ring.len() / stride;
        let numbers = cropped.row_starts[source]..cropped.row_starts[source + 1];
        let occupied = |row: usize, column: usize| cropped.row(row)[column] == OCCUPIED;
        for (&index, number) in cropped.occupied[numbers.clone()].iter().zip(numbers) {
            let column = index as usize - source * cropped.width;
            let sides = usize::from(occupied(source, column - 1)) + 2 * usize::from(occupied(source, column + 1));
            // rows beyond an occupied neighbour are nearer to that one
            let from = if occupied(source - 1, column) { source } else { targets.start };
            let to = if occupied(source + 1, column) { source + 1 } else { targets.end };
            let label = short_label(number);
            let targets = from.max(targets.start)..to.min(targets.end);
            let mut slot = targets.start % rows;
            for row in targets {
                let span = &spans.keys[row.abs_diff(source)][sides];
                let keys = &mut ring[slot * stride + column - reach..][..used];
                slot = if slot + 1 == rows { 0 } else { slot + 1 };
                if sides == BOTH {
                    // nearest in its own column alone
                    keys[reach] = keys[reach].min(span[reach] | label);
                    continue;
                }
                for (key, span) in keys.iter_mut().zip(&span[..used]) {
                    *key = (*key).min(span | label);
                }
            }
        }
    }
}

fn short_label(number: usize) -> u32 {
    u32::try_from(number & KEY_LABEL as usize).expect("invariant: masked to 23 bits")
}

widest! {
    /// Writes a row of cells, which are 0, from its states and keys, and clears the keys. What is unknown and out of reach
    /// stays as it is, so that the memory of large unknown areas is never touched.
    fn emit(cropped: &Cropped, row: usize, keys: &mut [u32], cells: &mut [u32], reach: usize) {
        // All walls in reach are numbered from this one on, and fewer than the label's bits tell apart.
        let base = cropped.row_starts[row.saturating_sub(reach)];
        let (base, low) = (u32::try_from(base).expect("invariant: at most CELLS_MAX cells"), short_label(base));
        let blocks = cells.chunks_mut(BLOCK).zip(keys.chunks_mut(BLOCK)).zip(cropped.row(row).chunks(BLOCK));
        for ((cells, keys), states) in blocks {
            let known = states.iter().fold(0, |all, state| all | state);
            let nearest = keys.iter().fold(NONE, |all, key| all & key);
            if known == UNKNOWN && nearest == NONE {
                continue;
            }
            for ((cell, key), &state) in cells.iter_mut().zip(keys).zip(states) {
                let label = base + (key.wrapping_sub(low) & KEY_LABEL) + 1;
                let label = if *key == NONE { 0 } else { label };
                *cell = u32::from(state) << STATE_SHIFT | label;
                *key = NONE;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose2;
    use crate::grid::{Lattice, LogOdds, OccupancyGrid};
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
            let cells = CellMap::new(&cropped, [0.0, 0.0]);
            let occupied = &cropped.occupied;
            for row in 0..cells.height {
                for column in 0..cells.width {
                    let (x, y) = cells.center(column, row);
                    let square = |index: u32| {
                        let (c, r) = (index as usize % cells.width, index as usize / cells.width);
                        c.abs_diff(column).pow(2) + r.abs_diff(row).pow(2)
                    };
                    let nearest = occupied.iter().map(|&index| square(index)).min();
                    let [cell] = cells.at_all(&[x], &[y]);
                    let label = CellMap::label(cell);
                    prop_assert_eq!(CellMap::state_of(cell), cropped.row(row)[column]);
                    match nearest {
                        Some(nearest) if nearest <= cropped.reach.pow(2) => {
                            prop_assert!(label > 0);
                            prop_assert_eq!(square(occupied[label - 1]), nearest);
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
