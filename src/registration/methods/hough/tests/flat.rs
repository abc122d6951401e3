//! A flat of rooms, and maps of it.

use crate::geometry::{Angle, Point, Pose2};
use crate::grid::{CellState, Lattice, LogOdds, OccupancyGrid};
use crate::registration::methods::hough::num::round64;

/// A flat of rooms of different sizes with doors, `(x0, y0, x1, y1)` in metres; nothing in it repeats.
const ROOMS: [(f64, f64, f64, f64); 6] = [
    (0.0, 0.0, 4.2, 3.1),
    (4.2, 0.0, 7.3, 5.0),
    (0.0, 3.1, 4.2, 8.3),
    (4.2, 5.0, 11.9, 8.3),
    (7.3, 0.0, 11.9, 5.0),
    (11.9, 1.3, 15.1, 6.1),
];
const DOORS: [Point; 5] = [[4.2, 1.5], [2.0, 3.1], [6.0, 5.0], [9.0, 5.0], [11.9, 3.7]];

fn state(point: Point) -> CellState {
    let [x, y] = point;
    if DOORS.iter().any(|door| (door[0] - x).hypot(door[1] - y) < 0.5) {
        return CellState::Free;
    }
    let mut state = CellState::Unknown;
    for (x0, y0, x1, y1) in ROOMS {
        if x < x0 - 0.05 || x > x1 + 0.05 || y < y0 - 0.05 || y > y1 + 0.05 {
            continue;
        }
        let wall = (x - x0)
            .abs()
            .min((x - x1).abs())
            .min((y - y0).abs())
            .min((y - y1).abs());
        if wall <= 0.05 {
            return CellState::Occupied;
        }
        state = CellState::Free;
    }
    state
}

/// The flat, looked at from a frame that stands at `pose_world_map` in it; only what `seen` lets through.
pub(in super::super) fn map(resolution: f64, pose_world_map: Pose2, seen: impl Fn(Point) -> bool) -> OccupancyGrid {
    // large enough for the flat however it is turned
    let side = 40.0;
    let cells = round64(side / resolution);
    let count = u32::try_from(cells).expect("a small map");
    let center = pose_world_map.inverse().apply([7.5, 4.0]);
    let origin = Pose2::new(center[0] - 0.5 * side, center[1] - 0.5 * side, Angle::ZERO);
    let lattice = Lattice::new(count, count, resolution, origin).expect("a valid lattice");
    let mut grid = OccupancyGrid::unknown(lattice);
    for row in 0..count {
        for column in 0..count {
            let world = pose_world_map.apply(lattice.cell_center(column, row));
            if seen(world) {
                grid.cells_mut()[lattice.index(column, row)] = match state(world) {
                    CellState::Unknown => LogOdds::UNKNOWN,
                    CellState::Free => LogOdds::FREE,
                    CellState::Occupied => LogOdds::OCCUPIED,
                };
            }
        }
    }
    grid
}

pub(in super::super) fn everything(_: Point) -> bool {
    true
}
