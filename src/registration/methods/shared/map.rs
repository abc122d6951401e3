//! A map as the methods after the paper see it: the states of its cells, and its occupied cells as points.

use std::borrow::Cow;
use std::sync::OnceLock;

use super::hough_image::{WallPoints, to_f64};
use crate::geometry::{Point, Pose2};
use crate::grid::{CellState, Lattice};
use crate::registration::overlap::StateMap;

/// A map in cells of some size.
#[derive(Debug, Clone)]
pub(crate) struct Map {
    pub(crate) states: StateMap,
    pub(crate) points: WallPoints,
    scatter: OnceLock<Vec<[f32; 3]>>,
    moments: OnceLock<Moments>,
}

/// Where the occupied cells lie on the average, and how far from there: metres and square metres in the map's frame.
#[derive(Debug, Clone, Copy)]
struct Moments {
    mean: Point,
    spread: f64,
}

/// What a method computes of one map alone, and can compute again of the map in larger cells.
pub(crate) trait Prepared: Clone + Send + Sync {
    /// The parameters that it depends on.
    type Params: Sync;

    /// The features of a map.
    fn of(map: Map, params: &Self::Params) -> Self;

    /// The map that these are the features of.
    fn map(&self) -> &Map;

    /// The features of the same map in larger cells: what is counted in its cells then compares with a coarser map.
    /// Never finer: that would invent cells, and memory for them.
    fn at_cell(&self, cell: f64, params: &Self::Params) -> Cow<'_, Self> {
        if self.map().cell() > cell * (1.0 - 1e-9) {
            return Cow::Borrowed(self);
        }
        Cow::Owned(Self::of(Map::new(coarsened(&self.map().states, cell)), params))
    }
}

impl Map {
    pub(crate) fn new(states: StateMap) -> Self {
        Self {
            points: WallPoints::new(&states),
            states,
            scatter: OnceLock::new(),
            moments: OnceLock::new(),
        }
    }

    /// Side of a cell in metres.
    pub(crate) fn cell(&self) -> f64 {
        self.states.lattice().resolution()
    }

    /// Metres of occupied cells.
    pub(crate) fn wall_m(&self) -> f64 {
        to_f64(self.points.len()) * self.cell()
    }

    /// For each occupied cell the share of a pose's directions that it holds, as the matrix `[[xx, xy], [xy, yy]]` of
    /// trace 1 in the map's frame: `n n^T` amid a straight wall of normal n, half the identity in clutter. From the
    /// occupied cells within three cells; with their covariance C it is `I - C / tr C`. Computed when first asked for.
    pub(crate) fn scatter(&self) -> &[[f32; 3]] {
        self.scatter.get_or_init(|| scatter(&self.states))
    }

    /// RMS distance in metres between the map's occupied cells under two poses.
    pub(crate) fn distance_between(&self, one: Pose2, other: Pose2) -> f64 {
        let Moments { mean, spread } = *self.moments.get_or_init(|| self.moments());
        // about their mean the cells are apart by the chord of the turn, and all by the distance of the mean
        let (here, there) = (one.apply(mean), other.apply(mean));
        let chord = 2.0 * ((one.yaw() - other.yaw()).radians() / 2.0).sin();
        ((here[0] - there[0]).powi(2) + (here[1] - there[1]).powi(2) + chord * chord * spread).sqrt()
    }
}

impl Map {
    fn moments(&self) -> Moments {
        let points = &self.points;
        let count = to_f64(points.len().max(1));
        let (mut mean, mut square) = ([0.0; 2], 0.0);
        for [x, y] in points.local.iter().map(|point| point.map(f64::from)) {
            mean = [mean[0] + x / count, mean[1] + y / count];
            square += (x * x + y * y) / count;
        }
        Moments {
            mean: [0, 1].map(|k| (points.center[k] + mean[k]) * self.cell()),
            spread: (square - mean[0] * mean[0] - mean[1] * mean[1]).max(0.0) * self.cell().powi(2),
        }
    }
}

/// See [`Map::scatter`]; in the order of the map's points.
fn scatter(map: &StateMap) -> Vec<[f32; 3]> {
    const REACH: u32 = 3;
    let lattice = map.lattice();
    let (sin, cos) = lattice.origin().yaw().sin_cos();
    let mut out = Vec::with_capacity(map.counts().occupied);
    for (row, states) in (0_u32..).zip(map.states().chunks(lattice.width() as usize)) {
        for column in (0_u32..)
            .zip(states)
            .filter(|(_, state)| **state == CellState::Occupied)
            .map(|(at, _)| at)
        {
            let (mut count, mut mean, mut square) = (0.0, [0.0; 2], [0.0; 3]);
            for j in row.saturating_sub(REACH)..=(row + REACH).min(lattice.height() - 1) {
                for i in column.saturating_sub(REACH)..=(column + REACH).min(lattice.width() - 1) {
                    if map.at(i, j) == CellState::Occupied {
                        let (x, y) = (f64::from(i) - f64::from(column), f64::from(j) - f64::from(row));
                        count += 1.0;
                        mean = [mean[0] + x, mean[1] + y];
                        square = [square[0] + x * x, square[1] + x * y, square[2] + y * y];
                    }
                }
            }
            let [mx, my] = mean.map(|sum| sum / count);
            let [xx, xy, yy] = [
                square[0] / count - mx * mx,
                square[1] / count - mx * my,
                square[2] / count - my * my,
            ];
            let trace = xx + yy;
            let along = if trace > 0.0 {
                [yy / trace, -xy / trace, xx / trace] // the adjugate of C over its trace is I - C / tr C
            } else {
                [0.5, 0.0, 0.5]
            };
            out.push(turned(along, (sin, cos)).map(narrow));
        }
    }
    out
}

