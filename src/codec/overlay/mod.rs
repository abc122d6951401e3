//! The picture of a welded map: each robot's map in its own colour where it was placed.
//!
//! Free space is a light tint of the robot's colour (darker where robots overlap), walls are the full colour, and walls
//! that several robots see are black. A number stands on each robot's part; the legend below tells the names and the
//! scale.

mod badges;
mod legend;
mod paint;
mod palette;
mod strip;

use super::image::{flip_row, flip_rows};
use super::picture::{Picture, Rgb, text_size};
use crate::geometry::Pose2;
use crate::grid::{Lattice, OccupancyGrid};
use paint::Painter;
use palette::Look;
use strip::{part_of, reach};

/// One robot's map in the picture.
#[derive(Debug, Clone, Copy)]
pub struct OverlayLayer<'a> {
    /// The robot, as the legend shall call it.
    pub name: &'a str,
    /// Its map.
    pub grid: &'a OccupancyGrid,
    /// Pose of the map's frame in the frame of the picture's lattice.
    pub pose_target_map: Pose2,
}

/// Draws the maps where they are placed on the lattice of the fused map, cut to what is known.
///
/// `conflicts` marks the cells of the lattice, row by row from the lowest, where maps contradict each other; they are
/// drawn in checks of black and yellow. Cells that it does not reach are not marked.
///
/// Small maps are drawn larger by a whole number (at most 8 pixels a cell, about 2048 pixels a side); large ones are
/// made smaller by a whole number to at most 4096 pixels a side, in such a way that a wall of one cell keeps its full
/// colour. Memory: the picture, and some rows of each map.
#[must_use]
pub fn overlay(fused: &Lattice, layers: &[OverlayLayer<'_>], conflicts: Option<&[bool]>) -> Picture {
    let view = View::of(fused, layers);
    let scale = Scale::of(&view.lattice);
    let looks: Vec<Look> = (0..layers.len())
        .map(|robot| Look::of(robot, scale.text_unit(&view.lattice)))
        .collect();
    let mut map = Painter {
        view: &view,
        layers,
        looks: &looks,
        conflicts: conflicts.unwrap_or_default(),
        scale,
    }
    .paint();
    badges::draw(&mut map, &view.lattice, layers, &looks, scale);
    let names: Vec<&str> = layers.iter().map(|layer| layer.name).collect();
    legend::below(
        &map,
        &legend::Legend {
            names: &names,
            looks: &looks,
            conflicts: conflicts.is_some_and(|cells| cells.contains(&true)),
            metres_per_pixel: fused.resolution() * f64::from(scale.down) / f64::from(scale.up),
            unit: scale.text_unit(&view.lattice),
        },
    )
}

/// The part of the fused lattice that the picture shows.
struct View {
    lattice: Lattice,
    /// Its lower left cell on the fused lattice, and that one's width.
    column: u32,
    row: u32,
    fused_width: u32,
}

impl View {
    /// What the layers know, and a margin of a fiftieth, at least 2 cells.
    fn of(fused: &Lattice, layers: &[OverlayLayer<'_>]) -> Self {
        let reaches = layers
            .iter()
            .map(|layer| reach(fused, layer))
            .filter(|&reach| reach != [0; 4]);
        let union = |a: [u32; 4], b: [u32; 4]| [a[0].min(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].max(b[3])];
        let whole = [0, fused.width(), 0, fused.height()];
        let [left, right, low, high] = reaches.reduce(union).unwrap_or(whole);
        let margin = 2.max((right - left).max(high - low) / 50);
        let [left, low] = [left, low].map(|first| first.saturating_sub(margin));
        let [right, high] = [(right, whole[1]), (high, whole[3])].map(|(end, most)| (end + margin).min(most));
        Self {
            lattice: part_of(fused, [left, right, low, high]).unwrap_or(*fused),
            column: left,
            row: low,
            fused_width: fused.width(),
        }
    }

    /// Where a cell of the view stands in a row-major array on the fused lattice.
    fn fused_index(&self, column: u32, row: u32) -> usize {
        (row + self.row) as usize * self.fused_width as usize + (column + self.column) as usize
    }
}

/// How many pixels a cell has (`up`), or how many cells a side of a pixel has (`down`); one of them is 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Scale {
    up: u32,
    down: u32,
}

impl Scale {
    const SIDE_MAX: u32 = 4096;
    const SIDE_PLEASANT: u32 = 2048;
    const UP_MAX: u32 = 8;

    fn of(lattice: &Lattice) -> Self {
        let side = lattice.width().max(lattice.height());
        Self {
            up: (Self::SIDE_PLEASANT / side).clamp(1, Self::UP_MAX),
            down: side.div_ceil(Self::SIDE_MAX),
        }
    }

    /// Pixels that show so many cells.
    fn pixels(self, cells: u32) -> u32 {
        cells.div_ceil(self.down) * self.up
    }

    /// The cells, of so many, that a pixel shows.
    fn cells(self, pixel: u32, cells: u32) -> std::ops::Range<u32> {
        let first = pixel / self.up * self.down;
        first..first.saturating_add(self.down).min(cells)
    }

    /// Pixels for a unit of text and hatching: more on large pictures, which are seen as a whole.
    fn text_unit(self, lattice: &Lattice) -> u32 {
        ((self.pixels(lattice.width().max(lattice.height())) + 450) / 900).max(1)
    }
}

#[cfg(test)]
mod tests;
