//! The Hough spectrum of a map: how much straight wall runs in each direction.
//!
//! Convention: a line of direction theta has the normal form rho = x cos(theta) + y sin(theta); turning the map by psi
//! turns theta by psi.
//! Method: (1) H(theta, rho) counts wall samples, split linearly between two bins of rho (paper section 4.1);
//! (2) s(theta)^2 = sum over rho of max(0, H - mean of H over 9 bins)^2.
//! Shapes and units: 180 directions, 1 degree apart, or a power of two times as many; rho bins of 0.1 m or one sample's length, if longer. Votes are whole
//! numbers of 2^-12, the two parts of a vote side by side in 64 bits: one addition casts it, and sums are exact.
//! Great maps: what lies far apart shares no line but by chance, and a degree is metres at their rim. A map that reaches
//! further than 150 m from its middle is cut into squares of 100 m, of which each has lines of its own, (2) is summed over
//! them, and the directions are as many times finer as the map reaches further.
//! Cost: a vectorised product and one addition in the first cache for each sample and direction.
//! Differences from the paper: it takes the maximum of each column (right at rank 1 in .754, and at rank 4 in .982 of 272
//! pairs, where the sum of squares has .772 and 1.000); the high pass removes what clutter and the map's outline add to all
//! directions alike. The root keeps the longest corridors from deciding alone: two maps may share a wing that is the
//! longest of neither. Of 386 pairs the true rotation is among the candidates in 384, in 379 without the root.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::num::{index, real, short_index};
use super::simd::{LANES, widest};
use super::walls::Wall;

/// Directions of the spectrum: one a degree, since a line has no front.
pub(super) const DIRECTIONS: usize = 180;
/// More samples, of one square, add nothing to the spectrum.
const SAMPLES_MAX: usize = 10_000;
/// A map that reaches no further from its middle has one spectrum of whole degrees, metres: half a degree is a metre
/// there, which the refinement makes good.
const REACH_M: f32 = 150.0;
/// Side of the squares of a greater one, metres.
const SQUARE_M: f32 = 100.0;
/// The most directions of a degree.
const FINEST: usize = 32;
const HALF_WINDOW: usize = 4;
/// A whole vote: 9 bins of 10,000 votes stay below 2^31.
const VOTE: u32 = 1 << VOTE_BITS;
const VOTE_BITS: u32 = 12;

/// Straight wall by direction.
#[derive(Debug)]
pub(super) struct Spectrum {
    /// Directions of each degree, a power of two.
    per_degree: usize,
    /// Its mean removed.
    values: Vec<f32>,
}

impl Spectrum {
    /// The spectrum of samples in the local frame; `bin` metres of rho.
    pub(super) fn new(samples: &[Wall], bin: f32) -> Self {
        let reach = samples.iter().map(|wall| wall.x.hypot(wall.y)).fold(0.0, f32::max);
        let per_degree = index((reach / REACH_M).ceil()).clamp(1, FINEST).next_power_of_two();
        let squares: Vec<Points> = if per_degree == 1 {
            vec![Points::new(samples, bin)]
        } else {
            squares(samples).iter().map(|square| Points::new(square, bin)).collect()
        };
        let bins = squares.iter().map(|points| points.bins).max().unwrap_or_default();
        let mut values: Vec<f32> = (0..DIRECTIONS * per_degree)
            .into_par_iter()
            .with_min_len(45)
            .map_init(
                || (vec![0_u64; bins], vec![0_u32; bins + 1]),
                |(votes, sums), direction| {
                    let sin_cos = (real(direction) / real(per_degree)).to_radians().sin_cos();
                    let energy_of = |points: &Points| {
                        let votes = &mut votes[..points.bins];
                        votes.fill(0);
                        vote(points, sin_cos, votes);
                        energy(votes, &mut sums[..=points.bins])
                    };
                    squares.iter().map(energy_of).sum::<f32>().sqrt()
                },
            )
            .collect();
        let mean = values.iter().sum::<f32>() / real(values.len());
        for value in &mut values {
            *value -= mean;
        }
        Self { per_degree, values }
    }

    /// Directions of each degree that two spectra have both.
    pub(super) fn common(&self, other: &Self) -> usize {
        self.per_degree.min(other.per_degree)
    }

    /// So many directions of each degree, at most as many as there are; a power of two.
    pub(super) fn thinned(&self, per_degree: usize) -> Vec<f32> {
        self.values
            .iter()
            .copied()
            .step_by(self.per_degree / per_degree)
            .collect()
    }
}

/// The samples of each square, seen from its middle.
fn squares(samples: &[Wall]) -> Vec<Vec<Wall>> {
    let mut squares: BTreeMap<[i32; 2], Vec<Wall>> = BTreeMap::new();
    for wall in samples {
        let [column, row] = [wall.x, wall.y].map(|at| (at / SQUARE_M).floor());
        let wall = Wall {
            x: wall.x - (column + 0.5) * SQUARE_M,
            y: wall.y - (row + 0.5) * SQUARE_M,
            ..*wall
        };
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a map has at most 2^32 cells a side of at most 100 m"
        )]
        squares.entry([column as i32, row as i32]).or_default().push(wall);
    }
    squares.into_values().collect()
}

