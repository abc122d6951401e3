//! A small synthetic world for the tests: walls of differing lengths, and maps cut from it in frames of known poses.

use crate::geometry::{Angle, Point, Pose2};
use crate::grid::{Lattice, LogOdds, OccupancyGrid};

/// Walls of a world, as segments in metres.
pub(crate) struct World {
    walls: Vec<(Point, Point)>,
    thickness: f64,
}

/// The part of a world that a robot has seen: a rectangle in the world's frame, in metres.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    pub(crate) low: Point,
    pub(crate) high: Point,
}

impl World {
    pub(crate) fn of_walls(walls: &[[f64; 4]]) -> Self {
        let walls = walls.iter().map(|[ax, ay, bx, by]| ([*ax, *ay], [*bx, *by])).collect();
        Self { walls, thickness: 0.1 }
    }

    /// Rooms of different sizes along a corridor, with doors and one skew wall: 22 m x 14 m.
    pub(crate) fn office() -> Self {
        Self::of_walls(&[
            [0.0, 0.0, 22.0, 0.0],
            [0.0, 14.0, 22.0, 14.0],
            [0.0, 0.0, 0.0, 14.0],
            [22.0, 0.0, 22.0, 14.0],
            // the corridor's sides, with doors
            [0.0, 6.0, 2.2, 6.0],
            [3.1, 6.0, 9.0, 6.0],
            [10.0, 6.0, 14.5, 6.0],
            [15.4, 6.0, 22.0, 6.0],
            [0.0, 8.2, 5.0, 8.2],
            [6.0, 8.2, 12.7, 8.2],
            [13.6, 8.2, 18.1, 8.2],
            // walls between rooms
            [4.3, 0.0, 4.3, 6.0],
            [8.1, 0.0, 8.1, 4.7],
            [12.6, 0.0, 12.6, 6.0],
            [17.2, 1.4, 17.2, 6.0],
            [6.9, 8.2, 6.9, 14.0],
            [11.3, 9.3, 11.3, 14.0],
            [15.9, 8.2, 15.9, 12.8],
            // skew
            [13.6, 1.0, 16.4, 3.8],
            [8.0, 10.2, 10.2, 13.4],
        ])
    }

    /// A hall with columns of walls quite unlike the office's.
    pub(crate) fn hall() -> Self {
        Self::of_walls(&[
            [1.0, 1.0, 17.3, 1.0],
            [17.3, 1.0, 20.9, 9.4],
            [20.9, 9.4, 12.1, 13.0],
            [12.1, 13.0, 1.0, 10.1],
            [1.0, 10.1, 1.0, 1.0],
            [3.6, 3.0, 7.7, 5.1],
            [9.3, 7.0, 12.9, 6.2],
            [14.0, 3.2, 15.1, 7.8],
        ])
    }

    fn is_wall(&self, p: Point) -> bool {
        self.walls.iter().any(|(a, b)| {
            let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
            let share = (along[0] * to[0] + along[1] * to[1]) / (along[0].powi(2) + along[1].powi(2));
            let share = share.clamp(0.0, 1.0);
            let off = [to[0] - share * along[0], to[1] - share * along[1]];
            off[0].hypot(off[1]) <= self.thickness / 2.0
        })
    }

    /// The map of what was seen, in the frame whose pose in the world is given, on a lattice along that frame.
    pub(crate) fn map(&self, seen: Seen, pose_world_map: Pose2, resolution: f64) -> OccupancyGrid {
        let to_map = pose_world_map.inverse();
        let corners = [
            seen.low,
            [seen.high[0], seen.low[1]],
            seen.high,
            [seen.low[0], seen.high[1]],
        ];
        let corners = corners.map(|corner| to_map.apply(corner));
        let low = [0, 1].map(|k| corners.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min) - 0.3);
        let high = [0, 1].map(|k| corners.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max) + 0.3);
        let cells = |k: usize| ((high[k] - low[k]) / resolution).ceil() as u32;
        let origin = Pose2::new(low[0], low[1], Angle::ZERO);
        let lattice = Lattice::new(cells(0), cells(1), resolution, origin).expect("a valid lattice");
        let mut states = Vec::with_capacity(lattice.cell_count());
        for row in 0..lattice.height() {
            for column in 0..lattice.width() {
                let p = pose_world_map.apply(lattice.cell_center(column, row));
                let inside = (0..2).all(|k| seen.low[k] <= p[k] && p[k] <= seen.high[k]);
                states.push(match (inside, self.is_wall(p)) {
                    (false, _) => LogOdds::UNKNOWN,
                    (true, true) => LogOdds::OCCUPIED,
                    (true, false) => LogOdds::FREE,
                });
            }
        }
        OccupancyGrid::new(lattice, states).expect("as many cells")
    }
}
