//! Thin lines from the walls and objects of a map (section 6.2: Canny edges, smoothed).
//!
//! **Method.**
//!
//! 1. The map is a picture: occupied 255, everything else 0; Canny's edges run along both sides of each wall.
//! 2. A morphological closing joins edges up to twice `smoothing_cells` apart, so that a wall is one band again, whatever its
//!    thickness was.
//! 3. Thinning after Zhang and Suen (1984) leaves the middle line of each band, a cell wide.
//!
//! **Shapes and units.** Cells in; points in cells of the map's frame out. Maps of more than [`CELLS_MAX`] cells are drawn in
//! larger cells, so that memory stays bounded.
//!
//! **Cost.** Some passes over the box of the occupied cells; thinning looks at the bands only.

use image::{GrayImage, Luma};
use imageproc::distance_transform::Norm;
use imageproc::edges::canny;
use imageproc::morphology::close_mut;

use super::params::MapSegmentationParams;
use crate::geometry::Point;
use crate::grid::CellState;
use crate::registration::methods::shared::map::{Map, coarsened};
use crate::registration::overlap::StateMap;

/// Larger maps are looked at in larger cells.
const CELLS_MAX: usize = 1 << 24;

/// The cells of the thin lines of a map, as points in the map's own cells in its frame, row by row.
pub(super) fn thin_lines(map: &Map, params: &MapSegmentationParams) -> Vec<Point> {
    let larger;
    let states = if map.states.states().len() > CELLS_MAX {
        let lattice = map.states.lattice();
        let cells = f64::from(lattice.width()) * f64::from(lattice.height());
        let times = (cells / f64::from(u32::try_from(CELLS_MAX).expect("invariant: a small constant")))
            .sqrt()
            .ceil();
        larger = coarsened(&map.states, map.cell() * times);
        &larger
    } else {
        &map.states
    };
    let Some(window) = Window::new(states, params.smoothing_cells + 4) else {
        return Vec::new();
    };
    let picture = GrayImage::from_fn(window.width, window.height, |x, y| {
        Luma([if window.state(states, x, y) == CellState::Occupied {
            255
        } else {
            0
        }])
    });
    let mut edges = canny(&picture, narrow(params.edge_low), narrow(params.edge_high));
    close_mut(
        &mut edges,
        Norm::LInf,
        u8::try_from(params.smoothing_cells).expect("invariant: at most 20"),
    );
    let mut bands: Vec<bool> = edges.into_raw().into_iter().map(|value| value > 0).collect();
    let width = window.width as usize;
    clear_border(&mut bands, width);
    thin(&mut bands, width);
    (0_u32..)
        .zip(bands.chunks(width))
        .flat_map(|(y, row)| (0_u32..).zip(row).filter(|(_, line)| **line).map(move |(x, _)| (x, y)))
        .map(|(x, y)| {
            let lattice = states.lattice();
            let place = [0, 1].map(|k| f64::from([x, y][k]) + window.low[k] + 0.5);
            lattice.to_metres(place).map(|metres| metres / map.cell())
        })
        .collect()
}

#[expect(clippy::cast_possible_truncation, reason = "a threshold")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// The box of the occupied cells with a margin, which may reach beyond the lattice.
struct Window {
    low: Point,
    width: u32,
    height: u32,
    /// Column and row of the window's first cell, plus the margin.
    first: [u32; 2],
    margin: u32,
}

impl Window {
    fn new(states: &StateMap, margin: u32) -> Option<Self> {
        let (mut low, mut high) = ([u32::MAX; 2], [0_u32; 2]);
        for (row, cells) in (0_u32..).zip(states.states().chunks(states.lattice().width() as usize)) {
            for (column, _) in (0_u32..).zip(cells).filter(|(_, state)| **state == CellState::Occupied) {
                low = [low[0].min(column), low[1].min(row)];
                high = [high[0].max(column), high[1].max(row)];
            }
        }
        (low[0] <= high[0]).then(|| Self {
            low: low.map(|at| f64::from(at) - f64::from(margin)),
            width: high[0] - low[0] + 1 + 2 * margin,
            height: high[1] - low[1] + 1 + 2 * margin,
            first: low,
            margin,
        })
    }

    fn state(&self, states: &StateMap, x: u32, y: u32) -> CellState {
        let inside = |at: u32, first: u32, size: u32| (at + first).checked_sub(self.margin).filter(|at| *at < size);
        let column = inside(x, self.first[0], states.lattice().width());
        let row = inside(y, self.first[1], states.lattice().height());
        match (column, row) {
            (Some(column), Some(row)) => states.at(column, row),
            _ => CellState::Unknown,
        }
    }
}

