//! Halls: shelves in rows, columns on a grid, pallets, and a few rooms in a corner.

use super::{Finish, Room, finish, split};
use crate::geometry::{Angle, Point, Pose2};
use crate::simulation::furniture::Furniture;
use crate::simulation::numbers::{count, real};
use crate::simulation::shape::Shape;
use crate::simulation::{Random, World};

/// A hall of 26..56 m by 20..38 m.
pub(super) fn hall(random: &mut Random, world: &mut World) {
    let size = [random.uniform(26.0, 56.0), random.uniform(20.0, 38.0)];
    let outer = Room::rectangle([0.0, 0.0], size);
    world.outline(&outer.outline, 0.3);

    let corner = [random.uniform(6.0, 12.0), random.uniform(4.0, 8.0)];
    let mut rooms = Vec::new();
    split([0.0, 0.0], corner, 2.8, 5.0, random, &mut rooms);
    let style = Finish {
        wall: 0.15,
        door: [0.9, 1.3],
        extra_doors: 0.1,
        furniture: 0.15,
        details: 0.05,
    };
    finish(&rooms, style, random, world);
    // a door from the corner's rooms into the hall
    let y = random.uniform(1.0, corner[1] - 1.0);
    world.carve([corner[0], y - 0.6], [corner[0], y + 0.6], 0.3);

    columns(size, corner, random, world);
    shelves(size, corner, random, world);
    for _ in 0..random.between(5, 40) {
        let at = [random.uniform(1.0, size[0] - 1.0), random.uniform(1.0, size[1] - 1.0)];
        if at[0] > corner[0] + 1.5 || at[1] > corner[1] + 1.5 {
            let pose = Pose2::new(at[0], at[1], Angle::from_radians(random.uniform(-0.3, 0.3)));
            world.furniture.push(Furniture::solid(
                pose,
                random.uniform(0.8, 1.3),
                random.uniform(0.8, 1.1),
            ));
        }
    }
    for _ in 0..random.between(10, 30) {
        niche_on_the_wall(size, random, world);
    }
    world.entrance = [size[0] / 2.0, size[1] - 1.0];
    world.carve(
        [size[0] / 2.0 - 1.0, size[1] - 1.0],
        [size[0] / 2.0 + 1.0, size[1] - 1.0],
        1.4,
    );
}

fn columns(size: Point, corner: Point, random: &mut Random, world: &mut World) {
    let pitch = [random.uniform(5.0, 9.0), random.uniform(5.0, 9.0)];
    let (thickness, round) = (random.uniform(0.25, 0.6), random.chance(0.3));
    for i in 1..count(size[0] / pitch[0]) {
        for j in 1..count(size[1] / pitch[1]) {
            let center = [real(i) * pitch[0], real(j) * pitch[1]];
            if center[0] < corner[0] + 0.5 && center[1] < corner[1] + 0.5 {
                continue;
            }
            let shape = if round {
                Shape::Disc {
                    center,
                    radius: thickness / 2.0,
                }
            } else {
                Shape::block(Pose2::new(center[0], center[1], Angle::ZERO), thickness, thickness)
            };
            world.strokes.push((shape, true));
        }
    }
}

/// One to three zones, each with rows of its own direction, distance and depth; rows are broken by cross aisles.
fn shelves(size: Point, corner: Point, random: &mut Random, world: &mut World) {
    let zones = random.between(1, 3);
    for zone in 0..zones {
        let low = [size[0] * real(zone) / real(zones) + 1.6, corner[1] + 1.8];
        let high = [size[0] * real(zone + 1) / real(zones) - 1.6, size[1] - 2.5];
        let lengthwise = usize::from(random.chance(0.5));
        let across = 1 - lengthwise;
        let (pitch, depth) = (random.uniform(2.6, 4.5), random.uniform(0.6, 1.3));
        let mut row = low[across] + depth;
        while row < high[across] {
            let mut start = low[lengthwise] + random.uniform(0.0, 2.0);
            while start + 2.0 < high[lengthwise] {
                let end = (start + random.uniform(3.0, 12.0)).min(high[lengthwise]);
                if random.chance(0.85) {
                    let (mut from, mut to) = ([row, row], [row, row]);
                    from[lengthwise] = start;
                    to[lengthwise] = end;
                    world.wall(from, to, depth);
                }
                start = end + random.uniform(1.6, 3.0);
            }
            row += pitch
                + if random.chance(0.2) {
                    random.uniform(0.5, 2.0)
                } else {
                    0.0
                };
        }
    }
}

/// Something built against the outer wall: a duct, a frame, a ramp's side.
fn niche_on_the_wall(size: Point, random: &mut Random, world: &mut World) {
    let axis = random.below(2);
    let mut at = [0.0, 0.0];
    at[axis] = random.uniform(1.0, size[axis] - 1.0);
    at[1 - axis] = if random.chance(0.5) { 0.2 } else { size[1 - axis] - 0.2 };
    let pose = Pose2::new(at[0], at[1], if axis == 0 { Angle::ZERO } else { Angle::QUARTER_TURN });
    let shape = Shape::block(pose, random.uniform(0.3, 1.5), random.uniform(0.2, 0.9));
    world.strokes.push((shape, true));
}
