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

#[cfg(test)]
use super::cropped::OCCUPIED;
use super::cropped::{Cropped, FREE};
use super::num::{exact, narrow, real, real64, round64};
use super::simd::widest;

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

/// What stands for the wall of a cell that has none in reach: out of every reach, of the samples that are nowhere too.
const NOWHERE: Wall = Wall {
    x: 1e12,
    y: 1e12,
    nx: 0.0,
    ny: 0.0,
    linearity: 0.0,
    strength: 0.0,
};

/// A wall for each occupied cell, in the same order, after one that is nowhere. `middle` is the local frame's origin in
/// lattice metres.
pub(super) fn walls(cropped: &Cropped, middle: [f64; 2]) -> Vec<Wall> {
    const TOGETHER: usize = 1024;
    let near = round64(CENTROID_M / cropped.cell).max(1).min(cropped.reach);
    let wide = round64(DIRECTION_M / cropped.cell).max(2).min(cropped.reach);
    let corner = [cropped.corner[0] - middle[0], cropped.corner[1] - middle[1]];
    let mut walls = vec![NOWHERE; cropped.occupied.len() + 1];
    walls[1..]
        .par_chunks_mut(TOGETHER)
        .zip(cropped.occupied.par_chunks(TOGETHER))
        .for_each(|(walls, occupied)| {
            if 2 * wide < SHORT {
                walls_of::<SHORT>(walls, occupied, cropped, corner, near, wide);
            } else {
                walls_of::<LONG>(walls, occupied, cropped, corner, near, wide);
            }
        });
    walls
}

/// Cells of a row that a window may have: as many as fill one register of 16-bit numbers, and as many as the reach allows.
const SHORT: usize = 16;
const LONG: usize = 48;
const _: () = assert!(2 * Cropped::REACH_MAX < LONG && LONG <= Cropped::BEYOND);

widest! {
    fn walls_of<const N: usize>(
        walls: &mut [Wall],
        occupied: &[u32],
        cropped: &Cropped,
        corner: [f64; 2],
        near: usize,
        wide: usize,
    ) {
        let weights = Weights::<N>::new(near, wide);
        // The sum of offsets of half a window of free cells.
        let half = real((2 * wide + 1) * wide * (wide + 1) / 2);
        for (wall, &index) in walls.iter_mut().zip(occupied) {
            let (column, row) = (index as usize % cropped.width, index as usize / cropped.width);
            let sums = weights.sums(cropped, column, row, near, wide);
            let middle = [(corner[0], column), (corner[1], row)]
                .map(|(corner, cell)| corner + (real64(cell) + 0.5) * cropped.cell);
            *wall = sums.wall(middle, cropped.cell, half);
        }
    }
}

/// Offsets along x of the cells of a window, 0 beyond it.
struct Weights<const N: usize> {
    one: [i16; N],
    dx: [i16; N],
    square: [i16; N],
    near_one: [i16; N],
    near_dx: [i16; N],
}

/// Sums over a window, offsets in cells from its middle.
#[derive(Debug, Default, PartialEq)]
struct Sums {
    /// Occupied cells of the near window: how many, sums of dx and dy.
    n: i32,
    sx: i32,
    sy: i32,
    /// Those of the wide window, with the sums of squares.
    m: i32,
    tx: i32,
    ty: i32,
    txx: i32,
    txy: i32,
    tyy: i32,
    /// Sums of dx and dy of the free cells of the wide window.
    gx: i32,
    gy: i32,
}

impl<const N: usize> Weights<N> {
    #[expect(clippy::inline_always, reason = "must take on the vector width of its caller")]
    #[inline(always)]
    fn new(near: usize, wide: usize) -> Self {
        let offset = |i: usize| i16::try_from(i).unwrap_or(i16::MAX) - i16::try_from(wide).unwrap_or(0);
        let within = |side: usize, f: fn(i16) -> i16| {
            std::array::from_fn(|i| if i.abs_diff(wide) <= side { f(offset(i)) } else { 0 })
        };
        Self {
            one: within(wide, |_| 1),
            dx: within(wide, |dx| dx),
            square: within(wide, |dx| dx * dx),
            near_one: within(near, |_| 1),
            near_dx: within(near, |dx| dx),
        }
    }

    /// Sums each column of the window by itself, then over the columns.
    #[expect(clippy::inline_always, reason = "must take on the vector width of its caller")]
    #[inline(always)]
    fn sums(&self, cropped: &Cropped, column: usize, row: usize, near: usize, wide: usize) -> Sums {
        let mut occupied = [[0_i16; N]; 3];
        let mut close = [[0_i16; N]; 2];
        let mut free = [[0_i16; N]; 2];
        // The border of unknown cells is wider than any window.
        let start = (row - wide) * cropped.width + column - wide;
        for line in 0..=2 * wide {
            let states: &[u8; N] = cropped.cells_from(start + line * cropped.width);
            let y = i16::try_from(line).unwrap_or(0);
            for i in 0..N {
                let is_occupied = i16::from(states[i] >> 1);
                let is_free = i16::from(states[i] & FREE);
                occupied[0][i] += is_occupied;
                occupied[1][i] += is_occupied * y;
                occupied[2][i] += is_occupied * y * y;
                free[0][i] += is_free;
                free[1][i] += is_free * y;
            }
            if line.abs_diff(wide) <= near {
                for i in 0..N {
                    let is_occupied = i16::from(states[i] >> 1);
                    close[0][i] += is_occupied;
                    close[1][i] += is_occupied * y;
                }
            }
        }
        // rows were counted from the window's lowest
        let side = i32::try_from(wide).unwrap_or(0);
        let (n, m) = (dot(&close[0], &self.near_one), dot(&occupied[0], &self.one));
        let (tx, ys) = (dot(&occupied[0], &self.dx), dot(&occupied[1], &self.one));
        Sums {
            n,
            sx: dot(&close[0], &self.near_dx),
            sy: dot(&close[1], &self.near_one) - side * n,
            m,
            tx,
            ty: ys - side * m,
            txx: dot(&occupied[0], &self.square),
            txy: dot(&occupied[1], &self.dx) - side * tx,
            tyy: dot(&occupied[2], &self.one) - side * (2 * ys - side * m),
            gx: dot(&free[0], &self.dx),
            gy: dot(&free[1], &self.one) - side * dot(&free[0], &self.one),
        }
    }
}

