//! The basement of section 5.3: two corridors of nearly equal size, joined by a short one with a room, 81 m2 in all.

use super::{Mapped, along, frame_at};
use crate::geometry::Point;
use crate::simulation::{Lidar, Random, Scene, Shape, SimulationError};

/// Two robots, one from each long corridor; the short one and the room are in both maps. Frames are turned against each
/// other by 88 degrees. `seed` is that of the noise.
///
/// # Errors
/// Never with the places used here; the simulation's own checks are passed on.
pub(in crate::experiments) fn two_robots(seed: u64) -> Result<Vec<Mapped>, SimulationError> {
    let scene = scene();
    // a range of 5 m, as that of the paper's Hokuyo UBG-05LN
    let lidar = Lidar::new(512, 4.0, 5.0, 0.01)?;
    let mut random = Random::new(seed, &[12]);
    let mut frame = |yaw: f64| frame_at([3.0, 1.0], [random.uniform(-0.9, 0.9), random.uniform(-0.9, 0.9)], yaw);
    let (first, second) = (frame(0.0), frame(88.0));
    // 22.5 m and 25.9 m, as in the paper
    let one = along(&[
        [-0.9, -12.6],
        [-0.9, 0.9],
        [2.6, 0.9],
        [2.6, 3.4],
        [2.6, 1.4],
        [1.6, 1.2],
    ]);
    let other = along(&[
        [7.0, 11.3],
        [7.0, 1.0],
        [2.6, 0.9],
        [2.6, 3.7],
        [2.6, 1.0],
        [5.4, 1.0],
        [7.0, 1.9],
        [7.0, 2.9],
    ]);
    Ok(vec![
        Mapped::of_tour("robot 1", &scene, &one, lidar, first, seed)?,
        Mapped::of_tour("robot 2", &scene, &other, lidar, second, seed ^ 0x20)?,
    ])
}

/// Passages carved out of solid ground.
fn scene() -> Scene {
    let ground = Shape::Bar {
        from: [-8.0, 0.0],
        to: [14.0, 0.0],
        thickness: 36.0,
    };
    let mut strokes = vec![(ground, true)];
    let mut room = |low: Point, high: Point| {
        let middle = f64::midpoint(low[1], high[1]);
        let shape = Shape::Bar {
            from: [low[0], middle],
            to: [high[0], middle],
            thickness: high[1] - low[1],
        };
        strokes.push((shape, false));
    };
    room([0.0, 0.1], [6.1, 1.9]); // the passage in common
    room([1.1, 2.1], [4.3, 4.5]); // the room in common
    room([2.1, 1.8], [3.1, 2.2]); // its door
    room([-1.8, -13.6], [0.0, 1.9]); // 15.5 m
    room([6.1, 0.1], [7.9, 12.3]); // 12.2 m
    // what makes corridors differ a little: niches and stores
    room([-2.1, -9.5], [-1.7, -8.3]);
    room([-0.1, -6.0], [1.2, -4.4]);
    room([-3.9, -3.4], [-1.7, -1.6]);
    room([4.2, 7.2], [6.2, 8.8]);
    room([7.8, 4.4], [8.2, 5.6]);
    room([4.9, 1.7], [5.6, 2.1]);
    Scene::draw(&strokes)
}
