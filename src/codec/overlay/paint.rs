//! The colour of every pixel of the map.

use rayon::prelude::*;

use super::palette::{INK, Look, PAPER, hazard, mix};
use super::strip::{Strip, strips};
use super::{OverlayLayer, Picture, Rgb, Scale, View, flip_rows};
use crate::grid::CellState;

/// How much darker free space is for every further robot that sees it, up to three.
const OVERLAP_SHADE: f32 = 0.06;

pub(super) struct Painter<'a> {
    pub(super) view: &'a View,
    pub(super) layers: &'a [OverlayLayer<'a>],
    pub(super) looks: &'a [Look],
    pub(super) conflicts: &'a [bool],
    pub(super) scale: Scale,
}

impl Painter<'_> {
    pub(super) fn paint(&self) -> Picture {
        let width = self.scale.pixels(self.view.lattice.width());
        let mut picture = Picture::new(width, self.scale.pixels(self.view.lattice.height()), PAPER);
        for strip in strips(&self.view.lattice, self.layers, self.scale.down) {
            let first = strip.first_row / self.scale.down * self.scale.up;
            let rows = self.scale.pixels(strip.end_row - strip.first_row);
            picture
                .pixels_mut()
                .par_chunks_mut(width as usize)
                .enumerate()
                .skip(first as usize)
                .take(rows as usize)
                .for_each_init(
                    || vec![Seen::default(); self.looks.len()],
                    |seen, (y, row)| {
                        let y = u32::try_from(y).expect("invariant: pictures have at most 4096 rows");
                        for (x, pixel) in (0..width).zip(row) {
                            *pixel = self.color(x, y, &strip, seen);
                        }
                    },
                );
        }
        flip_rows(picture.pixels_mut(), width as usize);
        picture
    }

    /// The colour of one pixel; `seen` is room for one number pair a layer.
    fn color(&self, x: u32, y: u32, strip: &Strip, seen: &mut [Seen]) -> Rgb {
        seen.fill(Seen::default());
        let columns = self.scale.cells(x, self.view.lattice.width());
        let rows = self.scale.cells(y, self.view.lattice.height());
        let mut conflict = false;
        for row in rows.clone() {
            for column in columns.clone() {
                for (seen, state) in seen.iter_mut().zip(strip.states(column, row)) {
                    seen.free += u16::from(state == CellState::Free);
                    seen.wall += u16::from(state == CellState::Occupied);
                }
                conflict |= self.conflicts.get(self.view.fused_index(column, row)) == Some(&true);
            }
        }
        if conflict {
            return hazard(x, y);
        }
        let cells = f32::from(u16::try_from(columns.len() * rows.len()).unwrap_or(u16::MAX));
        self.mixed(x, y, seen, cells)
    }

    fn mixed(&self, x: u32, y: u32, seen: &[Seen], cells: f32) -> Rgb {
        // A wall one cell thick that crosses a pixel of n x n cells fills n of them: that is already a full wall.
        let full_wall = cells.sqrt();
        let (mut free, mut tint) = (0.0, [0.0_f32; 3]);
        let (mut walls, mut strength, mut wall) = (0, 0.0_f32, PAPER);
        for (seen, look) in seen.iter().zip(self.looks) {
            if seen.free > 0 {
                let share = f32::from(seen.free) / cells;
                free += share;
                for (sum, part) in tint.iter_mut().zip(look.free(x, y)) {
                    *sum += share * f32::from(part);
                }
            }
            if seen.wall > 0 {
                walls += 1;
                let share = (f32::from(seen.wall) / full_wall).min(1.0);
                if share > strength {
                    (strength, wall) = (share, look.wall);
                }
            }
        }
        let base = if free > 0.0 {
            let shade = 1.0 - OVERLAP_SHADE * (free - 1.0).clamp(0.0, 3.0);
            let tint = tint.map(|sum| byte(sum / free * shade));
            mix(PAPER, tint, free.min(1.0))
        } else {
            PAPER
        };
        mix(base, if walls > 1 { INK } else { wall }, strength)
    }
}

/// How many cells of a pixel a layer calls free and occupied.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    free: u16,
    wall: u16,
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to a byte"
)]
fn byte(value: f32) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}
