//! Places with few walls: a cluttered yard, and the blocks of the paper's first experiments.

use std::f64::consts::TAU;

use crate::geometry::{Angle, Point, Pose2};
use crate::simulation::furniture::Furniture;
use crate::simulation::numbers::real;
use crate::simulation::shape::{Shape, distance, mix};
use crate::simulation::{Random, World};

/// An irregular fence, a few pieces of wall, and many small things: trees, posts, cars, bushes.
pub(super) fn clutter(random: &mut Random, world: &mut World) {
    let corners = random.between(6, 11);
    let radius = random.uniform(16.0, 28.0);
    let stretch = random.uniform(0.6, 1.0);
    let fence: Vec<Point> = (0..corners)
        .map(|k| {
            let direction = (real(k) + random.uniform(-0.3, 0.3)) * TAU / real(corners);
            let out = radius * random.uniform(0.75, 1.0);
            [out * direction.cos(), out * direction.sin() * stretch]
        })
        .collect();
    world.outline(&fence, 0.2);
    let place = |random: &mut Random| {
        let k = random.below(corners);
        let edge = mix(fence[k], fence[(k + 1) % corners], random.unit());
        mix([0.0, 0.0], edge, random.uniform(0.02, 1.0_f64).sqrt() * 0.97)
    };
    for _ in 0..random.between(2, 7) {
        let [x, y] = place(random);
        let free = random.uniform(0.0, TAU);
        let yaw = Angle::from_radians(random.pick(&[0.0, TAU / 4.0, free]));
        let pose = Pose2::new(x, y, yaw);
        let length = random.uniform(2.0, 9.0);
        world.wall(pose.apply([-length / 2.0, 0.0]), pose.apply([length / 2.0, 0.0]), 0.2);
        if random.chance(0.5) {
            let depth = random.uniform(1.5, 5.0);
            world.wall(pose.apply([length / 2.0, 0.0]), pose.apply([length / 2.0, depth]), 0.2);
        }
    }
    for _ in 0..random.between(40, 90) {
        let center = place(random);
        if distance(center, [0.0, 0.0]) < 1.5 {
            continue;
        }
        let yaw = Angle::from_radians(random.uniform(0.0, TAU));
        let pose = Pose2::new(center[0], center[1], yaw);
        match random.below(8) {
            0..=3 => {
                let radius = random.uniform(0.06, 0.45);
                world.strokes.push((Shape::Disc { center, radius }, true));
            }
            4 => bush(center, random, world),
            5 => world.furniture.push(Furniture::solid(
                pose,
                random.uniform(3.6, 4.8),
                random.uniform(1.6, 1.9),
            )),
            _ => world.furniture.push(Furniture::solid(
                pose,
                random.uniform(0.5, 2.0),
                random.uniform(0.4, 1.2),
            )),
        }
    }
    world.entrance = [0.0, 0.0];
}

/// A ragged heap of small discs.
fn bush(center: Point, random: &mut Random, world: &mut World) {
    let size = random.uniform(0.4, 1.6);
    for _ in 0..random.between(5, 14) {
        let center = [
            center[0] + random.normal(size / 2.0),
            center[1] + random.normal(size / 2.0),
        ];
        if distance(center, [0.0, 0.0]) > 1.2 {
            let radius = random.uniform(0.05, 0.25);
            world.strokes.push((Shape::Disc { center, radius }, true));
        }
    }
}

/// A walled yard with thirty blocks of many sizes and directions.
pub(super) fn blocks(random: &mut Random, world: &mut World) {
    let size = [random.uniform(24.0, 38.0), random.uniform(24.0, 38.0)];
    let yard = super::Room::rectangle([0.0, 0.0], size);
    world.outline(&yard.outline, 0.2);
    let middle = [size[0] / 2.0, size[1] / 2.0];
    for _ in 0..30 {
        let center = [random.uniform(0.5, size[0] - 0.5), random.uniform(0.5, size[1] - 0.5)];
        let (length, depth) = (random.uniform(0.6, 5.0), random.uniform(0.4, 2.5));
        if distance(center, middle) < 1.0 + length.hypot(depth) / 2.0 {
            continue;
        }
        let pose = Pose2::new(center[0], center[1], Angle::from_radians(random.uniform(0.0, TAU)));
        world.strokes.push((Shape::block(pose, length, depth), true));
    }
    for _ in 0..random.below(8) {
        let center = [random.uniform(1.0, size[0] - 1.0), random.uniform(1.0, size[1] - 1.0)];
        if distance(center, middle) > 2.0 {
            world
                .furniture
                .push(Furniture::round(center, random.uniform(0.15, 0.4)));
        }
    }
    world.entrance = middle;
}
