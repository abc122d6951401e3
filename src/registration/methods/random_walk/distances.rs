//! The distance maps of a map: how far from each cell the nearest occupied cell lies, and the nearest free one.
//!
//! **Shapes and units.** Manhattan distances in cells, a byte each, 255 for all that is farther. A map of more than
//! [`CELLS_MAX`] cells has distances between larger blocks of cells, so that memory stays bounded.
//!
//! **Cost.** Two passes over the cells for each state (Birk and Carpin compute them in linear time as well).

use image::{GrayImage, Luma};
use imageproc::distance_transform::{Norm, distance_transform_mut};

use crate::geometry::Point;
use crate::grid::{CellState, Lattice};
use crate::registration::methods::shared::map::{Map, coarsened};
use crate::registration::overlap::StateMap;

/// Larger maps are looked at in larger cells.
const CELLS_MAX: usize = 1 << 22;

/// The states that the similarity sums over, in the order of the arrays here.
pub(super) const STATES: [CellState; 2] = [CellState::Occupied, CellState::Free];

/// Distances of one map.
#[derive(Debug, Clone)]
pub(super) struct Distances {
    lattice: Lattice,
    /// The sides of the map's own cells that a step is long.
    step: f64,
    states: Vec<CellState>,
    /// For each of [`STATES`] the distance from every cell.
    maps: [Vec<u8>; 2],
}

/// What a map says of one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seen {
    /// The map's state there.
    pub(super) state: CellState,
    /// Manhattan distance in the map's cells to the nearest cell of the state that was asked for.
    pub(super) distance: f64,
}

impl Distances {
    pub(super) fn new(map: &Map) -> Self {
        let larger;
        let states: &StateMap = if map.states.states().len() > CELLS_MAX {
            let times = (f64::from(map.states.lattice().width()) * f64::from(map.states.lattice().height()))
                / f64::from(u32::try_from(CELLS_MAX).expect("invariant: a small constant"));
            larger = coarsened(&map.states, map.cell() * times.sqrt().ceil());
            &larger
        } else {
            &map.states
        };
        let lattice = *states.lattice();
        Self {
            lattice,
            step: lattice.resolution() / map.cell(),
            states: states.states().to_vec(),
            maps: STATES.map(|state| distance_map(states, state)),
        }
    }

    /// What is known at a point in metres in the map's frame; `state` is an index of [`STATES`].
    #[inline]
    pub(super) fn at(&self, [u, v]: Point, state: usize) -> Seen {
        let (right, top) = (
            f64::from(self.lattice.width() - 1),
            f64::from(self.lattice.height() - 1),
        );
        let (column, row) = (u.floor(), v.floor());
        let (i, j) = (column.clamp(0.0, right), row.clamp(0.0, top));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the lattice's columns and rows"
        )]
        let index = self.lattice.index(i as u32, j as u32);
        // beyond the border: the way to the border, and from there
        let beyond = (column - i).abs() + (row - j).abs();
        Seen {
            state: if beyond > 0.0 {
                CellState::Unknown
            } else {
                self.states[index]
            },
            distance: (beyond + f64::from(self.maps[state][index])) * self.step,
        }
    }

    /// Where the cells lie.
    pub(super) fn lattice(&self) -> &Lattice {
        &self.lattice
    }
}

fn distance_map(map: &StateMap, state: CellState) -> Vec<u8> {
    if !map.states().contains(&state) {
        return vec![u8::MAX; map.states().len()];
    }
    let (width, height) = (map.lattice().width(), map.lattice().height());
    let mut image = GrayImage::new(width, height);
    for (pixel, cell) in image.pixels_mut().zip(map.states()) {
        *pixel = Luma([if *cell == state { 255 } else { 0 }]);
    }
    distance_transform_mut(&mut image, Norm::L1);
    image.into_raw()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose2;

    fn map(width: u32, height: u32, state: impl Fn(u32, u32) -> CellState) -> Map {
        let lattice = Lattice::new(width, height, 0.1, Pose2::IDENTITY).expect("valid");
        let states = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
        let states = states.map(|(column, row)| state(column, row)).collect();
        Map::new(StateMap::from_states(lattice, states))
    }

    #[test]
    fn distances_are_those_of_the_nearest_cell_of_the_state_also_beyond_the_border() {
        let map = map(30, 20, |column, row| match (column, row) {
            (7, 5) | (21, 16) => CellState::Occupied,
            (0..=15, _) => CellState::Free,
            _ => CellState::Unknown,
        });
        let distances = Distances::new(&map);
        for row in -6_i32..28 {
            for column in -9_i32..41 {
                let seen = distances.at([f64::from(column) + 0.4, f64::from(row) + 0.7], 0);
                let nearest = [(7, 5), (21, 16)].map(|(x, y): (i32, i32)| (column - x).abs() + (row - y).abs());
                let nearest = f64::from(nearest[0].min(nearest[1]));
                let inside = (0..30).contains(&column) && (0..20).contains(&row);
                if inside {
                    assert!((seen.distance - nearest).abs() < 1e-9, "at {column}, {row}");
                    assert_eq!(seen.state, map.states.at(column as u32, row as u32));
                } else {
                    assert!(seen.distance >= nearest - 1e-9 && seen.state == CellState::Unknown);
                }
            }
        }
        assert!((distances.at([3.5, 3.5], 1).distance).abs() < 1e-9);
        assert!((distances.at([20.5, 3.5], 1).distance - 5.0).abs() < 1e-9);
    }

    #[test]
    fn a_state_that_is_nowhere_is_as_far_as_can_be() {
        let distances = Distances::new(&map(9, 9, |_, _| CellState::Unknown));
        assert!((distances.at([4.5, 4.5], 0).distance - 255.0).abs() < 1e-9);
    }

    #[test]
    fn a_large_map_has_distances_of_larger_steps_in_its_own_cells() {
        let map = map(4000, 1200, |column, _| {
            if column < 3 {
                CellState::Occupied
            } else {
                CellState::Free
            }
        });
        let distances = Distances::new(&map);
        assert!(distances.states.len() <= CELLS_MAX && distances.step > 1.9);
        let seen = distances.at([60.5, 4.5], 0);
        let in_own_cells = 60.5 * distances.step - 3.0;
        assert!((seen.distance - in_own_cells).abs() <= 2.0 * distances.step, "{seen:?}");
    }
}
