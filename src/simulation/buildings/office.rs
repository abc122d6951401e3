//! Buildings at right angles: offices, rows of equal rooms, flats.

use super::{Finish, Room, finish, split};
use crate::geometry::{Angle, Point, Pose2};
use crate::simulation::furniture::{Furniture, furnish};
use crate::simulation::numbers::real;
use crate::simulation::{Random, World};

/// A spine corridor, up to three cross corridors, rooms of many sizes between them.
pub(super) fn office([width, height]: Point, random: &mut Random, world: &mut World) {
    let spine = random.uniform(1.6, 2.8);
    let y = random.uniform(0.35, 0.65) * height;
    let (below, above) = (y - spine / 2.0, y + spine / 2.0);
    let mut rooms = vec![Room::rectangle([0.0, below], [width, above]).into_corridor()];
    let most = random.uniform(4.5, 8.5);
    let least = random.uniform(2.4, 3.2);
    for (low, high) in [(0.0, below), (above, height)] {
        let mut x = 0.0;
        for _ in 0..random.below(3) {
            let (start, side) = (x + random.uniform(5.0, 14.0), random.uniform(1.5, 2.4));
            if start + side + 4.0 > width {
                break;
            }
            split([x, low], [start, high], least, most, random, &mut rooms);
            rooms.push(Room::rectangle([start, low], [start + side, high]).into_corridor());
            x = start + side;
        }
        split([x, low], [width, high], least, most, random, &mut rooms);
    }
    world.entrance = [width / 2.0, y];
    let style = Finish {
        wall: random.uniform(0.1, 0.24),
        door: [0.85, random.uniform(1.0, 1.5)],
        extra_doors: random.uniform(0.05, 0.25),
        furniture: random.uniform(0.08, 0.25),
        details: random.uniform(0.02, 0.15),
    };
    finish(&rooms, style, random, world);
}

/// Equal rooms on both sides of one to three equal corridors that two cross corridors join.
pub(super) fn repetitive(random: &mut Random, world: &mut World) {
    let (width, depth) = (random.uniform(2.8, 4.6), random.uniform(3.6, 6.0));
    let (corridor, ends) = (random.uniform(1.8, 2.6), random.uniform(1.8, 2.6));
    let (count, rows) = (random.between(7, 13), random.between(1, 3));
    let wall = random.uniform(0.12, 0.22);
    let door = (random.uniform(0.25, 0.75) * width, random.uniform(0.9, 1.1));
    let length = real(count) * width;
    let pitch = 2.0 * depth + corridor;
    let template = equal_furniture([width, depth], door.0, random);
    let odd_share = random.pick(&[0.0, 0.05, 0.15]);

    for row in 0..rows {
        let y = real(row) * pitch;
        // the room's frame: x along the corridor, y away from it, the door at y = 0
        for (base, yaw) in [(y, Angle::ZERO), (y - corridor, Angle::HALF_TURN)] {
            for k in 0..count {
                let x = real(k) * width + if yaw == Angle::ZERO { 0.0 } else { width };
                let pose = Pose2::new(x, base, yaw);
                let room = Room::rectangle([0.0, 0.0], [width, depth]);
                world.outline(&room.moved(pose).outline, wall);
                let [from, to] = [door.0 - door.1 / 2.0, door.0 + door.1 / 2.0].map(|s| pose.apply([s, 0.0]));
                world.carve(from, to, wall + 0.1);
                let own;
                let items = if random.chance(odd_share) {
                    own = equal_furniture([width, depth], door.0, random);
                    &own
                } else {
                    &template
                };
                world.furniture.extend(items.iter().map(|item| Furniture {
                    parts: item.parts.clone(),
                    pose: pose * item.pose,
                }));
            }
        }
    }
    let (low, high) = (-corridor - depth, real(rows - 1) * pitch + depth);
    let outer = Room::rectangle([-ends, low], [length + ends, high]);
    world.outline(&outer.outline, wall);
    world.entrance = [length / 2.0, -corridor / 2.0];
}

fn equal_furniture([width, depth]: Point, door: f64, random: &mut Random) -> Vec<Furniture> {
    let inner = Room::rectangle([0.1, 0.1], [width - 0.1, depth - 0.1]);
    furnish(&inner, &[[door, 0.0]], 0.25, random)
}

/// Two to four small flats side by side, their doors on a landing.
pub(super) fn flats(random: &mut Random, world: &mut World) {
    let landing = random.uniform(1.6, 2.4);
    let depth = random.uniform(7.0, 10.5);
    let mut x = 0.0;
    let mut rooms = Vec::new();
    for _ in 0..random.between(2, 4) {
        let width = random.uniform(7.0, 12.0);
        // a hall of its own behind the flat's door keeps the rooms reachable one by one
        let hall = random.uniform(1.5, 2.2);
        let middle = x + random.uniform(0.3, 0.7) * (width - hall);
        let far = random.uniform(0.5, 0.75) * depth;
        rooms.push(Room::rectangle([middle, 0.0], [middle + hall, far]));
        split([x, 0.0], [middle, far], 1.9, 4.5, random, &mut rooms);
        split([middle + hall, 0.0], [x + width, far], 1.9, 4.5, random, &mut rooms);
        split([x, far], [x + width, depth], 2.2, 5.5, random, &mut rooms);
        x += width;
    }
    rooms.push(Room::rectangle([0.0, -landing], [x, 0.0]).into_corridor());
    world.entrance = [x / 2.0, -landing / 2.0];
    let style = Finish {
        wall: random.uniform(0.1, 0.26),
        door: [0.8, 0.95],
        extra_doors: 0.12,
        furniture: random.uniform(0.2, 0.35),
        details: random.uniform(0.05, 0.15),
    };
    finish(&rooms, style, random, world);
}
