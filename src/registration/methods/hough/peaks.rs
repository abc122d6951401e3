//! The best local maxima of agreement less disagreement among all shifts.
//!
//! Method: S = A - lambda B of A + iB; (1) the greatest S of each run of cells, one pass; (2) runs that have more than the
//! least of the list so far are looked through; (3) a cell is a peak when none within two cells has more, and none before
//! it as much. Shifts wrap around.
//! Cost: one pass over the shifts while their row is in the first cache; (2) and (3) touch little.

use rustfft::num_complex::Complex32;

use super::simd::{LANES, widest};

/// Cells of a run.
const RUN: usize = 16;
/// Peaks at or below this are not worth a look: a fifth of a metre of wall.
const LEAST: f32 = 1.0;

/// A local maximum, with S for each lambda.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Peak {
    pub(super) column: usize,
    pub(super) row: usize,
    pub(super) scores: [f32; 2],
}

/// The greatest S of each run of each row, for both lambdas.
pub(super) struct Tops {
    width: usize,
    lambdas: [f32; 2],
    runs: Vec<[f32; 2]>,
}

impl Tops {
    pub(super) fn new(width: usize, height: usize, lambdas: [f32; 2]) -> Self {
        Self {
            width,
            lambdas,
            runs: Vec::with_capacity(height * width.div_ceil(RUN)),
        }
    }

    /// Takes the next row.
    pub(super) fn push(&mut self, row: &[Complex32]) {
        top_of_runs(row, self.lambdas, &mut self.runs);
    }

    /// The best `list` peaks of `data`, whose rows were all pushed, for each lambda, the best first.
    pub(super) fn peaks(&self, data: &[Complex32], list: usize) -> Vec<Peak> {
        let (width, lambdas) = (self.width, self.lambdas);
        let runs = width.div_ceil(RUN);
        let field = Field {
            data,
            width,
            height: self.runs.len() / runs,
        };
        let mut found = Vec::new();
        for (which, lambda) in lambdas.into_iter().enumerate() {
            let mut best: Vec<(f32, usize)> = Vec::with_capacity(list + 1);
            let mut least = LEAST;
            for (run, top) in self.runs.iter().enumerate() {
                if top[which] <= least {
                    continue;
                }
                let row = run / runs * width;
                let start = run % runs * RUN;
                let indices = row + start..row + (start + RUN).min(width);
                for (index, &cell) in indices.clone().zip(&data[indices]) {
                    let value = score(cell, lambda);
                    if value > least && field.is_peak(index, value, lambda) {
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
                scores: lambdas.map(|lambda| score(data[index], lambda)),
            }));
        }
        found
    }
}

widest! {
    /// Equation (1).
    fn top_of_runs(row: &[Complex32], lambdas: [f32; 2], tops: &mut Vec<[f32; 2]>) {
        let (whole, rest) = row.as_chunks::<RUN>();
        for cells in whole {
            let (mut first, mut second) = ([f32::MIN; LANES], [f32::MIN; LANES]);
            for cells in cells.as_chunks::<LANES>().0 {
                for i in 0..LANES {
                    first[i] = greater(first[i], score(cells[i], lambdas[0]));
                    second[i] = greater(second[i], score(cells[i], lambdas[1]));
                }
            }
            tops.push([greatest(&first), greatest(&second)]);
        }
        if !rest.is_empty() {
            let mut top = [f32::MIN; 2];
            for &cell in rest {
                top[0] = greater(top[0], score(cell, lambdas[0]));
                top[1] = greater(top[1], score(cell, lambdas[1]));
            }
            tops.push(top);
        }
    }
}

#[inline]
fn greatest(lanes: &[f32; LANES]) -> f32 {
    let mut half = [f32::MIN; LANES / 2];
    for i in 0..LANES / 2 {
        half[i] = greater(lanes[i], lanes[i + LANES / 2]);
    }
    greater(greater(half[0], half[1]), greater(half[2], half[3]))
}

#[inline]
fn score(cell: Complex32, lambda: f32) -> f32 {
    cell.re - lambda * cell.im
}

/// One instruction, unlike `f32::max`, which minds what is not a number.
#[inline]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// All shifts.
struct Field<'a> {
    data: &'a [Complex32],
    width: usize,
    height: usize,
}

impl Field<'_> {
    /// Equation (3).
    fn is_peak(&self, index: usize, value: f32, lambda: f32) -> bool {
        let (column, row) = (index % self.width, index / self.width);
        (0..5).all(|dy| {
            let line = (row + self.height + dy - 2) % self.height * self.width;
            (0..5).all(|dx| {
                let other = line + (column + self.width + dx - 2) % self.width;
                let rival = score(self.data[other], lambda);
                rival < value || other == index || (rival <= value && other > index)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_peaks_are_the_best_of_all_local_maxima(values in proptest::collection::vec((0_u8..50, 0_u8..9), 37 * 9)) {
            let (width, height, lambdas, list) = (37, 9, [2.0, 0.5], 4);
            let data: Vec<Complex32> = values.iter().map(|&(re, im)| Complex32::new(re.into(), im.into())).collect();
            let mut tops = Tops::new(width, height, lambdas);
            data.chunks_exact(width).for_each(|row| tops.push(row));
            let found = tops.peaks(&data, list);
            let field = Field { data: &data, width, height };
            let mut slow = Vec::new();
            for lambda in lambdas {
                let mut all: Vec<(f32, usize)> = (0..data.len())
                    .map(|index| (score(data[index], lambda), index))
                    .filter(|&(value, index)| value > LEAST && field.is_peak(index, value, lambda))
                    .collect();
                all.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
                slow.extend(all.into_iter().take(list).map(|(_, index)| (index % width, index / width)));
            }
            let found: Vec<(usize, usize)> = found.iter().map(|peak| (peak.column, peak.row)).collect();
            prop_assert_eq!(found, slow);
        }
    }
}