/// Samples in bins.
struct Points {
    /// Neighbouring samples of a wall would vote for one bin, each waiting for the last: those of a group are far apart.
    groups: Vec<[[f32; LANES]; 2]>,
    /// What does not fill a group.
    rest: Vec<(f32, f32)>,
    bins: usize,
    /// The bin of rho = 0.
    middle: f32,
}

impl Points {
    fn new(samples: &[Wall], bin: f32) -> Self {
        let stride = samples.len().div_ceil(SAMPLES_MAX).max(1);
        let points: Vec<(f32, f32)> = samples
            .iter()
            .step_by(stride)
            .map(|wall| (wall.x / bin, wall.y / bin))
            .collect();
        let square = points.iter().map(|(x, y)| x * x + y * y).fold(0.0, f32::max);
        let middle = square.sqrt().ceil() + 1.0 + real(HALF_WINDOW);
        let count = points.len() / LANES;
        let groups = (0..count).map(|group| {
            let point = |lane: usize| points[lane * count + group];
            [
                std::array::from_fn(|lane| point(lane).0),
                std::array::from_fn(|lane| point(lane).1),
            ]
        });
        Self {
            groups: groups.collect(),
            rest: points[count * LANES..].to_vec(),
            bins: 2 * index(middle) + 2,
            middle,
        }
    }
}

widest! {
    /// Equation (1) for one direction: the part of a vote for its lower bin in the lower half, for the next bin above it.
    fn vote(points: &Points, sin_cos: (f32, f32), votes: &mut [u64]) {
        let whole = real(VOTE as usize);
        let (sin, cos, middle) = (sin_cos.0 * whole, sin_cos.1 * whole, points.middle * whole);
        let mut cast = |rho: u32| {
            let part = rho % VOTE;
            votes[(rho / VOTE) as usize] += u64::from(VOTE - part) | u64::from(part) << 32;
        };
        for [x, y] in &points.groups {
            let mut rho = [0; LANES];
            for i in 0..LANES {
                rho[i] = short_index(x[i] * cos + y[i] * sin + middle);
            }
            rho.into_iter().for_each(&mut cast);
        }
        for (x, y) in &points.rest {
            cast(short_index(x * cos + y * sin + middle));
        }
    }
}

widest! {
    /// The square of equation (2). `sums` has one element more than `votes`; what it holds does not matter.
    fn energy(votes: &[u64], sums: &mut [u32]) -> f32 {
        let (mut sum, mut carried) = (0_u32, 0_u32);
        sums[0] = 0;
        for (out, vote) in sums[1..].iter_mut().zip(votes) {
            let [low, high] = [*vote, vote >> 32].map(|half| (half & 0xffff_ffff) as u32);
            sum += low + carried;
            carried = high;
            *out = sum;
        }
        // sums[b] is the sum of all bins below b
        let inner = votes.len() - 2 * HALF_WINDOW;
        let width = 2 * HALF_WINDOW + 1;
        let (first, last) = (&sums[..inner], &sums[width..][..inner]);
        let (from, to) = (&sums[HALF_WINDOW..][..inner], &sums[HALF_WINDOW + 1..][..inner]);
        let mut energy = [0.0_f32; LANES];
        let per_vote = 1.0 / real(width * VOTE as usize);
        for start in (0..inner).step_by(LANES) {
            for i in start..(start + LANES).min(inner) {
                let above = (to[i] - from[i]) * 9;
                let above = above.saturating_sub(last[i] - first[i]);
                let above = real(above as usize) * per_vote;
                energy[i - start] += above * above;
            }
        }
        energy.into_iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Equations (1) and (2) by their definition.
    fn direct(samples: &[Wall], bin: f32) -> Vec<f32> {
        let middle = 500.0;
        let values: Vec<f32> = (0..DIRECTIONS)
            .map(|direction| {
                let (sin, cos) = real(direction).to_radians().sin_cos();
                let mut column = vec![0.0_f32; 1000];
                for wall in samples {
                    let rho = (wall.x * cos + wall.y * sin) / bin + middle;
                    column[index(rho)] += 1.0 - rho.fract();
                    column[index(rho) + 1] += rho.fract();
                }
                column
                    .windows(9)
                    .map(|window| (window[4] - window.iter().sum::<f32>() / 9.0).max(0.0).powi(2))
                    .sum::<f32>()
                    .sqrt()
            })
            .collect();
        let mean = values.iter().sum::<f32>() / real(DIRECTIONS);
        values.iter().map(|value| value - mean).collect()
    }

    proptest! {
        #[test]
        fn the_spectrum_equals_its_definition(points in proptest::collection::vec((-20.0_f32..20.0, -20.0_f32..20.0), 1..200)) {
            let wall = |(x, y)| Wall { x, y, nx: 0.0, ny: 1.0, linearity: 1.0, strength: 0.0 };
            let samples: Vec<Wall> = points.into_iter().map(wall).collect();
            let (fast, slow) = (Spectrum::new(&samples, 0.1).values, direct(&samples, 0.1));
            let top = slow.iter().fold(1.0_f32, |top, value| top.max(value.abs()));
            for (fast, slow) in fast.iter().zip(&slow) {
                prop_assert!((fast - slow).abs() < 0.01 * top, "{fast} {slow}");
            }
        }
    }
}