#[expect(clippy::inline_always, reason = "must take on the vector width of its caller")]
#[inline(always)]
fn dot<const N: usize>(values: &[i16; N], weights: &[i16; N]) -> i32 {
    let mut sum = 0;
    for i in 0..N {
        sum += i32::from(values[i]) * i32::from(weights[i]);
    }
    sum
}

impl Sums {
    /// Equations (1) to (3); `middle` is the window's in metres of the local frame, `half` as of a half window of free cells.
    fn wall(&self, middle: [f64; 2], cell: f64, half: f32) -> Wall {
        let (n, m) = (f64::from(self.n), f64::from(self.m)); // at least 1: the cell itself is occupied
        let [tx, ty, txx, txy, tyy] = [self.tx, self.ty, self.txx, self.txy, self.tyy].map(|sum| f64::from(sum) / m);
        let (a, b, c) = (txx - tx * tx, txy - tx * ty, tyy - ty * ty);
        let (mean, difference) = (0.5 * (a + c), 0.5 * (a - c));
        let spread = (difference * difference + b * b).sqrt();
        let (major, minor) = (mean + spread, mean - spread);
        let linearity = if m < 4.0 || major < 1.0 {
            0.0
        } else {
            1.0 - (minor / major).max(0.0)
        };
        // The major axis stands at half of atan2(b, difference), the minor one across it.
        let cos_twice = if spread > 0.0 { difference / spread } else { 1.0 };
        let cos = (0.5 + 0.5 * cos_twice).max(0.0).sqrt();
        let sin = (0.5 - 0.5 * cos_twice).max(0.0).sqrt().copysign(b);
        let (mut nx, mut ny) = (narrow(-sin), narrow(cos));
        let towards = nx * exact(self.gx) + ny * exact(self.gy);
        if towards < 0.0 {
            (nx, ny) = (-nx, -ny);
        }
        Wall {
            x: narrow(middle[0] + f64::from(self.sx) / n * cell),
            y: narrow(middle[1] + f64::from(self.sy) / n * cell),
            nx,
            ny,
            linearity: narrow(linearity),
            strength: (towards.abs() / half).min(1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose2;
    use crate::grid::{Lattice, LogOdds, OccupancyGrid};
    use proptest::prelude::*;

    /// The sums by their definition.
    fn direct(cropped: &Cropped, column: usize, row: usize, near: i32, wide: i32) -> Sums {
        let mut sums = Sums::default();
        for dy in -wide..=wide {
            for dx in -wide..=wide {
                let at = |from: usize, by: i32| from.checked_add_signed(by as isize).expect("within the border");
                match cropped.row(at(row, dy))[at(column, dx)] {
                    OCCUPIED => {
                        sums.m += 1;
                        sums.tx += dx;
                        sums.ty += dy;
                        sums.txx += dx * dx;
                        sums.txy += dx * dy;
                        sums.tyy += dy * dy;
                        if dx.abs() <= near && dy.abs() <= near {
                            sums.n += 1;
                            sums.sx += dx;
                            sums.sy += dy;
                        }
                    }
                    FREE => {
                        sums.gx += dx;
                        sums.gy += dy;
                    }
                    _ => {}
                }
            }
        }
        sums
    }

    proptest! {
        #[test]
        fn the_sums_of_a_window_equal_their_definition(states in proptest::collection::vec(0_u8..3, 40 * 30), wide in 2_usize..14) {
            let lattice = Lattice::new(40, 30, 0.05, Pose2::IDENTITY).expect("valid");
            let cells = states.iter().map(|&state| [LogOdds::UNKNOWN, LogOdds::FREE, LogOdds::OCCUPIED][usize::from(state)]);
            let grid = OccupancyGrid::new(lattice, cells.collect()).expect("as many cells");
            let Some(cropped) = Cropped::new(&grid, 0.75) else { return Ok(()) };
            let near = wide / 2;
            let short = |side: usize| i32::try_from(side).expect("small");
            for &index in &cropped.occupied {
                let (column, row) = (index as usize % cropped.width, index as usize / cropped.width);
                let slow = direct(&cropped, column, row, short(near), short(wide));
                if 2 * wide < SHORT {
                    prop_assert_eq!(&Weights::<SHORT>::new(near, wide).sums(&cropped, column, row, near, wide), &slow);
                }
                prop_assert_eq!(&Weights::<LONG>::new(near, wide).sums(&cropped, column, row, near, wide), &slow);
            }
        }
    }
}
