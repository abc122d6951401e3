//! The cluttered world of figures 16 and 18: 640 x 480 cells that are known throughout, cut into two maps, and bent.

use crate::experiments::numbers::{index, real};
use crate::geometry::{Angle, Point, Pose2};
use crate::grid::{CellState, Lattice, LogOdds, OccupancyGrid};
use crate::simulation::{Random, Scene, Shape};

const CELL: f64 = 0.05;
const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

/// A hall of 32 m x 24 m with pieces of wall at right angles, blocks in all directions, and columns. The frame's origin is
/// in the middle.
pub(in crate::experiments) fn cluttered_map(seed: u64) -> OccupancyGrid {
    let (half_x, half_y) = (f64::from(WIDTH) * CELL / 2.0, f64::from(HEIGHT) * CELL / 2.0);
    let mut random = Random::new(seed, &[16]);
    let mut strokes: Vec<(Shape, bool)> = Vec::new();
    let wall = |from: Point, to: Point| {
        (
            Shape::Bar {
                from,
                to,
                thickness: 0.15,
            },
            true,
        )
    };
    let edge = |x: f64, y: f64| [x * (half_x - 0.1), y * (half_y - 0.1)];
    for [a, b] in [
        [[-1.0, -1.0], [1.0, -1.0]],
        [[1.0, -1.0], [1.0, 1.0]],
        [[1.0, 1.0], [-1.0, 1.0]],
        [[-1.0, 1.0], [-1.0, -1.0]],
    ] {
        strokes.push(wall(edge(a[0], a[1]), edge(b[0], b[1])));
    }
    let place = |random: &mut Random| {
        [
            random.uniform(-half_x, half_x) * 0.94,
            random.uniform(-half_y, half_y) * 0.94,
        ]
    };
    for _ in 0..26 {
        let [x, y] = place(&mut random);
        let length = random.uniform(1.5, 6.0);
        let (dx, dy) = if random.chance(0.5) {
            (length, 0.0)
        } else {
            (0.0, length)
        };
        let within = |v: f64, half: f64| v.clamp(0.1 - half, half - 0.1);
        strokes.push(wall([x, y], [within(x + dx, half_x), within(y + dy, half_y)]));
    }
    for _ in 0..45 {
        let [x, y] = place(&mut random);
        let pose = Pose2::new(x, y, Angle::from_degrees(random.uniform(-90.0, 90.0)));
        strokes.push((
            Shape::block(pose, random.uniform(0.4, 2.2), random.uniform(0.3, 1.2)),
            true,
        ));
    }
    for _ in 0..25 {
        let radius = random.uniform(0.1, 0.4);
        let center = place(&mut random);
        strokes.push((Shape::Disc { center, radius }, true));
    }
    drawn(&Scene::draw(&strokes), Pose2::new(-half_x, -half_y, Angle::ZERO))
}

/// What robots would know of the scene: free space, the outer 0.1 m of what is solid, and nothing of its inside.
fn drawn(scene: &Scene, origin: Pose2) -> OccupancyGrid {
    let lattice = Lattice::new(WIDTH, HEIGHT, CELL, origin).expect("invariant: a small lattice");
    let solid = |column: i64, row: i64| {
        let cell = |at: i64| real(usize::try_from(at).unwrap_or(0));
        let inside = (0..i64::from(WIDTH)).contains(&column) && (0..i64::from(HEIGHT)).contains(&row);
        !inside || scene.is_solid(lattice.to_metres([cell(column) + 0.5, cell(row) + 0.5]))
    };
    let rim = |column: i64, row: i64| (-2..=2).any(|dy| (-2..=2).any(|dx| !solid(column + dx, row + dy)));
    let cells = (0..i64::from(HEIGHT))
        .flat_map(|row| (0..i64::from(WIDTH)).map(move |column| (column, row)))
        .map(|(column, row)| match (solid(column, row), rim(column, row)) {
            (false, _) => LogOdds::FREE,
            (true, true) => LogOdds::OCCUPIED,
            (true, false) => LogOdds::UNKNOWN,
        });
    OccupancyGrid::new(lattice, cells.collect()).expect("invariant: a cell a place")
}

/// The left and the right part of a map, each with half of it and half of the overlap: a share `overlap` of the whole map
/// is in both (figure 16).
pub(in crate::experiments) fn cut(map: &OccupancyGrid, overlap: f64) -> [OccupancyGrid; 2] {
    let width = f64::from(map.lattice().width());
    let half = index((width * (1.0 + overlap) / 2.0).round()).clamp(1, map.lattice().width());
    [
        columns(map, 0..half),
        columns(map, map.lattice().width() - half..map.lattice().width()),
    ]
}

