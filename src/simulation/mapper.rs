//! Occupancy mapping from known poses and scans.
//!
//! Convention: the map's frame is any pose in the world; the lattice may be yawed within it.
//! Method: the inverse sensor model of a beam says free for the cells that it crosses and occupied for the cell that it
//! ends in; a scan says at most one of the two about a cell, occupied before free, so that beams which graze a wall do
//! not wear it away. (1) `l = hits * l_hit - misses * l_miss`, clamped. Sums of counts, so the order of scans is
//! without effect. Beams without return say nothing, or free up to a limit.
//! Cost: one step for every cell crossed, about 10^7 for 150 scans of 361 beams at 0.05 m.

use super::drive::{DriveLog, ends};
use super::lidar::{Lidar, Observation};
use super::numbers::index;
use super::shape::around;
use super::{Random, SimulationError, within};
use crate::geometry::{Angle, Point, Pose2};
use crate::grid::{Lattice, LogOdds, OccupancyGrid};

/// How scans become a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapperParams {
    /// Side of a cell in metres; 0.01 to 1, default 0.05.
    pub resolution: f64,
    /// Yaw of the lattice in the map's frame; default 0.
    pub lattice_yaw: Angle,
    /// Log odds of a hit; default 3.0: one hit is enough for an occupied cell.
    pub hit: f64,
    /// Log odds taken away by a miss; default 1.5: one miss is enough for a free cell.
    pub miss: f64,
    /// Log odds stay within +- this; default 5.5, what a map file of whole percents can say.
    pub limit: f64,
    /// Standard deviation in cells by which ends of beams are scattered, as localisation noise does; default 0.
    pub blur: f64,
    /// A beam without return is free up to this many metres; default 0: it says nothing.
    pub clear_without_return: f64,
}

impl Default for MapperParams {
    fn default() -> Self {
        Self {
            resolution: 0.05,
            lattice_yaw: Angle::ZERO,
            hit: 3.0,
            miss: 1.5,
            limit: 5.5,
            blur: 0.0,
            clear_without_return: 0.0,
        }
    }
}

/// A map in the making: counts of hits and misses on a lattice that holds the whole drive.
#[derive(Debug, Clone)]
pub struct Mapper {
    params: MapperParams,
    lattice: Lattice,
    frame: Pose2,
    hits: Vec<u16>,
    misses: Vec<u16>,
    /// The scan that last said something of the cell, twice its number, plus one for occupied.
    said: Vec<u32>,
    scans: u32,
    random: Random,
}

/// Draws the map of a whole drive, told in the frame `believed` (a pose in the world as the robot believes it).
///
/// # Errors
/// As [`Mapper::new`] and [`Mapper::map`].
pub fn draw(
    log: &DriveLog,
    believed: Pose2,
    params: MapperParams,
    seed: u64,
) -> Result<OccupancyGrid, SimulationError> {
    let mut mapper = Mapper::new(log, believed, params, seed)?;
    for observation in &log.observations {
        mapper.integrate(&log.lidar, observation);
    }
    mapper.map()
}

impl Mapper {
    /// An empty map, its lattice wide enough for all that the drive saw. `seed` scatters blurred ends.
    ///
    /// # Errors
    /// When a parameter is out of range, or nothing was seen.
    ///
    /// # Panics
    /// When the drive spreads over more cells than a lattice can have, kilometres at the default resolution.
    pub fn new(log: &DriveLog, frame: Pose2, params: MapperParams, seed: u64) -> Result<Self, SimulationError> {
        within("resolution", params.resolution, 0.01, 1.0, " m/cell")?;
        within("log odds of a hit", params.hit, 0.01, 100.0, "")?;
        within("log odds of a miss", params.miss, 0.01, 100.0, "")?;
        within("limit of the log odds", params.limit, 0.1, 255.0, "")?;
        within("blur", params.blur, 0.0, 10.0, " cells")?;
        within(
            "clearing without return",
            params.clear_without_return,
            0.0,
            1000.0,
            " m",
        )?;
        // the lattice's axes through the frame's origin
        let axes = Pose2::new(0.0, 0.0, params.lattice_yaw);
        let pose_axes_world = axes.inverse() * frame.inverse();
        let mut points: Vec<Point> = Vec::new();
        for observation in &log.observations {
            for (_, end) in ends(&log.lidar, observation, params.clear_without_return) {
                points.push(pose_axes_world.apply(end));
            }
            points.push(pose_axes_world.apply(observation.believed.translation()));
        }
        if log.observations.iter().all(|o| o.ranges.iter().all(Option::is_none)) {
            return Err(SimulationError::NothingSeen);
        }
        let [low, high] = around(&points, params.resolution * (2.0 + 6.0 * params.blur));
        let snap = |metres: f64| (metres / params.resolution).floor() * params.resolution;
        let (x, y) = (snap(low[0]), snap(low[1]));
        let cells = |length: f64| index((length / params.resolution).ceil()) + 1;
        let lattice = Lattice::new(
            cells(high[0] - x),
            cells(high[1] - y),
            params.resolution,
            axes * Pose2::new(x, y, Angle::ZERO),
        )
        .expect("invariant: a drive of some hundred metres fits on a lattice");
        let count = lattice.cell_count();
        Ok(Self {
            params,
            lattice,
            frame,
            hits: vec![0; count],
            misses: vec![0; count],
            said: vec![0; count],
            scans: 0,
            random: Random::new(seed, &[]),
        })
    }

