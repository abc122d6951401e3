//! A map at the coarse cell of the translation search, turned by a candidate rotation.
//!
//! Method: wall samples are turned BEFORE they are counted into cells (a turned raster has holes); free space is smooth,
//! and is looked up at each coarse cell's centre. O = wall in the cell over the cell's side, at most 1; F = share of free
//! space, 0 where there is wall.

#![expect(clippy::many_single_char_names, reason = "the letters of the formulas")]

use rayon::prelude::*;

use super::features::Features;
use super::num::{floor, index, real};

/// Rows that one task works on at least.
const TOGETHER: usize = 32;

/// Row-major coarse cells, row 0 lowest. Cell (i, j) has its centre at `corner + (i + 0.5, j + 0.5) * cell`.
#[derive(Debug)]
pub(super) struct Raster {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) corner: (f32, f32),
    /// By which the map is turned, radians.
    pub(super) rotation: f64,
    pub(super) occupied: Vec<f32>,
    pub(super) free: Vec<f32>,
}

impl Raster {
    /// The map turned about its local origin; `cell` metres.
    pub(super) fn new(map: &Features, rotation: f64, cell: f32) -> Self {
        let (corner, width, height) = bounds(map, rotation, cell);
        let (sin, cos) = sin_cos(rotation);
        let mut occupied = vec![0.0_f32; width * height];
        let part = map.sample_m / cell;
        for wall in &map.samples {
            let (x, y) = (cos * wall.x - sin * wall.y, sin * wall.x + cos * wall.y);
            let (i, j) = (index((x - corner.0) / cell), index((y - corner.1) / cell));
            occupied[j.min(height - 1) * width + i.min(width - 1)] += part;
        }
        let mut free = vec![0.0_f32; width * height];
        let rows = free
            .par_chunks_exact_mut(width)
            .zip(occupied.par_chunks_exact_mut(width));
        rows.enumerate().with_min_len(TOGETHER).for_each(|(j, (free, walls))| {
            let (x, y) = (corner.0 + 0.5 * cell, corner.1 + (real(j) + 0.5) * cell);
            // back into the map's own axes
            let start = (cos * x + sin * y, cos * y - sin * x);
            map.free.along(start, (cos * cell, -sin * cell), free);
            for (free, wall) in free.iter_mut().zip(walls) {
                if *wall > 0.0 {
                    *free = 0.0;
                    *wall = wall.min(1.0);
                }
            }
        });
        Self {
            width,
            height,
            corner,
            rotation,
            occupied,
            free,
        }
    }

    /// O spread to its neighbours (weights .6 and .35 across a side and a corner), at most 1: a wall may be found one cell
    /// aside.
    pub(super) fn spread(&self) -> Vec<f32> {
        self.around(|window, out| {
            let [a, b, c] = window;
            *out = (0.35 * (a[0] + a[2] + c[0] + c[2]) + 0.6 * (a[1] + b[0] + b[2] + c[1]) + b[1]).min(1.0);
        })
    }

    /// F, but 0 next to wall: a wall that grazes free space by one cell is no contradiction.
    pub(super) fn eroded(&self) -> Vec<f32> {
        let mut free = self.around(|[a, b, c], out| {
            let walls: f32 = a.iter().chain(b).chain(c).sum();
            *out = if walls > 0.0 { 0.0 } else { 1.0 };
        });
        for (out, free) in free.iter_mut().zip(&self.free) {
            *out *= free;
        }
        free
    }

    /// Calls `f` with the 3 x 3 neighbourhood of O of each cell; beyond the border there is no wall.
    fn around(&self, f: impl Fn([&[f32]; 3], &mut f32)) -> Vec<f32> {
        let (w, h) = (self.width, self.height);
        let padded_width = w + 2;
        let mut padded = vec![0.0_f32; padded_width * (h + 2)];
        for (j, row) in self.occupied.chunks_exact(w).enumerate() {
            padded[(j + 1) * padded_width + 1..][..w].copy_from_slice(row);
        }
        let mut out = vec![0.0_f32; w * h];
        for (j, out) in out.chunks_exact_mut(w).enumerate() {
            let [a, b, c] = [j, j + 1, j + 2].map(|row| &padded[row * padded_width..][..padded_width]);
            for (i, out) in out.iter_mut().enumerate() {
                f([&a[i..i + 3], &b[i..i + 3], &c[i..i + 3]], out);
            }
        }
        out
    }
}

/// Lower-left corner, width and height in cells of the turned known area.
pub(super) fn bounds(map: &Features, rotation: f64, cell: f32) -> ((f32, f32), usize, usize) {
    let (sin, cos) = sin_cos(rotation);
    let (mut low, mut high) = ((f32::MAX, f32::MAX), (f32::MIN, f32::MIN));
    for (x, y) in &map.hull {
        let (x, y) = (cos * x - sin * y, sin * x + cos * y);
        low = (low.0.min(x), low.1.min(y));
        high = (high.0.max(x), high.1.max(y));
    }
    let cells = |low: f32, high: f32| floor((high - low) / cell).unsigned_abs() + 1;
    (low, cells(low.0, high.0), cells(low.1, high.1))
}

fn sin_cos(rotation: f64) -> (f32, f32) {
    let (sin, cos) = rotation.sin_cos();
    (super::num::narrow(sin), super::num::narrow(cos))
}
