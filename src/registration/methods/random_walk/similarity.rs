//! The similarity of two maps under a pose, which the walk makes small.
//!
//! **Method.** With the states c occupied and free,
//!
//! 1. `d(a, b, c) = mean over cells p of a with state c of the Manhattan distance from p to the nearest cell of b with state c`,
//!    at most `distance_max_cells` (Birk and Carpin's map distance);
//! 2. `psi = sum over c of d(fixed, moving, c) + d(moving, fixed, c)`;
//! 3. the lock: a cell agrees when a cell of its state lies within one cell in the other map, and disagrees when it does not and
//!    the other map knows better; `delta = psi + lock * mean over the four sums of (disagreeing - agreeing share)`.
//!
//! **Shapes and units.** Cells.
//!
//! **Cost.** One look into a distance map for each sample.
//!
//! **Differences from the source.** The sums run over samples of the cells. The lock counts shares instead of numbers of cells,
//! and occupied cells as much as free ones, of which there are many more; agreement has a tolerance of one cell.

use super::distances::{Distances, STATES};
use super::params::RandomWalkParams;
use crate::geometry::{Point, Pose2};
use crate::grid::CellState;
use crate::registration::methods::shared::hough_image::to_f64;
use crate::registration::methods::shared::map::Map;

/// Samples of a map's cells: for each of [`STATES`] the centres in metres in the map's frame.
#[derive(Debug, Clone)]
pub(super) struct Samples([Vec<Point>; 2]);

impl Samples {
    /// At most so many of each state, evenly spread over the order of the cells.
    pub(super) fn new(map: &Map, most: u32) -> Self {
        Self(STATES.map(|state| samples(map, state, most as usize)))
    }
}

fn samples(map: &Map, state: CellState, most: usize) -> Vec<Point> {
    let lattice = map.states.lattice();
    let counts = map.states.counts();
    let count = if state == CellState::Occupied {
        counts.occupied
    } else {
        counts.free
    };
    let mut points = Vec::with_capacity(most.min(count));
    let mut seen = 0_usize;
    for (row, states) in (0_u32..).zip(map.states.states().chunks(lattice.width() as usize)) {
        for (column, _) in (0_u32..).zip(states).filter(|(_, cell)| **cell == state) {
            // the k-th sample is the first cell at or behind k / most of all
            if seen * most / count != (seen + 1) * most / count || most >= count {
                points.push(lattice.cell_center(column, row));
            }
            seen += 1;
        }
    }
    points
}

/// Two maps whose similarity can be asked for.
pub(super) struct Similarity<'a> {
    pub(super) fixed: (&'a Distances, &'a Samples),
    pub(super) moving: (&'a Distances, &'a Samples),
    distance_max: f64,
    lock: f64,
}

impl<'a> Similarity<'a> {
    pub(super) fn new(
        fixed: (&'a Distances, &'a Samples),
        moving: (&'a Distances, &'a Samples),
        params: &RandomWalkParams,
    ) -> Self {
        Self {
            fixed,
            moving,
            distance_max: f64::from(params.distance_max_cells),
            lock: params.lock_cells,
        }
    }

    /// delta of a pose: the smaller, the more alike.
    pub(super) fn of(&self, pose_fixed_moving: Pose2) -> f64 {
        self.one_way(self.fixed.0, self.moving.1, pose_fixed_moving)
            + self.one_way(self.moving.0, self.fixed.1, pose_fixed_moving.inverse())
    }

    fn one_way(&self, distances: &Distances, samples: &Samples, pose: Pose2) -> f64 {
        let lattice = distances.lattice();
        let motion = (lattice.origin().inverse() * pose).motion();
        let scale = 1.0 / lattice.resolution();
        let mut delta = 0.0;
        for (state, points) in samples.0.iter().enumerate() {
            if points.is_empty() {
                continue;
            }
            let (mut distance, mut balance) = (0.0, 0_i32);
            for point in points {
                let seen = distances.at(motion.apply(*point).map(|metres| metres * scale), state);
                distance += seen.distance.min(self.distance_max);
                if seen.distance <= 1.0 {
                    balance -= 1;
                } else if seen.state != CellState::Unknown {
                    balance += 1;
                }
            }
            delta += (distance + self.lock / 4.0 * f64::from(balance)) / to_f64(points.len());
        }
        delta
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::registration::methods::shared::contract::Trial;
    use crate::registration::overlap::StateMap;

    #[test]
    fn maps_are_most_alike_where_they_lie() {
        let trial = Trial::partial_overlap(3.0, -2.0, 25.0);
        let maps = [&trial.fixed, &trial.moving].map(|grid| Map::new(StateMap::new(grid)));
        let distances = [0, 1].map(|k| Distances::new(&maps[k]));
        let samples = [0, 1].map(|k| Samples::new(&maps[k], 500));
        let params = RandomWalkParams::default();
        let similarity = Similarity::new((&distances[0], &samples[0]), (&distances[1], &samples[1]), &params);
        let there = similarity.of(trial.truth);
        for (x, y, degrees) in [
            (0.4, 0.0, 0.0),
            (0.0, -0.5, 0.0),
            (0.0, 0.0, 4.0),
            (3.0, 1.0, 90.0),
            (0.0, 0.0, 180.0),
        ] {
            let off = similarity.of(trial.truth * Pose2::new(x, y, Angle::from_degrees(degrees)));
            assert!(
                off > there + 0.5,
                "{off} at {x}, {y}, {degrees}, and {there} at the truth"
            );
        }
    }

    #[test]
    fn samples_are_spread_over_all_cells_and_no_more_than_asked_for() {
        let map = Map::new(StateMap::new(&Trial::full_overlap(0.0, 0.0, 0.0).fixed));
        let counts = map.states.counts();
        for most in [10, 333, 1_000_000] {
            let Samples([occupied, free]) = Samples::new(&map, most);
            assert_eq!(occupied.len(), counts.occupied.min(most as usize));
            assert_eq!(free.len(), counts.free.min(most as usize));
        }
        let Samples([occupied, _]) = Samples::new(&map, 10);
        let spread = |k: usize| {
            let of = |f: fn(f64, f64) -> f64, start| occupied.iter().map(|p| p[k]).fold(start, f);
            of(f64::max, f64::NEG_INFINITY) - of(f64::min, f64::INFINITY)
        };
        assert!(spread(0) > 8.0 && spread(1) > 8.0);
    }
}