    /// Adds what one scan says.
    pub fn integrate(&mut self, lidar: &Lidar, observation: &Observation) {
        self.scans += 1;
        let pose_map_world = self.frame.inverse();
        let start = self
            .lattice
            .to_cells(pose_map_world.apply(observation.believed.translation()));
        let rays: Vec<(bool, Point)> = ends(lidar, observation, self.params.clear_without_return)
            .map(|(hit, end)| {
                let [u, v] = self.lattice.to_cells(pose_map_world.apply(end));
                let blur = if hit { self.params.blur } else { 0.0 };
                let scatter = [self.random.normal(blur), self.random.normal(blur)];
                (hit, [u + scatter[0], v + scatter[1]])
            })
            .collect();
        for (_, end) in rays.iter().filter(|(hit, _)| *hit) {
            if let Some((column, row)) = self.lattice.cell_of(*end) {
                self.say(self.lattice.index(column, row), true);
            }
        }
        for (_, end) in rays {
            self.cross(start, end);
        }
    }

    /// The map so far, cropped to what is known.
    ///
    /// # Errors
    /// [`SimulationError::NothingSeen`] when nothing is.
    ///
    /// # Panics
    /// Never: a part of a lattice is a lattice.
    pub fn map(&self) -> Result<OccupancyGrid, SimulationError> {
        let width = self.lattice.width() as usize;
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for cell in (0..self.hits.len()).filter(|&cell| self.hits[cell] > 0 || self.misses[cell] > 0) {
            let place = [cell % width, cell / width];
            low = [low[0].min(place[0]), low[1].min(place[1])];
            high = [high[0].max(place[0]), high[1].max(place[1])];
        }
        if low[0] > high[0] {
            return Err(SimulationError::NothingSeen);
        }
        let ([left, bottom], [right, top]) = (low, high);
        let at = |cells: usize| index(super::numbers::real(cells));
        let [x, y] = self.lattice.to_metres([f64::from(at(left)), f64::from(at(bottom))]);
        let lattice = Lattice::new(
            at(right - left + 1),
            at(top - bottom + 1),
            self.lattice.resolution(),
            Pose2::new(x, y, self.lattice.origin().yaw()),
        )
        .expect("invariant: a part of a lattice is a lattice");
        let cells = (bottom..=top)
            .flat_map(|row| (left..=right).map(move |column| row * width + column))
            .map(|cell| self.log_odds(cell))
            .collect();
        Ok(OccupancyGrid::new(lattice, cells).expect("invariant: as many cells as the lattice has"))
    }

    fn log_odds(&self, cell: usize) -> LogOdds {
        let (hits, misses) = (self.hits[cell], self.misses[cell]);
        if hits == 0 && misses == 0 {
            return LogOdds::UNKNOWN;
        }
        let value = f64::from(hits) * self.params.hit - f64::from(misses) * self.params.miss;
        LogOdds::from_value(value.clamp(-self.params.limit, self.params.limit))
    }

    fn say(&mut self, cell: usize, occupied: bool) {
        if self.said[cell] / 2 == self.scans {
            return;
        }
        self.said[cell] = 2 * self.scans + u32::from(occupied);
        let count = if occupied {
            &mut self.hits[cell]
        } else {
            &mut self.misses[cell]
        };
        *count = count.saturating_add(1);
    }