/// `R S R^T` of a symmetric matrix `[xx, xy, yy]`.
pub(crate) fn turned([xx, xy, yy]: [f64; 3], (sin, cos): (f64, f64)) -> [f64; 3] {
    let cross = 2.0 * sin * cos * xy;
    [
        cos * cos * xx - cross + sin * sin * yy,
        sin * cos * (xx - yy) + (cos * cos - sin * sin) * xy,
        sin * sin * xx + cross + cos * cos * yy,
    ]
}

#[expect(clippy::cast_possible_truncation, reason = "shares in [-1, 1]")]
fn narrow(share: f64) -> f32 {
    share as f32
}

/// The map in larger cells: occupied where any of its cells is, so that thin walls stay whole; else free where any is.
pub(crate) fn coarsened(map: &StateMap, cell: f64) -> StateMap {
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
    use crate::geometry::Angle;
    use proptest::prelude::*;

    fn map(width: u32, origin: Pose2) -> Map {
        let lattice = Lattice::new(width, 40, 0.1, origin).expect("valid");
        let state = |i: usize| match i % 7 {
            0 => CellState::Occupied,
            1..=4 => CellState::Free,
            _ => CellState::Unknown,
        };
        let states = (0..lattice.cell_count()).map(state).collect();
        Map::new(StateMap::from_states(lattice, states))
    }

    fn pose() -> impl Strategy<Value = Pose2> {
        (-9.0..9.0_f64, -9.0..9.0_f64, -4.0..4.0_f64).prop_map(|(x, y, yaw)| Pose2::new(x, y, Angle::from_radians(yaw)))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn the_distance_of_two_poses_is_that_of_the_cells_under_them(one in pose(), other in pose()) {
            let map = map(50, Pose2::new(3.0, -2.0, Angle::from_degrees(25.0)));
            let lattice = map.states.lattice();
            let (mut sum, mut count) = (0.0, 0.0);
            for row in 0..lattice.height() {
                for column in 0..lattice.width() {
                    if map.states.at(column, row) == CellState::Occupied {
                        let center = lattice.cell_center(column, row);
                        let (a, b) = (one.apply(center), other.apply(center));
                        sum += (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
                        count += 1.0;
                    }
                }
            }
            let slow = (sum / count).sqrt();
            prop_assert!((map.distance_between(one, other) - slow).abs() < 1e-3 * (1.0 + slow));
        }
    }

    #[test]
    fn a_straight_wall_holds_the_direction_of_its_normal_and_a_lone_cell_all_alike() {
        for degrees in [0.0, 30.0, -75.0] {
            let yaw = Angle::from_degrees(degrees);
            let lattice = Lattice::new(30, 20, 0.1, Pose2::new(4.0, 1.0, yaw)).expect("valid");
            let states = (0..600).map(|i| match (i % 30, i / 30) {
                (3..=20, 5) | (28, 18) => CellState::Occupied,
                _ => CellState::Free,
            });
            let map = Map::new(StateMap::from_states(lattice, states.collect()));
            let (sin, cos) = (yaw + Angle::QUARTER_TURN).sin_cos();
            let close = |a: [f32; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6);
            let [wall, .., lone] = map.scatter() else {
                panic!("19 cells")
            };
            assert!(close(*wall, [cos * cos, sin * cos, sin * sin]), "{wall:?} at {degrees}");
            assert!(close(*lone, [0.5, 0.0, 0.5]));
            assert_eq!(map.scatter().len(), map.points.len());
        }
    }

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
        let fine = Map::new(StateMap::from_states(lattice, states));
        let coarse = Map::new(coarsened(&fine.states, 0.1));
        let map = &coarse.states;
        assert_eq!((map.lattice().width(), map.lattice().height()), (20, 15));
        for row in 0..15 {
            assert_eq!(map.at(6, row), CellState::Occupied);
            assert_eq!((map.at(5, row), map.at(19, row)), (CellState::Free, CellState::Unknown));
        }
        assert!((coarse.wall_m() - 1.5).abs() < 1e-9 && (fine.wall_m() - 1.5).abs() < 1e-9);
    }

    #[test]
    fn enormous_cells_leave_one() {
        let lattice = Lattice::new(40, 30, 0.05, Pose2::IDENTITY).expect("valid");
        let fine = StateMap::from_states(lattice, vec![CellState::Free; 1200]);
        let coarse = coarsened(&fine, 100.0);
        assert_eq!(coarse.lattice().cell_count(), 1);
        assert_eq!(coarse.at(0, 0), CellState::Free);
    }
}
