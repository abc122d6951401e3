//! What the method computes of one map alone.

use rayon::prelude::*;

use super::cells::CellMap;
use super::cropped::{BAND, Cropped, FREE};
use super::num::{clamped_index, narrow, real, real64, round64};
use super::params::HoughParameters;
use super::placement::Moments;
use super::simd::{LANES, widest};
use super::spectrum::Spectrum;
use super::walls::{Wall, walls};
use crate::geometry::{Angle, Pose2};
use crate::grid::OccupancyGrid;

/// Side of the squares of which each gives one wall sample, and of the blocks of free space, metres.
pub(super) const SAMPLE_M: f64 = 0.1;

/// See the module. All coordinates are local (see `placement`), metres.
#[derive(Debug)]
pub(super) struct Features {
    /// Pose of the local frame in the map's frame.
    pub(super) frame: Pose2,
    pub(super) cells: CellMap,
    /// One for each occupied cell, in row-major order, from 1 on: what the labels of `cells` number. The first is nowhere.
    pub(super) walls: Vec<Wall>,
    /// At most one wall of each square of [`SAMPLE_M`].
    pub(super) samples: Vec<Wall>,
    /// Metres of wall that one sample stands for.
    pub(super) sample_m: f32,
    pub(super) moments: Moments,
    pub(super) spectrum: Spectrum,
    pub(super) free: FreeBlocks,
    /// Corners of the convex hull of the known area.
    pub(super) hull: Vec<(f32, f32)>,
    /// Known cells.
    pub(super) known: usize,
    /// Orders the two maps of a pair, so that both ways round give the same search.
    pub(super) order: (usize, u64),
}

/// The share of free cells in blocks of about [`SAMPLE_M`], smoothed with (1 2 1)/4 both ways.
#[derive(Debug)]
pub(super) struct FreeBlocks {
    width: usize,
    height: usize,
    per_block: f32,
    corner: [f32; 2],
    share: Vec<u8>,
}

impl Features {
    /// `None` when the map has no occupied cell.
    pub(super) fn new(map: &OccupancyGrid, parameters: &HoughParameters) -> Option<Self> {
        let cropped = Cropped::new(map, parameters.reach_m.max(10.0 * map.lattice().resolution()))?;
        if cropped.occupied.is_empty() {
            return None;
        }
        let middle = middle_of(&cropped);
        let block = round64(SAMPLE_M / cropped.cell).max(1);
        let sample_m = narrow(real64(block) * cropped.cell);
        let ((walls, samples, spectrum), (cells, (free, hull))) = rayon::join(
            || {
                let walls = walls(&cropped, middle);
                let samples = samples(&cropped, &walls[1..], block);
                let spectrum = Spectrum::new(&samples, sample_m.max(narrow(SAMPLE_M)));
                (walls, samples, spectrum)
            },
            || {
                rayon::join(
                    || CellMap::new(&cropped, middle),
                    || (FreeBlocks::new(&cropped, block, middle), hull(&cropped, middle)),
                )
            },
        );
        Some(Self {
            frame: map.lattice().origin() * Pose2::new(middle[0], middle[1], Angle::ZERO),
            moments: moments(&samples),
            order: (samples.len(), fingerprint(cropped.states())),
            known: cropped.known,
            spectrum,
            cells,
            walls,
            samples,
            sample_m,
            free,
            hull,
        })
    }

    /// Metres of wall.
    pub(super) fn structure_m(&self) -> f64 {
        real64(self.samples.len()) * f64::from(self.sample_m)
    }
}

/// The middle of the bounding box of the occupied cells, in lattice metres.
fn middle_of(cropped: &Cropped) -> [f64; 2] {
    let (mut x0, mut x1) = (u32::MAX, 0);
    let row_of = |index: u32| index as usize / cropped.width;
    for (row, ends) in cropped.row_starts.windows(2).enumerate() {
        if let [first, .., last] | [first @ last] = &cropped.occupied[ends[0]..ends[1]] {
            let start = u32::try_from(row * cropped.width).expect("invariant: at most CELLS_MAX cells");
            (x0, x1) = (x0.min(first - start), x1.max(last - start));
        }
    }
    let rows = [cropped.occupied.first(), cropped.occupied.last()].map(|cell| cell.map_or(0, |&index| row_of(index)));
    let half = |a: usize, b: usize| 0.5 * real64(a + b + 1) * cropped.cell;
    [
        cropped.corner[0] + half(x0 as usize, x1 as usize),
        cropped.corner[1] + half(rows[0], rows[1]),
    ]
}

