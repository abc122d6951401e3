//! A number on each robot's part of the map, for eyes that its colour tells little.

use super::palette::{Look, PAPER};
use super::{OverlayLayer, Picture, Scale, flip_row, text_size};
use crate::grid::{CellState, Lattice};

pub(super) fn draw(map: &mut Picture, fused: &Lattice, layers: &[OverlayLayer<'_>], looks: &[Look], scale: Scale) {
    let unit = scale.text_unit(fused);
    let mut taken: Vec<[u32; 4]> = Vec::new();
    for (number, (layer, look)) in (1_usize..).zip(layers.iter().zip(looks)) {
        let text = number.to_string();
        let (width, height) = text_size(text.len());
        let (width, height) = ((width + 6) * unit, (height + 4) * unit);
        let Some((x, y)) = anchor(map, fused, layer, scale) else {
            continue;
        };
        if width > map.width() || height > map.height() {
            continue;
        }
        let x = x.saturating_sub(width / 2).min(map.width() - width);
        let wanted = y.saturating_sub(height / 2).min(map.height() - height);
        // robots that mapped the same place have their numbers one below the other
        let free = |y: &u32| !taken.iter().any(|&other| overlap(other, [x, *y, width, height]));
        let downwards = (wanted..=map.height() - height).step_by(height as usize);
        let y = downwards
            .chain((0..wanted).rev().step_by(height as usize))
            .find(free)
            .unwrap_or(wanted);
        taken.push([x, y, width, height]);
        map.fill(x, y, width, height, |_, _| PAPER);
        map.fill(x + unit, y + unit, width - 2 * unit, height - 2 * unit, |_, _| {
            look.wall
        });
        map.write(&text, x + 3 * unit, y + 2 * unit, unit, look.text());
    }
}

fn overlap([x, y, width, height]: [u32; 4], [x2, y2, width2, height2]: [u32; 4]) -> bool {
    x < x2 + width2 && x2 < x + width && y < y2 + height2 && y2 < y + height
}

/// The pixel of the free cell nearest to the middle of the map's free space.
#[expect(clippy::cast_precision_loss, reason = "counts of at most some million cells")]
fn anchor(map: &Picture, fused: &Lattice, layer: &OverlayLayer<'_>, scale: Scale) -> Option<(u32, u32)> {
    let lattice = layer.grid.lattice();
    // about a thousand rows and columns tell the middle well enough
    let step = 1 + (lattice.width().max(lattice.height()) / 1024) as usize;
    let cells = || {
        (0..lattice.height()).step_by(step).flat_map(move |row| {
            let seen = layer.grid.row(row);
            let columns = (0..lattice.width()).step_by(step);
            columns
                .filter(move |&column| seen[column as usize].state() == CellState::Free)
                .map(move |column| (column, row))
        })
    };
    let (sum, count) = cells().fold(([0_u64; 2], 0_u64), |([u, v], n), (column, row)| {
        ([u + u64::from(column), v + u64::from(row)], n + 1)
    });
    if count == 0 {
        return None;
    }
    let middle = sum.map(|sum| sum as f64 / count as f64);
    let distance = |&(column, row): &(u32, u32)| (f64::from(column) - middle[0]).hypot(f64::from(row) - middle[1]);
    let (column, row) = cells().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    let point = layer.pose_target_map.apply(lattice.cell_center(column, row));
    let (column, row) = fused.cell_at(point)?;
    let pixel = |cell: u32| cell / scale.down * scale.up + scale.up / 2;
    Some((pixel(column), flip_row(pixel(row).min(map.height() - 1), map.height())))
}