fn columns(map: &OccupancyGrid, range: std::ops::Range<u32>) -> OccupancyGrid {
    let whole = map.lattice();
    let [x, y] = whole.to_metres([f64::from(range.start), 0.0]);
    let origin = Pose2::new(x, y, whole.origin().yaw());
    let lattice = Lattice::new(range.end - range.start, whole.height(), whole.resolution(), origin)
        .expect("invariant: a part of a lattice is a lattice");
    let span = range.start as usize..range.end as usize;
    let cells = (0..whole.height()).flat_map(|row| map.row(row)[span.clone()].iter().copied());
    OccupancyGrid::new(lattice, cells.collect()).expect("invariant: a cell a place")
}

/// The map bent by eq. 40: each cell turned about the middle of the map by `alpha` for every cell of its distance.
///
/// `R_d` of the paper turns clockwise for a positive alpha; so does this. A turn keeps the distance, so the cell that comes
/// to a place is the one at the same distance, turned back.
pub(in crate::experiments) fn distorted(map: &OccupancyGrid, alpha: Angle) -> OccupancyGrid {
    let lattice = *map.lattice();
    let middle = [f64::from(lattice.width()) / 2.0, f64::from(lattice.height()) / 2.0];
    let cells = (0..lattice.height())
        .flat_map(|row| (0..lattice.width()).map(move |column| (column, row)))
        .map(|(column, row)| {
            let offset = [f64::from(column) + 0.5 - middle[0], f64::from(row) + 0.5 - middle[1]];
            let distance = offset[0].hypot(offset[1]);
            let (sin, cos) = (distance * alpha.radians()).sin_cos();
            let from = [cos * offset[0] - sin * offset[1], sin * offset[0] + cos * offset[1]];
            lattice
                .cell_of([from[0] + middle[0], from[1] + middle[1]])
                .map_or(LogOdds::UNKNOWN, |(i, j)| map.at(i, j))
        });
    OccupancyGrid::new(lattice, cells.collect()).expect("invariant: a cell a place")
}

/// The share of the truth's known cells that the merged map has in the same state (the similarity of figure 17). Maps are
/// added up by their log odds on the truth's cells (eq. 14); what nobody knows there does not match.
pub(in crate::experiments) fn similarity(truth: &OccupancyGrid, maps: &[(&OccupancyGrid, Pose2)]) -> f64 {
    let mut merged = OccupancyGrid::unknown(*truth.lattice());
    for (map, pose) in maps {
        crate::grid::resample_onto(&mut merged, map, *pose, LogOdds::fused_with);
    }
    let (mut known, mut alike) = (0, 0);
    for (wanted, found) in truth.cells().iter().zip(merged.cells()) {
        if wanted.state() != CellState::Unknown {
            known += 1;
            alike += usize::from(wanted.state() == found.state());
        }
    }
    real(alike) / real(known.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_parts_have_as_much_in_common_as_told_and_make_up_the_whole() {
        let map = cluttered_map(3);
        assert_eq!((map.lattice().width(), map.lattice().height()), (640, 480));
        for overlap in [0.1, 0.5, 0.9] {
            let [left, right] = cut(&map, overlap);
            let common = left.lattice().width() + right.lattice().width() - 640;
            assert!((f64::from(common) / 640.0 - overlap).abs() < 0.005);
            let parts = [(&left, Pose2::IDENTITY), (&right, Pose2::IDENTITY)];
            assert!((similarity(&map, &parts) - 1.0).abs() < 1e-12);
            assert!(similarity(&map, &parts[..1]) < f64::midpoint(1.0, overlap) + 0.1);
        }
    }

    #[test]
    fn the_distortion_leaves_the_middle_and_turns_the_rim_by_alpha_times_the_distance() {
        let map = cluttered_map(3);
        assert_eq!(distorted(&map, Angle::ZERO), map);
        // a lone cell 200 cells to the right of the middle
        let lattice = *map.lattice();
        let mut cells = vec![LogOdds::FREE; lattice.cell_count()];
        for row in 237..243 {
            for column in 517..523 {
                cells[lattice.index(column, row)] = LogOdds::OCCUPIED;
            }
        }
        let spot = OccupancyGrid::new(lattice, cells).expect("as many");
        let bent = distorted(&spot, Angle::from_degrees(0.1));
        let [x, y] = crate::experiments::frames::middle_of_walls(&bent);
        let angle = y.atan2(x).to_degrees();
        assert!(
            (x.hypot(y) - 10.0).abs() < 0.1 && (angle + 20.0).abs() < 1.0,
            "{angle} degrees: clockwise, as eq. 40"
        );
    }
}