/// The first wall of each block of `block` x `block` cells, in row-major order of the cells.
fn samples(cropped: &Cropped, walls: &[Wall], block: usize) -> Vec<Wall> {
    // The strip of blocks whose sample of this column of blocks was taken last.
    let mut taken = vec![usize::MAX; cropped.width.div_ceil(block)];
    let mut samples = Vec::with_capacity(walls.len() / block + 1);
    for (row, ends) in cropped.row_starts.windows(2).enumerate() {
        let strip = row / block;
        let numbers = ends[0]..ends[1];
        for (&index, wall) in cropped.occupied[numbers.clone()].iter().zip(&walls[numbers]) {
            let column = (index as usize - row * cropped.width) / block;
            if std::mem::replace(&mut taken[column], strip) != strip {
                samples.push(*wall);
            }
        }
    }
    samples
}

fn moments(samples: &[Wall]) -> Moments {
    let n = real64(samples.len().max(1));
    let sum = samples.iter().fold([0.0_f64; 3], |[x, y, s], wall| {
        let (wx, wy) = (f64::from(wall.x), f64::from(wall.y));
        [x + wx, y + wy, s + wx * wx + wy * wy]
    });
    Moments {
        mean: [sum[0] / n, sum[1] / n],
        mean_square: sum[2] / n,
    }
}

