//! The part of a map that is known, as states, and its occupied cells: what all other features are made of.
//!
//! Convention: lattice axes, row 0 the lowest. Cropped to what is known, with a border of unknown cells wider than the
//! reach of the labels (see `cells`) and than every window (see `walls`).
//! Shapes and units: one byte a cell.
//! Cost: one pass over the known bounding box of the map; the floor is reading 2 and writing 1 byte a cell.

use rayon::prelude::*;

use super::num::real64;
use super::simd::widest;
use crate::grid::{CellState, LogOdds, OccupancyGrid};

pub(super) const UNKNOWN: u8 = 0;
pub(super) const FREE: u8 = 1;
pub(super) const OCCUPIED: u8 = 2;

/// A map of more cells than this (in its known bounding box) is worked on at a coarser cell.
const CELLS_MAX: usize = 1 << 26;
/// Rows that one task works on.
pub(super) const BAND: usize = 64;

/// The cropped states of a map, not yet in the local frame.
pub(super) struct Cropped {
    /// Row by row, and [`Self::BEYOND`] unknown ones more.
    states: Vec<u8>,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Side of a cell in metres: the map's own, or a whole multiple.
    pub(super) cell: f64,
    /// Lattice coordinates in metres (not cells) of the lower-left corner of cell (0, 0).
    pub(super) corner: [f64; 2],
    /// Reach of the labels, cells.
    pub(super) reach: usize,
    /// Free and occupied cells.
    pub(super) known: usize,
    /// Row-major indices of the occupied cells, in order.
    pub(super) occupied: Vec<u32>,
    /// Where each row begins in `occupied`, and the end of the last.
    pub(super) row_starts: Vec<usize>,
}

impl Cropped {
    /// Squared distances are kept in 9 bits (see `cells`), so the reach may have at most 22 cells.
    pub(super) const REACH_MAX: usize = 22;
    /// A kernel may read so many cells from any cell on.
    pub(super) const BEYOND: usize = 64;

    /// Known cells of `map` with a border of `reach_m` metres; `None` when nothing is known.
    pub(super) fn new(map: &OccupancyGrid, reach_m: f64) -> Option<Self> {
        let resolution = map.lattice().resolution();
        let ([x0, x1], [y0, y1]) = known_box(map)?;
        // A finer cell than the packing of the labels allows is merged with its neighbours.
        let finest = reach_m / real64(Self::REACH_MAX - 1);
        let mut factor = super::num::ceil64(finest / resolution).max(1);
        while ((x1 - x0) / factor + 1) * ((y1 - y0) / factor + 1) > CELLS_MAX {
            factor += 1;
        }
        let cell = resolution * real64(factor);
        let reach = super::num::ceil64(reach_m / cell).clamp(2, Self::REACH_MAX);
        let border = reach + 1;
        let (inner_width, inner_height) = ((x1 - x0).div_ceil(factor), (y1 - y0).div_ceil(factor));
        let (width, height) = (inner_width + 2 * border, inner_height + 2 * border);
        let mut states = vec![UNKNOWN; width * height + Self::BEYOND];
        let bands: Vec<Band> = states[border * width..][..inner_height * width]
            .par_chunks_mut(BAND * width)
            .enumerate()
            .map(|(band, rows)| {
                let mut found = Band::default();
                for (j, row) in rows.chunks_exact_mut(width).enumerate() {
                    let y = band * BAND + j;
                    let inner = &mut row[border..border + inner_width];
                    if factor == 1 {
                        let from = (y0 + y) * map.lattice().width() as usize + x0;
                        states_of(&map.cells()[from..from + inner_width], inner);
                    } else {
                        merge_row(map, inner, [x0, x1], [y0 + y * factor, y1], factor);
                    }
                    found.add(inner, (border + y) * width + border);
                }
                found
            })
            .collect();
        let edge = real64(border) * cell;
        let mut row_starts = vec![0; border];
        let mut occupied = Vec::with_capacity(bands.iter().map(|band| band.occupied.len()).sum());
        for band in &bands {
            row_starts.extend(band.row_starts.iter().map(|start| occupied.len() + start));
            occupied.extend_from_slice(&band.occupied);
        }
        row_starts.resize(height + 1, occupied.len());
        Some(Self {
            states,
            width,
            height,
            cell,
            corner: [real64(x0) * resolution - edge, real64(y0) * resolution - edge],
            reach,
            known: bands.iter().map(|band| band.known).sum(),
            occupied,
            row_starts,
        })
    }

