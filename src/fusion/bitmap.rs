//! A yes or no for each cell of a map, 64 cells a word: sets of cells are counted, gone through and widened a word at a
//! time.

use rayon::prelude::*;

use crate::grid::{CellState, OccupancyGrid};

/// Cells in a word.
const WORD: usize = 64;

/// A set of cells of one lattice, row by row from the lowest; each row begins with a word of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Bitmap {
    width: usize,
    words: Vec<u64>,
}

impl Bitmap {
    /// The cells of a grid that are in such a state.
    pub(super) fn of(grid: &OccupancyGrid, such: impl Fn(CellState) -> bool + Sync) -> Self {
        let width = grid.lattice().width() as usize;
        let per_row = width.div_ceil(WORD);
        let mut words = vec![0; per_row * grid.lattice().height() as usize];
        words
            .par_chunks_mut(per_row)
            .zip(grid.cells().par_chunks(width))
            .with_min_len(16)
            .for_each(|(words, cells)| {
                for (word, cells) in words.iter_mut().zip(cells.chunks(WORD)) {
                    let mut said = [0_u8; WORD];
                    for (said, cell) in said.iter_mut().zip(cells) {
                        *said = u8::from(such(cell.state()));
                    }
                    *word = packed(&said);
                }
            });
        Self { width, words }
    }

    fn per_row(&self) -> usize {
        self.width.div_ceil(WORD)
    }

    /// How many cells are in the set.
    pub(super) fn count(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Whether a cell is in the set; the cell must be one of the lattice.
    pub(super) fn has(&self, column: u32, row: u32) -> bool {
        let (column, row) = (column as usize, row as usize);
        self.words[row * self.per_row() + column / WORD] >> (column % WORD) & 1 == 1
    }

    /// The cells of the set, (column, row), in row-major order.
    pub(super) fn cells(&self) -> impl Iterator<Item = (u32, u32)> {
        self.every(0, 1)
    }

    /// Every `step`-th cell of the set from the one at `first` on, in row-major order. `step` is at least 1.
    pub(super) fn every(&self, first: usize, step: usize) -> impl Iterator<Item = (u32, u32)> {
        let mut to_pass = first;
        let per_row = self.per_row();
        (0_usize..).zip(&self.words).flat_map(move |(index, &word)| {
            let here = word.count_ones() as usize;
            let chosen = if to_pass < here { (word, to_pass) } else { (0, 0) };
            let chosen = bits(chosen.0).skip(chosen.1).step_by(step);
            // what is left to pass in the words that follow
            to_pass = if to_pass < here {
                (step - 1) - (here - 1 - to_pass) % step
            } else {
                to_pass - here
            };
            let (row, first) = (short(index / per_row), short(index % per_row * WORD));
            chosen.map(move |bit| (first + bit, row))
        })
    }

    /// All cells of the lattice that are not in the set.
    pub(super) fn inverted(mut self) -> Self {
        let (per_row, beyond) = (self.per_row(), self.beyond());
        for row in self.words.chunks_mut(per_row) {
            for word in row.iter_mut() {
                *word = !*word;
            }
            row[per_row - 1] &= !beyond;
        }
        self
    }

    /// The bits of each row's last word that stand for no cell.
    fn beyond(&self) -> u64 {
        match self.width % WORD {
            0 => 0,
            used => u64::MAX << used,
        }
    }

    /// All cells with one of the set at most `reach` columns and at most `reach` rows away.
    pub(super) fn widened(mut self, reach: usize) -> Self {
        let (per_row, beyond) = (self.per_row(), self.beyond());
        self.words.par_chunks_mut(per_row).with_min_len(16).for_each(|row| {
            for step in steps(reach.min(self.width)) {
                spread_up(row, step);
                row[per_row - 1] &= !beyond;
            }
            for step in steps(reach.min(self.width)) {
                spread_down(row, step);
            }
        });
        let height = self.words.len() / per_row;
        for step in steps(reach.min(height)) {
            for index in (step * per_row..self.words.len()).rev() {
                self.words[index] |= self.words[index - step * per_row];
            }
        }
        for step in steps(reach.min(height)) {
            for index in step * per_row..self.words.len() {
                self.words[index - step * per_row] |= self.words[index];
            }
        }
        self
    }
}

fn short(count: usize) -> u32 {
    u32::try_from(count).expect("invariant: a lattice's sides fit 32 bits")
}

/// Bytes of 0 or 1 as the bits of a word: a multiplication brings those of eight bytes together in its highest byte.
fn packed(said: &[u8; WORD]) -> u64 {
    let bytes = said.as_chunks::<8>().0.iter().map(|eight| {
        let gathered = u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080);
        gathered >> 56
    });
    bytes.rev().fold(0, |word, byte| word << 8 | byte)
}

