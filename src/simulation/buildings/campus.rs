//! A campus: copies of a few storeys in every direction, with streets between them.

use super::{Room, office};
use crate::geometry::{Angle, Point, Pose2};
use crate::simulation::furniture::Furniture;
use crate::simulation::numbers::{count, real};
use crate::simulation::{Random, World, WorldKind};

/// Six to twelve copies of one to five office storeys, each turned by quarters at random. Inside of a copy nothing tells
/// which one it is; what stands in the streets does.
pub(super) fn campus(random: &mut Random, world: &mut World) {
    let storeys: Vec<(World, Point)> = (0..random.between(1, 5)).map(|_| storey(random)).collect();
    let street = random.uniform(2.4, 3.6);
    let widest = storeys.iter().flat_map(|(_, size)| *size).fold(0.0, f64::max);
    let pitch = widest + street;
    let (columns, rows) = (random.between(3, 4), random.between(2, 3));
    for column in 0..columns {
        for row in 0..rows {
            let (copy, size) = &storeys[random.below(storeys.len())];
            let middle = [(real(column) + 0.5) * pitch, (real(row) + 0.5) * pitch];
            let quarter = Angle::from_degrees(90.0 * real(random.below(4)));
            let corner = Pose2::new(-size[0] / 2.0, -size[1] / 2.0, Angle::ZERO);
            let pose = Pose2::new(middle[0], middle[1], quarter) * corner;
            world
                .strokes
                .extend(copy.strokes.iter().map(|(shape, solid)| (shape.moved(pose), *solid)));
            world.furniture.extend(copy.furniture.iter().map(|item| Furniture {
                parts: item.parts.clone(),
                pose: pose * item.pose,
            }));
        }
    }
    let size = [real(columns) * pitch, real(rows) * pitch];
    let yard = Room::rectangle([-street / 2.0, -street / 2.0], size.map(|length| length + street / 2.0));
    world.outline(&yard.outline, 0.3);
    things_in_the_streets([columns, rows], pitch, street, random, world);
    world.entrance = [0.0, 0.0];
}

/// An office with doors to the outside at both ends of its corridor, and its size.
fn storey(random: &mut Random) -> (World, Point) {
    let size = [random.uniform(18.0, 26.0), random.uniform(13.0, 18.0)];
    let mut world = World::empty(WorldKind::Office, 0);
    office::office(size, random, &mut world);
    let [_, y] = world.entrance;
    for x in [0.0, size[0]] {
        world.carve([x - 0.3, y], [x + 0.3, y], 1.2);
    }
    (world, size)
}

fn things_in_the_streets([columns, rows]: [usize; 2], pitch: f64, street: f64, random: &mut Random, world: &mut World) {
    let density = random.uniform(0.1, 0.25);
    for (lines, across, axis) in [(columns, rows, 0), (rows, columns, 1)] {
        for line in 0..=lines {
            let length = real(across) * pitch;
            for _ in 0..count(length * density) {
                let along = random.uniform(0.0, length);
                let beside = random.pick(&[-1.0, 1.0]) * (street / 2.0 - 0.4);
                let at = real(line) * pitch + beside;
                let (center, yaw) = if axis == 0 {
                    ([at, along], Angle::from_degrees(90.0))
                } else {
                    ([along, at], Angle::ZERO)
                };
                let pose = Pose2::new(center[0], center[1], yaw);
                let (long, deep) = (random.uniform(0.4, 2.2), random.uniform(0.3, 0.6));
                world.furniture.push(Furniture::solid(pose, long, deep));
            }
        }
    }
}