fn clear_border(cells: &mut [bool], width: usize) {
    let height = cells.len() / width;
    cells[..width].fill(false);
    cells[(height - 1) * width..].fill(false);
    for row in cells.chunks_mut(width) {
        row[0] = false;
        row[width - 1] = false;
    }
}

/// Thinning after Zhang and Suen; the border must be empty.
fn thin(cells: &mut [bool], width: usize) {
    let mut left: Vec<usize> = (0..cells.len()).filter(|index| cells[*index]).collect();
    loop {
        let mut changed = false;
        for pass in 0..2 {
            let removed: Vec<usize> = left
                .iter()
                .copied()
                .filter(|at| removable(cells, width, *at, pass))
                .collect();
            for at in &removed {
                cells[*at] = false;
            }
            left.retain(|at| cells[*at]);
            changed |= !removed.is_empty();
        }
        if !changed {
            return;
        }
    }
}

fn removable(cells: &[bool], width: usize, at: usize, pass: usize) -> bool {
    // the eight neighbours in a circle, from the one above
    let around = [
        at + width,
        at + width + 1,
        at + 1,
        at - width + 1,
        at - width,
        at - width - 1,
        at - 1,
        at + width - 1,
    ]
    .map(|index| cells[index]);
    let neighbours = around.iter().filter(|set| **set).count();
    let begins = (0..8).filter(|k| !around[*k] && around[(k + 1) % 8]).count();
    let [up, _, right, _, down, _, left, _] = around;
    let open = if pass == 0 {
        !(right && down && (up || left))
    } else {
        !(up && left && (right || down))
    };
    (2..=6).contains(&neighbours) && begins == 1 && open
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Angle, Pose2};
    use crate::grid::Lattice;

    fn map_of(width: u32, height: u32, wall: impl Fn(u32, u32) -> bool) -> Map {
        let origin = Pose2::new(3.0, -1.0, Angle::from_degrees(30.0));
        let lattice = Lattice::new(width, height, 0.05, origin).expect("valid");
        let mut states = Vec::new();
        for row in 0..height {
            for column in 0..width {
                states.push(if wall(column, row) {
                    CellState::Occupied
                } else {
                    CellState::Free
                });
            }
        }
        Map::new(StateMap::from_states(lattice, states))
    }

    /// Lines in columns and rows of the map's lattice.
    fn lines(map: &Map) -> Vec<Point> {
        let lattice = map.states.lattice();
        let points = thin_lines(map, &MapSegmentationParams::default());
        points
            .into_iter()
            .map(|p| lattice.to_cells(p.map(|cells| cells * map.cell())))
            .collect()
    }

    #[test]
    fn a_wall_of_any_thickness_is_one_thin_line_along_its_middle() {
        for thickness in 1..=6 {
            let map = map_of(120, 60, |column, row| {
                (10..110).contains(&column) && (30..30 + thickness).contains(&row)
            });
            let points = lines(&map);
            let middle = 30.0 + f64::from(thickness) / 2.0;
            let inner: Vec<&Point> = points.iter().filter(|p| (20.0..100.0).contains(&p[0])).collect();
            assert!(
                inner.iter().all(|p| (p[1] - middle).abs() <= 1.5),
                "{thickness} cells: {inner:?}"
            );
            assert!(
                (78..=84).contains(&inner.len()),
                "{thickness} cells: {} of 80",
                inner.len()
            );
        }
    }

    #[test]
    fn a_wall_at_the_border_of_the_map_is_a_line_too() {
        let map = map_of(120, 60, |_, row| row < 3);
        assert!(lines(&map).len() > 90);
    }

    #[test]
    fn maps_without_walls_and_of_nothing_else_have_lines_or_none_and_do_no_harm() {
        assert!(lines(&map_of(20, 10, |_, _| false)).is_empty());
        let _ = lines(&map_of(200, 100, |_, _| true));
        let _ = lines(&map_of(1, 1, |_, _| true));
    }

    #[test]
    fn thinning_keeps_lines_of_a_cell_and_takes_thick_ones_down_to_one() {
        let (width, height) = (30, 20);
        let mut thick: Vec<bool> = (0..width * height)
            .map(|i| (5..25).contains(&(i % width)) && (6..11).contains(&(i / width)))
            .collect();
        thin(&mut thick, width);
        let columns = (8..22).map(|x| (0..height).filter(|y| thick[y * width + x]).count());
        assert!(columns.into_iter().all(|cells| cells == 1));
        let line: Vec<bool> = (0..width * height)
            .map(|i| (5..25).contains(&(i % width)) && i / width == 9)
            .collect();
        let mut thinned = line.clone();
        thin(&mut thinned, width);
        assert_eq!(thinned, line);
    }
}
