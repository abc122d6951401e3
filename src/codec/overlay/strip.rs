//! The layers on the fused lattice, some rows at a time: a large picture needs no large memory.

use super::OverlayLayer;
use crate::geometry::{Angle, Pose2};
use crate::grid::{CellState, Lattice, LogOdds, OccupancyGrid, resample};

/// Cells of the fused lattice in a strip, about.
const STRIP_CELLS: u32 = 1 << 20;

/// Some rows of the fused lattice with what every layer says there.
pub(super) struct Strip {
    pub(super) first_row: u32,
    pub(super) end_row: u32,
    parts: Vec<Option<Part>>,
}

/// A box of the fused lattice with a layer on it.
struct Part {
    column: u32,
    row: u32,
    grid: OccupancyGrid,
}

impl Strip {
    /// What each layer says of a cell; nothing where it does not reach.
    pub(super) fn states(&self, column: u32, row: u32) -> impl Iterator<Item = CellState> {
        self.parts
            .iter()
            .map(move |part| part.as_ref().map_or(CellState::Unknown, |part| part.state(column, row)))
    }
}

impl Part {
    fn state(&self, column: u32, row: u32) -> CellState {
        let (column, row) = (column.wrapping_sub(self.column), row.wrapping_sub(self.row));
        let lattice = self.grid.lattice();
        if column < lattice.width() && row < lattice.height() {
            self.grid.at(column, row).state()
        } else {
            CellState::Unknown
        }
    }
}

/// The strips from the lowest rows on; each but the last has a multiple of `step` rows.
pub(super) fn strips(fused: &Lattice, layers: &[OverlayLayer<'_>], step: u32) -> impl Iterator<Item = Strip> {
    let rows = (STRIP_CELLS / fused.width() / step).max(1) * step;
    let boxes: Vec<_> = layers.iter().map(|layer| reach(fused, layer)).collect();
    (0..fused.height().div_ceil(rows)).map(move |i| {
        let (first_row, end_row) = (i * rows, ((i + 1) * rows).min(fused.height()));
        let parts = layers.iter().zip(&boxes).map(|(layer, &[left, right, low, high])| {
            let (low, high) = (low.max(first_row), high.min(end_row));
            if left >= right || low >= high {
                return None;
            }
            let part = part_of(fused, [left, right, low, high])?;
            Some(Part {
                column: left,
                row: low,
                grid: resample(layer.grid, layer.pose_target_map, part),
            })
        });
        Strip {
            first_row,
            end_row,
            parts: parts.collect(),
        }
    })
}

/// The lattice of a box of cells of another one.
pub(super) fn part_of(whole: &Lattice, [left, right, low, high]: [u32; 4]) -> Option<Lattice> {
    let metres = |cells: u32| f64::from(cells) * whole.resolution();
    let origin = whole.origin() * Pose2::new(metres(left), metres(low), Angle::ZERO);
    Lattice::new(
        right.checked_sub(left)?,
        high.checked_sub(low)?,
        whole.resolution(),
        origin,
    )
    .ok()
}

/// The columns and rows of the fused lattice that the known cells of a layer lie in, a little more, and nothing when
/// there are none: left, right, low, high; ends excluded.
pub(super) fn reach(fused: &Lattice, layer: &OverlayLayer<'_>) -> [u32; 4] {
    let mut least = [f64::INFINITY; 2];
    let mut most = [f64::NEG_INFINITY; 2];
    for [left, right, low, high] in known_spans(layer.grid) {
        for (u, v) in [(left, low), (right, low), (right, high), (left, high)] {
            let corner = layer.grid.lattice().to_metres([f64::from(u), f64::from(v)]);
            let cell = fused.to_cells(layer.pose_target_map.apply(corner));
            for axis in 0..2 {
                least[axis] = least[axis].min(cell[axis]);
                most[axis] = most[axis].max(cell[axis]);
            }
        }
    }
    let [left, low] =
        [(0, fused.width()), (1, fused.height())].map(|(axis, end)| clamp(least[axis].floor() - 1.0, end));
    let [right, high] =
        [(0, fused.width()), (1, fused.height())].map(|(axis, end)| clamp(most[axis].ceil() + 1.0, end));
    if left < right && low < high {
        [left, right, low, high]
    } else {
        [0; 4]
    }
}

/// For each row with cells in a known state the box from the first to the last of them: left, right, low, high; ends
/// excluded.
fn known_spans(grid: &OccupancyGrid) -> impl Iterator<Item = [u32; 4]> {
    let known = |cell: &LogOdds| cell.state() != CellState::Unknown;
    let spans = grid.cells().chunks(grid.lattice().width() as usize).map(move |cells| {
        let first = cells.iter().position(known)?;
        let last = cells.iter().rposition(known)?;
        Some((u32::try_from(first).ok()?, u32::try_from(last).ok()?))
    });
    (0_u32..)
        .zip(spans)
        .filter_map(|(row, span)| span.map(|(first, last)| [first, last + 1, row, row + 1]))
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the numbers of u32"
)]
fn clamp(cells: f64, end: u32) -> u32 {
    cells.clamp(0.0, f64::from(end)) as u32
}