    /// Says free for every cell from `start` up to, not including, the cell of `end` (Amanatides and Woo).
    fn cross(&mut self, start: Point, end: Point) {
        let last = end.map(f64::floor);
        let mut cell = start.map(f64::floor);
        let slope = [end[0] - start[0], end[1] - start[1]];
        let step = slope.map(f64::signum);
        let span = slope.map(|s| if s == 0.0 { f64::INFINITY } else { 1.0 / s.abs() });
        let mut next = [0, 1].map(|k| {
            let border = if step[k] > 0.0 { cell[k] + 1.0 } else { cell[k] };
            if slope[k] == 0.0 {
                f64::INFINITY
            } else {
                (border - start[k]) / slope[k]
            }
        });
        let steps = (last[0] - cell[0]).abs() + (last[1] - cell[1]).abs();
        for _ in 0..super::numbers::count(steps) {
            if let Some((column, row)) = self.lattice.cell_of([cell[0] + 0.5, cell[1] + 0.5]) {
                self.say(self.lattice.index(column, row), false);
            }
            let axis = usize::from(next[1] < next[0]);
            cell[axis] += step[axis];
            next[axis] += span[axis];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::CellState;
    use crate::simulation::{Drift, Scene, Shape, Tour};

    fn room() -> Scene {
        let corners = [[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 4.0]];
        let strokes: Vec<(Shape, bool)> = (0..4)
            .map(|k| Shape::Bar {
                from: corners[k],
                to: corners[(k + 1) % 4],
                thickness: 0.2,
            })
            .map(|shape| (shape, true))
            .collect();
        Scene::draw(&strokes)
    }

    fn log(drift: Drift) -> DriveLog {
        let poses = (0..9)
            .map(|k| Pose2::new(1.0 + 0.3 * f64::from(k), 2.0, Angle::ZERO))
            .collect();
        let lidar = Lidar::new(720, std::f64::consts::TAU, 12.0, 0.0).expect("valid");
        DriveLog::record(&room(), &Tour { poses }, lidar, drift, &mut Random::new(1, &[]))
    }

    #[test]
    fn walls_are_drawn_where_the_walls_are_whatever_the_frame_and_the_lattice() {
        for (frame, lattice_yaw) in [
            (Pose2::IDENTITY, Angle::ZERO),
            (
                Pose2::new(30.0, -7.0, Angle::from_radians(2.2)),
                Angle::from_radians(-0.6),
            ),
        ] {
            let log = log(Drift::default());
            let params = MapperParams {
                lattice_yaw,
                ..MapperParams::default()
            };
            let map = draw(&log, frame, params, 0).expect("a map");
            let mut occupied = 0;
            for row in 0..map.lattice().height() {
                for column in 0..map.lattice().width() {
                    let [x, y] = frame.apply(map.lattice().cell_center(column, row));
                    // distance to the inner faces of the walls, positive inside of the room
                    let inside = (x - 0.1).min(4.9 - x).min(y - 0.1).min(3.9 - y);
                    match map.at(column, row).state() {
                        CellState::Occupied => {
                            occupied += 1;
                            assert!(inside.abs() < 0.08, "({x}, {y}) is no wall");
                        }
                        CellState::Free => assert!(inside > -0.08, "({x}, {y}) is not free"),
                        CellState::Unknown => assert!(inside < 0.08, "({x}, {y}) was seen"),
                    }
                }
            }
            assert!(occupied > 300, "{occupied}");
        }
    }

    #[test]
    fn beams_without_return_say_nothing_unless_asked_to() {
        let mut log = log(Drift::default());
        log.lidar = log.lidar.with_max_range(0.5);
        for observation in &mut log.observations {
            observation
                .ranges
                .iter_mut()
                .for_each(|range| *range = range.filter(|r| *r < 0.5));
        }
        assert_eq!(
            draw(&log, Pose2::IDENTITY, MapperParams::default(), 0),
            Err(SimulationError::NothingSeen)
        );
    }

    #[test]
    fn a_drifting_robot_draws_its_map_where_it_truly_is_on_the_whole() {
        let log = log(Drift {
            heading: 0.02,
            position: 0.1,
            jitter: 0.0,
        });
        let believed = Pose2::new(1.0, 1.0, Angle::from_radians(0.5));
        let truth = log.true_frame(believed);
        let off = truth.inverse() * believed;
        assert!(off != Pose2::IDENTITY && off.translation()[0].hypot(off.translation()[1]) < 0.2);
        assert!(off.yaw().magnitude() < 0.02);
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let params = MapperParams {
            resolution: 0.0,
            ..MapperParams::default()
        };
        let error = Mapper::new(&log(Drift::default()), Pose2::IDENTITY, params, 0).expect_err("no such cells");
        assert!(error.to_string().contains("resolution 0"), "{error}");
    }
}
