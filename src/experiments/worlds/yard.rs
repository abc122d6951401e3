//! The world of section 5.2: a walled yard with thirty blocks of many sizes and directions, and four robots that each see
//! about half of it.

use super::{Mapped, frame_at};
use crate::geometry::{Angle, Point, Pose2};
use crate::simulation::{Lidar, Planner, Random, Scene, Shape, SimulationError};

/// Side of the yard in metres.
const SIDE: f64 = 24.0;

/// Where a robot keeps to: the side of a straight fence, from one end to the other, on which its start lies. Lidars see
/// over fences. The fences are placed so that the overlaps of the maps come out as in table 1 in the yard of seed 1.
struct Beat {
    name: &'static str,
    fence: [Point; 2],
    start: Point,
    yaw: f64,
}

const BEATS: [Beat; 4] = [
    Beat {
        name: "R1",
        fence: [[0.0, 13.0], [SIDE, 15.0]],
        start: [12.0, 19.5],
        yaw: 0.0,
    },
    Beat {
        name: "R2",
        fence: [[12.5, 0.0], [15.5, SIDE]],
        start: [5.0, 12.0],
        yaw: 40.0,
    },
    Beat {
        name: "R3",
        fence: [[0.0, 11.0], [SIDE, 9.0]],
        start: [12.0, 4.5],
        yaw: -75.0,
    },
    Beat {
        name: "R4",
        fence: [[16.5, 0.0], [14.0, SIDE]],
        start: [20.0, 12.0],
        yaw: 160.0,
    },
];

/// The four robots' maps. The yard is that of its seed; the frames nearly have one origin.
///
/// # Errors
/// When a robot has nowhere to drive.
pub(in crate::experiments) fn four_robots(seed: u64) -> Result<Vec<Mapped>, SimulationError> {
    let strokes = yard(seed);
    let scene = Scene::draw(&strokes);
    let lidar = Lidar::new(361, std::f64::consts::TAU, 5.0, 0.01)?;
    let mut random = Random::new(seed, &[11, 1]);
    BEATS
        .iter()
        .zip(0..)
        .map(|(beat, number)| {
            let [from, to] = beat.fence;
            let fence = Shape::Bar {
                from,
                to,
                thickness: 0.3,
            };
            let fenced: Vec<(Shape, bool)> = strokes.iter().copied().chain([(fence, true)]).collect();
            let planner = Planner::new(&Scene::draw(&fenced), 0.25);
            let region = planner.region(beat.start, f64::INFINITY)?;
            let tour = planner.tour(&region, 120.0, 0.4, &mut random);
            let shift = [random.uniform(-0.9, 0.9), random.uniform(-0.9, 0.9)];
            let frame = frame_at([SIDE / 2.0, SIDE / 2.0], shift, beat.yaw);
            Mapped::of_tour(beat.name, &scene, &tour, lidar, frame, seed ^ (0x40 + number))
        })
        .collect()
}

/// Walls around, and thirty blocks that leave room between them.
fn yard(seed: u64) -> Vec<(Shape, bool)> {
    const BLOCKS: usize = 30;
    let mut random = Random::new(seed, &[11]);
    let corners = [[0.0, 0.0], [SIDE, 0.0], [SIDE, SIDE], [0.0, SIDE]];
    let mut strokes: Vec<(Shape, bool)> = (0..4)
        .map(|k| Shape::Bar {
            from: corners[k],
            to: corners[(k + 1) % 4],
            thickness: 0.2,
        })
        .map(|wall| (wall, true))
        .collect();
    let mut taken: Vec<(Point, f64)> = BEATS.iter().map(|beat| (beat.start, 0.4)).collect();
    let mut left = BLOCKS;
    let mut gap = 0.8;
    while left > 0 {
        let center = [random.uniform(0.5, SIDE - 0.5), random.uniform(0.5, SIDE - 0.5)];
        let (length, depth) = (random.uniform(0.7, 4.2), random.uniform(0.4, 1.8));
        let yaw = Angle::from_degrees(random.uniform(-90.0, 90.0));
        let radius = length.hypot(depth) / 2.0;
        let free = taken
            .iter()
            .all(|([x, y], r)| (x - center[0]).hypot(y - center[1]) > r + radius + gap);
        if free {
            taken.push((center, radius));
            strokes.push((Shape::block(Pose2::new(center[0], center[1], yaw), length, depth), true));
            left -= 1;
        } else {
            gap = (gap - 0.001_f64).max(-2.0); // the fuller the yard, the closer together
        }
    }
    strokes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_yard_has_thirty_blocks_of_many_sizes_and_directions() {
        let blocks: Vec<(f64, f64)> = yard(1)
            .into_iter()
            .skip(4)
            .map(|(shape, _)| match shape {
                Shape::Bar { from, to, .. } => (
                    (to[0] - from[0]).hypot(to[1] - from[1]),
                    (to[1] - from[1]).atan2(to[0] - from[0]),
                ),
                other => panic!("{other:?} is no block"),
            })
            .collect();
        assert_eq!(blocks.len(), 30);
        let spread = |of: fn(&(f64, f64)) -> f64| {
            let (low, high) = blocks
                .iter()
                .map(of)
                .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            high - low
        };
        assert!(spread(|b| b.0) > 2.0 && spread(|b| b.1) > 2.0);
    }
}
