//! What `hough-peaks` computes of one map alone.

use std::borrow::Cow;

use super::hough_image::{Directions, HoughImage, WallPoints, to_f64};
use super::params::HoughPeaksParams;
use super::peaks::{Peak, local_peaks};
use super::spectrum::spectrum;
use crate::geometry::Angle;
use crate::grid::{CellState, Lattice};
use crate::registration::overlap::StateMap;

/// A map as the method sees it.
#[derive(Debug, Clone)]
pub(super) struct Features {
    pub(super) states: StateMap,
    pub(super) points: WallPoints,
    /// h(theta) of the map's Hough image (eq. 22).
    pub(super) spectrum: Vec<f64>,
    /// Local peaks of the map's Hough image (eq. 20).
    pub(super) peaks: Vec<Peak>,
}

impl Features {
    pub(super) fn new(states: StateMap, params: &HoughPeaksParams) -> Self {
        let points = WallPoints::new(&states);
        let directions = Directions::half_turn_of_rotated(Angle::ZERO);
        let image = HoughImage::new(&points, directions, params.line_width_cells as usize);
        Self {
            states,
            spectrum: spectrum(&image, params.spectrum),
            peaks: local_peaks(&image, params),
            points,
        }
    }

    /// Side of a cell in metres.
    pub(super) fn cell(&self) -> f64 {
        self.states.lattice().resolution()
    }

    /// Metres of occupied cells.
    pub(super) fn wall_m(&self) -> f64 {
        to_f64(self.points.len()) * self.cell()
    }

    /// The features of the same map in larger cells: its votes then compare with those of a coarser map. Never finer:
    /// that would invent votes, and memory for them.
    pub(super) fn at_cell(&self, cell: f64, params: &HoughPeaksParams) -> Cow<'_, Self> {
        if self.cell() > cell * (1.0 - 1e-9) {
            return Cow::Borrowed(self);
        }
        Cow::Owned(Self::new(coarsened(&self.states, cell), params))
    }
}

/// The map in larger cells: occupied where any of its cells is, so that thin walls stay whole; else free where any is.
fn coarsened(map: &StateMap, cell: f64) -> StateMap {
    let fine = map.lattice();
    let scale = fine.resolution() / cell;
    let extent = |cells: u32| ceiling(f64::from(cells) * scale);
    let lattice = Lattice::new(extent(fine.width()), extent(fine.height()), cell, fine.origin())
        .expect("invariant: fewer cells than before, of a size that another map has");
    let mut states = vec![CellState::Unknown; lattice.cell_count()];
    for (row, fine_states) in (0_u32..).zip(map.states().chunks(fine.width() as usize)) {
        for (column, state) in (0_u32..).zip(fine_states) {
            let middle = [(f64::from(column) + 0.5) * scale, (f64::from(row) + 0.5) * scale];
            let Some((i, j)) = lattice.cell_of(middle) else {
                continue;
            };
            let there = &mut states[lattice.index(i, j)];
            if *state == CellState::Occupied || *there == CellState::Unknown {
                *there = *state;
            }
        }
    }
    StateMap::from_states(lattice, states)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at least 1 and no more than the columns of a lattice"
)]
fn ceiling(cells: f64) -> u32 {
    (cells - 1e-9).ceil().max(1.0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose2;

    #[test]
    fn in_larger_cells_thin_walls_stay_whole() {
        let lattice = Lattice::new(40, 30, 0.05, Pose2::new(-1.0, 2.0, Angle::from_degrees(30.0))).expect("valid");
        let states: Vec<CellState> = (0..1200)
            .map(|i| match (i % 40, i / 40) {
                (13, _) => CellState::Occupied,
                (0..=25, _) => CellState::Free,
                _ => CellState::Unknown,
            })
            .collect();
        let fine = Features::new(StateMap::from_states(lattice, states), &HoughPeaksParams::default());
        let coarse = fine.at_cell(0.1, &HoughPeaksParams::default());
        let map = &coarse.states;
        assert_eq!((map.lattice().width(), map.lattice().height()), (20, 15));
        for row in 0..15 {
            assert_eq!(map.at(6, row), CellState::Occupied);
            assert_eq!((map.at(5, row), map.at(19, row)), (CellState::Free, CellState::Unknown));
        }
        assert!((coarse.wall_m() - 1.5).abs() < 1e-9 && (fine.wall_m() - 1.5).abs() < 1e-9);
        assert!(matches!(
            fine.at_cell(0.05, &HoughPeaksParams::default()),
            Cow::Borrowed(_)
        ));
    }

    #[test]
    fn enormous_cells_leave_one() {
        let lattice = Lattice::new(40, 30, 0.05, Pose2::IDENTITY).expect("valid");
        let fine = Features::new(
            StateMap::from_states(lattice, vec![CellState::Free; 1200]),
            &HoughPeaksParams::default(),
        );
        let coarse = fine.at_cell(100.0, &HoughPeaksParams::default());
        assert_eq!(coarse.states.lattice().cell_count(), 1);
        assert_eq!(coarse.states.at(0, 0), CellState::Free);
    }
}
