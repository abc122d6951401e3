//! The occupied cells of a map as pieces of wall: where the wall's middle is, which way it faces, how straight it is.
//!
//! Method, for each occupied cell, windows given in metres and at least 3 (centroid) and 5 (direction) cells wide:
//! (1) centroid c of the occupied cells within about 0.1 m of it; (2) covariance of those within 0.15 m, its minor axis
//! the normal n, its linearity 1 - lambda_2 / lambda_1; (3) n points to where the free cells of that window lie, with the
//! strength |n . sum of offsets of free cells| over that sum for a half window, all free. A thin wall seen from both
//! sides has a strength near 0: its sign means nothing.

#![expect(
    clippy::many_single_char_names,
    clippy::doc_markdown,
    reason = "the letters of the formulas"
)]

use rayon::prelude::*;

use super::cells::{Cropped, FREE, OCCUPIED};
use super::num::{narrow, real, real64, round64, signed};

/// One occupied cell, in the local frame; 32 bytes, so that a lookup touches one cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub(super) struct Wall {
    /// Local centroid, metres.
    pub(super) x: f32,
    pub(super) y: f32,
    /// Unit normal towards free space.
    pub(super) nx: f32,
    pub(super) ny: f32,
    /// 1 - lambda_2 / lambda_1, in [0, 1]: 1 = a straight line.
    pub(super) linearity: f32,
    /// How sure the sign of the normal is, in [0, 1].
    pub(super) strength: f32,
}

const CENTROID_M: f64 = 0.10;
const DIRECTION_M: f64 = 0.15;

/// A wall for each occupied cell, in the same order. `middle` is the local frame's origin in lattice metres.
pub(super) fn walls(cropped: &Cropped, occupied: &[u32], middle: [f64; 2]) -> Vec<Wall> {
    let near = round64(CENTROID_M / cropped.cell).max(1).min(cropped.reach);
    let wide = round64(DIRECTION_M / cropped.cell).max(2).min(cropped.reach);
    // The sum of offsets of half a window of free cells.
    let half = real((2 * wide + 1) * wide * (wide + 1) / 2);
    occupied
        .par_iter()
        .with_min_len(1024)
        .map(|&index| wall(cropped, index as usize, middle, near, wide, half))
        .collect()
}

fn wall(cropped: &Cropped, index: usize, middle: [f64; 2], near: usize, wide: usize, half: f32) -> Wall {
    let (column, row) = (index % cropped.width, index / cropped.width);
    let (mut n, mut sx, mut sy) = (0_i32, 0_i32, 0_i32);
    let (mut m, mut tx, mut ty, mut txx, mut txy, mut tyy) = (0_i32, 0_i32, 0_i32, 0_i32, 0_i32, 0_i32);
    let (mut gx, mut gy) = (0_i32, 0_i32);
    let side = i32::try_from(wide).expect("invariant: windows are below the reach");
    let inner = i32::try_from(near).expect("invariant: windows are below the reach");
    // The border of unknown cells is wider than any window.
    for (dy, line) in (-side..=side).zip(row - wide..) {
        let states = &cropped.states[line * cropped.width + column - wide..][..=2 * wide];
        for (dx, &state) in (-side..=side).zip(states) {
            if state == OCCUPIED {
                m += 1;
                tx += dx;
                ty += dy;
                txx += dx * dx;
                txy += dx * dy;
                tyy += dy * dy;
                if dx.abs() <= inner && dy.abs() <= inner {
                    n += 1;
                    sx += dx;
                    sy += dy;
                }
            } else if state == FREE {
                gx += dx;
                gy += dy;
            }
        }
    }
    let r = |value: i32| f64::from(value);
    let (n, m) = (r(n), r(m)); // at least 1: the cell itself is occupied
    let x = cropped.corner[0] + (real64(column) + 0.5 + r(sx) / n) * cropped.cell - middle[0];
    let y = cropped.corner[1] + (real64(row) + 0.5 + r(sy) / n) * cropped.cell - middle[1];
    let (mx, my) = (r(tx) / m, r(ty) / m);
    let (a, b, c) = (r(txx) / m - mx * mx, r(txy) / m - mx * my, r(tyy) / m - my * my);
    let (mean, spread) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
    let (major, minor) = (mean + spread, mean - spread);
    let linearity = if m < 4.0 || major < 1.0 {
        0.0
    } else {
        1.0 - (minor / major).max(0.0)
    };
    // The minor axis is across the major one, which stands at half of atan2(2b, a - c).
    let (sin, cos) = (0.5 * (2.0 * b).atan2(a - c)).sin_cos();
    let (mut nx, mut ny) = (narrow(-sin), narrow(cos));
    let towards = nx * signed(gx as isize) + ny * signed(gy as isize);
    if towards < 0.0 {
        (nx, ny) = (-nx, -ny);
    }
    Wall {
        x: narrow(x),
        y: narrow(y),
        nx,
        ny,
        linearity: narrow(linearity),
        strength: (towards.abs() / half).min(1.0),
    }
}
