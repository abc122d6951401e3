//! The building of section 5.4: a ring of corridors with rooms and alcoves, of which each of three robots drives a part.

use super::{Mapped, along, frame_at};
use crate::geometry::Point;
use crate::simulation::{Lidar, Random, Scene, Shape, SimulationError};

/// Corners of the ring's middle line, and its length: 29 m + 21 m + 29 m + 21 m.
const CORNERS: [Point; 4] = [[3.5, 3.5], [32.5, 3.5], [32.5, 24.5], [3.5, 24.5]];
const LENGTH: f64 = 100.0;

/// Three robots that drive 60 m, 35 m and 55 m of the ring, each overlapping with both others: only together they go all
/// the way round. `seed` is that of the noise and the frames.
///
/// # Errors
/// Never with the places used here; the simulation's own checks are passed on.
pub(in crate::experiments) fn three_robots(seed: u64) -> Result<Vec<Mapped>, SimulationError> {
    let scene = scene();
    let lidar = Lidar::new(361, 1.5 * std::f64::consts::PI, 8.0, 0.01)?;
    let mut random = Random::new(seed, &[13]);
    [
        ("robot 1", 0.0, 60.0, 0.0),
        ("robot 2", 43.0, 78.0, -37.0),
        ("robot 3", 62.0, 117.0, 94.0),
    ]
    .into_iter()
    .zip(0..)
    .map(|((name, from, to, yaw), number)| {
        let shift = [random.uniform(-0.9, 0.9), random.uniform(-0.9, 0.9)];
        let frame = frame_at([18.0, 14.0], shift, yaw);
        Mapped::of_tour(
            name,
            &scene,
            &along(&part(from, to)),
            lidar,
            frame,
            seed ^ (0x30 + number),
        )
    })
    .collect()
}

/// The ring's middle line from one length along it to another.
fn part(from: f64, to: f64) -> Vec<Point> {
    let sides = [29.0, 21.0, 29.0, 21.0];
    let starts = [0.0, 29.0, 50.0, 79.0];
    let at = |s: f64| {
        let s = s.rem_euclid(LENGTH);
        let side = (0..4).rev().find(|k| s >= starts[*k]).unwrap_or(0);
        let (a, b) = (CORNERS[side], CORNERS[(side + 1) % 4]);
        let share = (s - starts[side]) / sides[side];
        [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
    };
    let corners = starts
        .iter()
        .flat_map(|s| [*s, s + LENGTH])
        .filter(|s| *s > from && *s < to);
    let mut stops: Vec<f64> = [from].into_iter().chain(corners).chain([to]).collect();
    stops.sort_by(f64::total_cmp);
    stops.into_iter().map(at).collect()
}

fn scene() -> Scene {
    let ground = Shape::Bar {
        from: [-4.0, 14.0],
        to: [40.0, 14.0],
        thickness: 36.0,
    };
    let mut strokes = vec![(ground, true)];
    let mut rectangle = |low: Point, high: Point, solid: bool| {
        let middle = f64::midpoint(low[1], high[1]);
        let shape = Shape::Bar {
            from: [low[0], middle],
            to: [high[0], middle],
            thickness: high[1] - low[1],
        };
        strokes.push((shape, solid));
    };
    rectangle([2.2, 2.2], [33.8, 25.8], false);
    rectangle([5.0, 5.0], [31.0, 23.0], true);
    // rooms of the inner block, each with a wide doorway to the ring
    for (low, high) in [
        ([6.0, 5.2], [11.5, 10.0]),
        ([13.0, 5.2], [19.5, 9.2]),
        ([21.0, 5.2], [24.2, 11.0]),
        ([26.0, 6.5], [30.8, 12.0]),
        ([27.0, 14.0], [30.8, 20.5]),
        ([21.5, 17.5], [25.5, 22.8]),
        ([13.5, 18.8], [20.0, 22.8]),
        ([5.2, 17.0], [10.6, 22.0]),
        ([5.2, 11.5], [9.0, 15.5]),
    ] {
        rectangle(low, high, false);
    }
    for (low, high) in [
        ([7.2, 4.9], [9.6, 5.3]),
        ([15.5, 4.9], [18.4, 5.3]),
        ([21.6, 4.9], [23.4, 5.3]),
        ([30.7, 8.0], [31.1, 10.2]),
        ([30.7, 15.6], [31.1, 18.4]),
        ([22.4, 22.7], [24.8, 23.1]),
        ([14.6, 22.7], [16.2, 23.1]),
        ([4.9, 18.6], [5.3, 20.6]),
        ([4.9, 12.4], [5.3, 14.0]),
    ] {
        rectangle(low, high, false);
    }
    // alcoves and stores on the outside
    for (low, high) in [
        ([11.0, -0.4], [15.5, 2.4]),
        ([24.5, 0.2], [27.0, 2.4]),
        ([33.6, 6.2], [36.4, 8.8]),
        ([33.6, 19.0], [35.6, 23.4]),
        ([26.0, 25.6], [30.6, 28.3]),
        ([10.5, 25.6], [12.6, 27.6]),
        ([-0.6, 15.2], [2.4, 19.4]),
        ([0.4, 6.4], [2.4, 8.2]),
    ] {
        rectangle(low, high, false);
    }
    // furniture that stands about, in no direction in particular
    for (x, y, yaw, length, depth) in [
        (8.4, 8.2, 0.4, 1.6, 0.7),
        (17.2, 7.4, 1.1, 1.2, 0.6),
        (28.9, 10.6, 0.9, 1.4, 0.8),
        (29.0, 18.9, -0.5, 1.8, 0.6),
        (16.8, 20.6, 0.2, 2.0, 0.8),
        (7.6, 19.8, 0.7, 1.5, 0.7),
        (12.8, 0.9, 0.3, 1.0, 0.5),
        (28.3, 27.1, -0.2, 1.2, 0.6),
        (0.9, 17.6, 1.3, 1.1, 0.6),
    ] {
        let pose = crate::geometry::Pose2::new(x, y, crate::geometry::Angle::from_radians(yaw));
        strokes.push((Shape::block(pose, length, depth), true));
    }
    Scene::draw(&strokes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_have_the_lengths_of_the_papers_trajectories() {
        for (from, to) in [(0.0, 60.0), (43.0, 78.0), (62.0, 117.0)] {
            let legs = part(from, to);
            let length: f64 = legs
                .windows(2)
                .map(|leg| (leg[1][0] - leg[0][0]).hypot(leg[1][1] - leg[0][1]))
                .sum();
            assert!((length - (to - from)).abs() < 1e-9, "{length}");
        }
    }
}