/// The places of the bits of a word, from the lowest.
fn bits(word: u64) -> impl Iterator<Item = u32> {
    let mut rest = word;
    std::iter::from_fn(move || {
        let bit = (rest != 0).then(|| rest.trailing_zeros())?;
        rest &= rest - 1;
        Some(bit)
    })
}

/// The moves that together spread a set by 0 to `reach`: each by as much as it is wide already, or what is left.
fn steps(reach: usize) -> impl Iterator<Item = usize> {
    let mut done = 0;
    std::iter::from_fn(move || {
        let step = (done + 1).min(reach - done);
        done += step;
        (step > 0).then_some(step)
    })
}

/// Adds the row moved towards higher columns.
fn spread_up(row: &mut [u64], by: usize) {
    let (words, bits) = (by / WORD, by % WORD);
    for index in (words..row.len()).rev() {
        let carried = (index > words && bits > 0).then(|| row[index - words - 1] >> (WORD - bits));
        row[index] |= row[index - words] << bits | carried.unwrap_or(0);
    }
}

/// Adds the row moved towards lower columns.
fn spread_down(row: &mut [u64], by: usize) {
    let (words, bits) = (by / WORD, by % WORD);
    for index in words..row.len() {
        let carried = (index + 1 < row.len() && bits > 0).then(|| row[index + 1] << (WORD - bits));
        row[index - words] |= row[index] >> bits | carried.unwrap_or(0);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::Pose2;
    use crate::grid::{Lattice, LogOdds};

    fn occupied(grid: &OccupancyGrid) -> Bitmap {
        Bitmap::of(grid, |state| state == CellState::Occupied)
    }

    fn maps() -> impl Strategy<Value = OccupancyGrid> {
        let sides = (1_u32..200, 1_u32..20, 1_usize..300);
        sides
            .prop_flat_map(|(width, height, one_in)| {
                let cells = proptest::collection::vec(0..one_in, (width * height) as usize);
                (Just((width, height)), cells)
            })
            .prop_map(|((width, height), cells)| {
                let lattice = Lattice::new(width, height, 0.1, Pose2::IDENTITY).expect("valid");
                let cells = cells.iter().map(|&cell| match cell {
                    0 => LogOdds::OCCUPIED,
                    _ => LogOdds::FREE,
                });
                OccupancyGrid::new(lattice, cells.collect()).expect("as many")
            })
    }

    proptest! {
        #[test]
        fn a_set_counts_and_tells_its_cells(grid in maps(), first in 0_usize..9, step in 1_usize..90) {
            let lattice = grid.lattice();
            let cells = (0..lattice.height()).flat_map(|row| (0..lattice.width()).map(move |column| (column, row)));
            let wanted: Vec<_> = cells.filter(|&(c, r)| grid.at(c, r).state() == CellState::Occupied).collect();
            let set = occupied(&grid);
            prop_assert_eq!(set.count(), wanted.len());
            prop_assert!(wanted.iter().all(|&(column, row)| set.has(column, row)));
            let all = usize::try_from(lattice.width() * lattice.height()).expect("few");
            prop_assert_eq!(set.clone().inverted().count(), all - wanted.len());
            prop_assert_eq!(set.every(first, step).collect::<Vec<_>>(),
                wanted.iter().copied().skip(first).step_by(step).collect::<Vec<_>>());
            prop_assert_eq!(set.cells().collect::<Vec<_>>(), wanted);
        }

        #[test]
        fn a_set_is_widened_as_its_definition_says(grid in maps(), reach in 0_usize..150) {
            let wide = occupied(&grid).widened(reach);
            let set: Vec<_> = occupied(&grid).cells().collect();
            let within = |a: u32, b: u32| a.abs_diff(b) as usize <= reach;
            let mut count = 0;
            for row in 0..grid.lattice().height() {
                for column in 0..grid.lattice().width() {
                    let wanted = set.iter().any(|&(c, r)| within(c, column) && within(r, row));
                    prop_assert_eq!(wide.has(column, row), wanted, "({}, {})", column, row);
                    count += usize::from(wanted);
                }
            }
            prop_assert_eq!(wide.count(), count); // none beyond the rows' ends
        }
    }
}