/// FNV-1a over words of eight cells, four words at a time: only to order two maps with equally many samples.
fn fingerprint(states: &[u8]) -> u64 {
    let (groups, rest) = states.as_chunks::<32>();
    let mut hashes = [0xcbf2_9ce4_8422_2325_u64; 4];
    let mut add = |group: &[u8; 32]| {
        for (hash, word) in hashes.iter_mut().zip(group.as_chunks::<8>().0) {
            *hash = (*hash ^ u64::from_le_bytes(*word)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    groups.iter().for_each(&mut add);
    let mut last = [0; 32];
    last[..rest.len()].copy_from_slice(rest);
    add(&last);
    hashes.into_iter().fold(0, |all, hash| all.rotate_left(16) ^ hash)
}

impl FreeBlocks {
    fn new(cropped: &Cropped, block: usize, middle: [f64; 2]) -> Self {
        let (width, height) = (cropped.width.div_ceil(block), cropped.height.div_ceil(block));
        let mut counts = vec![0_u16; width * height];
        counts
            .par_chunks_mut(width * BAND)
            .zip(cropped.states().par_chunks(cropped.width * block * BAND))
            .for_each(|(counts, states)| {
                let rows = states.chunks(cropped.width * block);
                for (counts, rows) in counts.chunks_exact_mut(width).zip(rows) {
                    count_free(rows, cropped.width, block, counts);
                }
            });
        // At most 22^2 free cells a block: the smoothed sum of 16 blocks fits u16, and 255 of it in 24 bits u32.
        let full = u32::try_from(16 * block * block).expect("invariant: blocks are small");
        let scale = (255 << 24) / full;
        let mut share = vec![0_u8; width * height];
        if width > 2 && height > 2 {
            share[width..(height - 1) * width]
                .par_chunks_mut(width)
                .zip(counts.par_windows(3 * width).step_by(width))
                .with_min_len(BAND)
                .for_each(|(share, rows)| smooth(rows, scale, share));
        }
        Self {
            width,
            height,
            per_block: narrow(1.0 / (real64(block) * cropped.cell)),
            corner: [
                narrow(cropped.corner[0] - middle[0]),
                narrow(cropped.corner[1] - middle[1]),
            ],
            share,
        }
    }

    /// Fills `line` with the share of free space, in [0, 1], at `start + i * step`.
    pub(super) fn along(&self, start: (f32, f32), step: (f32, f32), line: &mut [f32]) {
        let u = ((start.0 - self.corner[0]) * self.per_block, step.0 * self.per_block);
        let v = ((start.1 - self.corner[1]) * self.per_block, step.1 * self.per_block);
        walk(self, u, v, line);
    }
}

widest! {
    /// From the block coordinates `(start, step)` on.
    fn walk(blocks: &FreeBlocks, u: (f32, f32), v: (f32, f32), line: &mut [f32]) {
        let (right, top) = (real(blocks.width - 1), real(blocks.height - 1));
        let columns = short_count(blocks.width);
        for (group, out) in line.chunks_mut(LANES).enumerate() {
            let mut index = [0_u32; LANES];
            for (i, index) in index.iter_mut().enumerate() {
                let along = real(group * LANES + i);
                let column = clamped_index(u.0 + along * u.1, right);
                let row = clamped_index(v.0 + along * v.1, top);
                *index = row * columns + column;
            }
            for (out, index) in out.iter_mut().zip(index) {
                *out = f32::from(blocks.share[index as usize]) / 255.0;
            }
        }
    }
}

widest! {
    /// Adds up the free cells of each block of a strip of rows.
    fn count_free(rows: &[u8], width: usize, block: usize, counts: &mut [u16]) {
        match block {
            2 => count_pairs(rows, width, counts),
            _ => {
                for row in rows.chunks_exact(width) {
                    for (count, cells) in counts.iter_mut().zip(row.chunks(block)) {
                        *count += cells.iter().map(|&state| u16::from(state & FREE)).sum::<u16>();
                    }
                }
            }
        }
    }
}

/// [`count_free`] for blocks of 2 x 2, the usual ones.
#[expect(clippy::inline_always, reason = "must take on the vector width of its caller")]
#[inline(always)]
fn count_pairs(rows: &[u8], width: usize, counts: &mut [u16]) {
    for row in rows.chunks_exact(width) {
        let (pairs, rest) = row.as_chunks::<2>();
        for (count, [a, b]) in counts.iter_mut().zip(pairs) {
            *count += u16::from((a & FREE) + (b & FREE));
        }
        if let (Some(count), [last]) = (counts.last_mut(), rest) {
            *count += u16::from(last & FREE);
        }
    }
}

widest! {
    /// The middle one of three rows of counts, smoothed; 0 at its ends. `scale` is 255 in 24 bits over the sum of full blocks.
    fn smooth(rows: &[u16], scale: u32, share: &mut [u8]) {
        const TOGETHER: usize = 64;
        let width = share.len();
        let (below, rest) = rows.split_at(width);
        let (here, above) = rest.split_at(width);
        let mut columns = [0_u16; TOGETHER + 2];
        for (group, share) in share[1..width - 1].chunks_mut(TOGETHER).enumerate() {
            let from = group * TOGETHER;
            let rows = [below, here, above].map(|row| &row[from..from + share.len() + 2]);
            for (i, column) in columns[..share.len() + 2].iter_mut().enumerate() {
                *column = rows[0][i] + 2 * rows[1][i] + rows[2][i];
            }
            for (i, share) in share.iter_mut().enumerate() {
                let sum = u32::from(columns[i] + 2 * columns[i + 1] + columns[i + 2]);
                *share = ((sum * scale) >> 24).to_le_bytes()[0];
            }
        }
    }
}

/// A count that is known to be small.
fn short_count(count: usize) -> u32 {
    u32::try_from(count).expect("invariant: at most CELLS_MAX cells")
}

/// Convex hull (Andrew's monotone chain) of the known cells' corners, line by line.
fn hull(cropped: &Cropped, middle: [f64; 2]) -> Vec<(f32, f32)> {
    // Of each line between rows, the outermost corners of the cells below and above it.
    let mut points: Vec<(f64, f64)> = Vec::with_capacity(2 * cropped.height + 2);
    let mut before: Option<(usize, usize)> = None;
    for line in 0..=cropped.height {
        let next = (line < cropped.height).then(|| cropped.known_ends(line)).flatten();
        let ends = match (before, next) {
            (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
            (a, b) => a.or(b),
        };
        if let Some((first, end)) = ends {
            points.extend([first, end].map(|column| (real64(line), real64(column))));
        }
        before = next;
    }
    let turns_left =
        |a: (f64, f64), b: (f64, f64), c: (f64, f64)| (b.0 - a.0) * (c.1 - a.1) > (b.1 - a.1) * (c.0 - a.0);
    let chain = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut line: Vec<(f64, f64)> = Vec::new();
        for point in points {
            while line.len() >= 2 && !turns_left(line[line.len() - 2], line[line.len() - 1], point) {
                line.pop();
            }
            line.push(point);
        }
        line
    };
    let mut outline = chain(&mut points.iter().copied());
    outline.extend(chain(&mut points.iter().rev().copied()));
    outline
        .into_iter()
        .map(|(row, column)| {
            (
                narrow(cropped.corner[0] + column * cropped.cell - middle[0]),
                narrow(cropped.corner[1] + row * cropped.cell - middle[1]),
            )
        })
        .collect()
}
