//! What the method computes of one map alone.

use super::cells::{CellMap, Cropped, FREE, UNKNOWN};
use super::num::{narrow, real, real64, round64};
use super::params::HoughParameters;
use super::placement::Moments;
use super::spectrum::{Spectrum, spectrum};
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
    /// One for each occupied cell, in row-major order: what the labels of `cells` number.
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
        let occupied = cropped.occupied();
        if occupied.is_empty() {
            return None;
        }
        let middle = middle_of(&cropped, &occupied);
        let block = round64(SAMPLE_M / cropped.cell).max(1);
        let (walls, (cells, (free, hull))) = rayon::join(
            || walls(&cropped, &occupied, middle),
            || {
                rayon::join(
                    || CellMap::new(&cropped, &occupied, middle),
                    || (FreeBlocks::new(&cropped, block, middle), hull(&cropped, middle)),
                )
            },
        );
        let samples = samples(&cropped, &occupied, &walls, block);
        let sample_m = narrow(real64(block) * cropped.cell);
        Some(Self {
            frame: map.lattice().origin() * Pose2::new(middle[0], middle[1], Angle::ZERO),
            moments: moments(&samples),
            spectrum: spectrum(&samples, sample_m.max(narrow(SAMPLE_M))),
            order: (samples.len(), fingerprint(&cropped.states)),
            known: cropped.states.iter().filter(|&&state| state != UNKNOWN).count(),
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
fn middle_of(cropped: &Cropped, occupied: &[u32]) -> [f64; 2] {
    let (mut x0, mut x1, mut y0, mut y1) = (usize::MAX, 0, usize::MAX, 0);
    for &index in occupied {
        let (x, y) = (index as usize % cropped.width, index as usize / cropped.width);
        (x0, x1, y0, y1) = (x0.min(x), x1.max(x), y0.min(y), y1.max(y));
    }
    let half = |a: usize, b: usize| 0.5 * real64(a + b + 1) * cropped.cell;
    [cropped.corner[0] + half(x0, x1), cropped.corner[1] + half(y0, y1)]
}

/// The first wall of each block of `block` x `block` cells, in row-major order of the cells.
fn samples(cropped: &Cropped, occupied: &[u32], walls: &[Wall], block: usize) -> Vec<Wall> {
    let columns = cropped.width.div_ceil(block);
    let mut taken = vec![false; columns];
    let mut strip = usize::MAX;
    let mut samples = Vec::with_capacity(occupied.len() / block + 1);
    for (&index, wall) in occupied.iter().zip(walls) {
        let (column, row) = (
            index as usize % cropped.width / block,
            index as usize / cropped.width / block,
        );
        if row != strip {
            taken.fill(false);
            strip = row;
        }
        if !std::mem::replace(&mut taken[column], true) {
            samples.push(*wall);
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

/// FNV-1a over eight cells at a time: only to order two maps with equally many samples.
fn fingerprint(states: &[u8]) -> u64 {
    states.chunks(8).fold(0xcbf2_9ce4_8422_2325, |hash, chunk| {
        let word = chunk.iter().fold(0_u64, |word, &state| word << 8 | u64::from(state));
        (hash ^ word).wrapping_mul(0x0100_0000_01b3)
    })
}

impl FreeBlocks {
    fn new(cropped: &Cropped, block: usize, middle: [f64; 2]) -> Self {
        let (width, height) = (cropped.width.div_ceil(block), cropped.height.div_ceil(block));
        let mut counts = vec![0_u16; width * height];
        for (y, row) in cropped.states.chunks_exact(cropped.width).enumerate() {
            let out = &mut counts[y / block * width..][..width];
            for (count, cells) in out.iter_mut().zip(row.chunks(block)) {
                *count += cells.iter().map(|&state| u16::from(state == FREE)).sum::<u16>();
            }
        }
        // At most 22^2 free cells a block: the smoothed sum of 16 blocks fits u16.
        let full = u32::try_from(16 * block * block).expect("invariant: blocks are small");
        let mut share = vec![0_u8; width * height];
        let mut lines = vec![0_u16; width];
        for y in 1..height.saturating_sub(1) {
            let [below, here, above] = [y - 1, y, y + 1].map(|row| &counts[row * width..][..width]);
            for (line, ((b, h), a)) in lines.iter_mut().zip(below.iter().zip(here).zip(above)) {
                *line = b + 2 * h + a;
            }
            for (out, window) in share[y * width + 1..].iter_mut().zip(lines.windows(3)) {
                let sum = u32::from(window[0]) + 2 * u32::from(window[1]) + u32::from(window[2]);
                *out = (sum * 255 / full).to_le_bytes()[0];
            }
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
        let u0 = (start.0 - self.corner[0]) * self.per_block;
        let v0 = (start.1 - self.corner[1]) * self.per_block;
        let (du, dv) = (step.0 * self.per_block, step.1 * self.per_block);
        let (right, top) = (real(self.width - 1), real(self.height - 1));
        for (i, out) in line.iter_mut().enumerate() {
            let u = (u0 + real(i) * du).clamp(0.0, right);
            let v = (v0 + real(i) * dv).clamp(0.0, top);
            let share = self.share[super::num::index(v) * self.width + super::num::index(u)];
            *out = f32::from(share) / 255.0;
        }
    }
}

/// Convex hull (Andrew's monotone chain) of the known cells' corners, row by row.
fn hull(cropped: &Cropped, middle: [f64; 2]) -> Vec<(f32, f32)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (y, row) in cropped.states.chunks_exact(cropped.width).enumerate() {
        let Some(first) = row.iter().position(|&state| state != UNKNOWN) else {
            continue;
        };
        let last = row.iter().rposition(|&state| state != UNKNOWN).unwrap_or(first);
        for column in [first, last + 1] {
            for line in [y, y + 1] {
                points.push((real64(line), real64(column)));
            }
        }
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
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
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