    /// All cells, row by row.
    pub(super) fn states(&self) -> &[u8] {
        &self.states[..self.width * self.height]
    }

    pub(super) fn row(&self, row: usize) -> &[u8] {
        &self.states[row * self.width..][..self.width]
    }

    /// The first known column of a row, and the one after the last.
    pub(super) fn known_ends(&self, row: usize) -> Option<(usize, usize)> {
        ends(self.row(row), |&state| state != UNKNOWN)
    }

    /// `N` cells from an index on, at most [`Self::BEYOND`]; those beyond the last row are unknown.
    #[inline]
    pub(super) fn cells_from<const N: usize>(&self, index: usize) -> &[u8; N] {
        self.states[index..]
            .first_chunk()
            .expect("invariant: kernels start within the map")
    }
}

/// What a band of rows has.
#[derive(Default)]
struct Band {
    known: usize,
    occupied: Vec<u32>,
    row_starts: Vec<usize>,
}

impl Band {
    /// Takes the next row, which begins at `index`.
    fn add(&mut self, row: &[u8], index: usize) {
        self.row_starts.push(self.occupied.len());
        self.known += known(row);
        let first = u32::try_from(index).expect("invariant: at most CELLS_MAX cells");
        let (words, rest) = row.as_chunks::<8>();
        let mut at = first;
        for word in words {
            // the bit of OCCUPIED, once for each byte, the first cell lowest
            let mut bits = u64::from_le_bytes(*word) & 0x0202_0202_0202_0202;
            while bits != 0 {
                self.occupied.push(at + bits.trailing_zeros() / 8);
                bits &= bits - 1;
            }
            at += 8;
        }
        for (index, &state) in (at..).zip(rest) {
            if state == OCCUPIED {
                self.occupied.push(index);
            }
        }
    }
}

/// Columns and rows of the known cells' bounding box, ends excluded.
fn known_box(map: &OccupancyGrid) -> Option<([usize; 2], [usize; 2])> {
    let width = map.lattice().width() as usize;
    let rows = map.cells().par_chunks_exact(width).enumerate();
    let boxes = rows.with_min_len(BAND).filter_map(|(y, row)| {
        let (first, end) = ends(row, |cell| cell.state() != CellState::Unknown)?;
        Some(([first, end], [y, y + 1]))
    });
    boxes.reduce_with(|(a, c), (b, d)| ([a[0].min(b[0]), a[1].max(b[1])], [c[0].min(d[0]), c[1].max(d[1])]))
}

/// The first known cell of a row, and the one after the last.
fn ends<T>(row: &[T], known: impl Fn(&T) -> bool) -> Option<(usize, usize)> {
    const TOGETHER: usize = 32;
    // without an early end, so that many cells are compared at once
    let any = |cells: &[T]| cells.iter().fold(false, |any, cell| any | known(cell));
    let from = row.chunks(TOGETHER).position(any)? * TOGETHER;
    let end = row.len() - row.rchunks(TOGETHER).position(any)? * TOGETHER;
    let first = row[from..].iter().position(&known)?;
    let last = row[..end].iter().rposition(&known)?;
    Some((from + first, last + 1))
}

widest! {
    fn states_of(cells: &[LogOdds], states: &mut [u8]) {
        for (state, cell) in states.iter_mut().zip(cells) {
            *state = cell.state() as u8;
        }
    }
}

widest! {
    fn known(row: &[u8]) -> usize {
        // few enough at a time for their count to stay in 8 bits
        row.chunks(128)
            .map(|cells| usize::from(cells.iter().map(|&state| u8::from(state != UNKNOWN)).sum::<u8>()))
            .sum()
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
