//! Buildings that are not rectangles: a star of wings, a ring around a court, a polygon cut by slanted walls.

use std::f64::consts::TAU;

use super::{Finish, Room, details, finish, split};
use crate::geometry::{Angle, Point, Pose2};
use crate::simulation::furniture::furnish;
use crate::simulation::numbers::real;
use crate::simulation::shape::{Shape, distance, mix, sub};
use crate::simulation::{Random, World};

/// One of the three layouts.
pub(super) fn angled(random: &mut Random, world: &mut World) {
    match random.below(3) {
        0 => star(random, world),
        1 => ring(random, world),
        _ => slanted(random, world),
    }
}

/// Three or four wings at odd angles around a round hall.
fn star(random: &mut Random, world: &mut World) {
    let wings = random.between(3, 4);
    let style = Finish {
        wall: random.uniform(0.12, 0.22),
        door: [0.85, 1.2],
        extra_doors: 0.1,
        furniture: random.uniform(0.08, 0.2),
        details: random.uniform(0.03, 0.12),
    };
    let pitch = TAU / real(wings);
    let width = random.uniform(8.0, 12.0);
    // far enough out that neighbouring wings do not meet
    let radius = (width / 2.0) / (pitch * 0.38).tan() + 0.6;
    let wall = Shape::Arc {
        center: [0.0, 0.0],
        radius,
        thickness: 0.25,
        start: 0.0,
        sweep: TAU,
    };
    world.strokes.push((wall, true));
    for wing in 0..wings {
        let yaw = pitch * (real(wing) + random.uniform(-0.11, 0.11));
        let pose = Pose2::new(0.0, 0.0, Angle::from_radians(yaw));
        let (length, corridor) = (random.uniform(9.0, 18.0), random.uniform(1.7, 2.5));
        let start = radius + 0.25;
        let side = random.uniform(-0.5, 0.5) * (width - corridor - 6.0).max(0.0);
        let (low, high) = (side - corridor / 2.0, side + corridor / 2.0);
        let mut rooms = vec![Room::rectangle([start, low], [start + length, high]).into_corridor()];
        split(
            [start, -width / 2.0],
            [start + length, low],
            2.5,
            6.0,
            random,
            &mut rooms,
        );
        split(
            [start, high],
            [start + length, width / 2.0],
            2.5,
            6.0,
            random,
            &mut rooms,
        );
        let rooms: Vec<Room> = rooms.iter().map(|room| room.moved(pose)).collect();
        finish(&rooms, style, random, world);
        let inside = (radius * radius - low.abs().max(high.abs()).powi(2)).max(0.0).sqrt() - 0.4;
        world.carve(
            pose.apply([inside, side]),
            pose.apply([start + 0.3, side]),
            corridor - style.wall,
        );
        // the jambs between the round hall and the wing's corridor
        for y in [low, high] {
            world.wall(pose.apply([inside + 0.2, y]), pose.apply([start + 0.1, y]), style.wall);
        }
    }
    for _ in 0..random.between(2, 9) {
        let direction = random.uniform(0.0, TAU);
        let out = random.uniform(0.35, 0.8) * radius;
        let center = [out * direction.cos(), out * direction.sin()];
        let radius = random.uniform(0.15, 0.5);
        world.strokes.push((Shape::Disc { center, radius }, true));
    }
    world.entrance = [0.0, 0.0];
}

/// A ring corridor around a round court, rooms with radial walls outside of it.
fn ring(random: &mut Random, world: &mut World) {
    let (court, corridor, depth) = (
        random.uniform(4.0, 9.0),
        random.uniform(1.9, 2.8),
        random.uniform(4.0, 7.0),
    );
    let (inner, outer) = (court + corridor, court + corridor + depth);
    for (radius, thickness) in [(court, 0.2), (inner, 0.15), (outer, 0.25)] {
        let wall = Shape::Arc {
            center: [0.0, 0.0],
            radius,
            thickness,
            start: 0.0,
            sweep: TAU,
        };
        world.strokes.push((wall, true));
    }
    let at = |radius: f64, direction: f64| [radius * direction.cos(), radius * direction.sin()];
    let mut direction = 0.0;
    while direction < TAU - 0.05 {
        let sweep = (random.uniform(2.8, 6.5) / inner).min(TAU - direction);
        let sweep = if TAU - direction - sweep < 2.8 / inner {
            TAU - direction
        } else {
            sweep
        };
        world.wall(at(inner, direction), at(outer, direction), 0.15);
        let door = direction + sweep * random.uniform(0.35, 0.65);
        world.carve(at(inner - 0.3, door), at(inner + 0.3, door), random.uniform(0.9, 1.3));
        let room = Room {
            outline: vec![
                at(inner + 0.1, direction + 0.02),
                at(outer - 0.3, direction + 0.02),
                at(outer - 0.3, direction + sweep - 0.02),
                at(inner + 0.1, direction + sweep - 0.02),
            ],
            corridor: false,
        };
        let items = furnish(&room, &[at(inner, door)], random.uniform(0.08, 0.3), random);
        world.furniture.extend(items);
        direction += sweep;
    }
    world.entrance = at(court + corridor / 2.0, 1.0);
}

/// An irregular polygon, cut again and again by slanted walls.
fn slanted(random: &mut Random, world: &mut World) {
    let corners = random.between(5, 7);
    let radius = random.uniform(14.0, 22.0);
    let outline = (0..corners)
        .map(|k| {
            let direction = (real(k) + random.uniform(-0.25, 0.25)) * TAU / real(corners);
            [radius * direction.cos(), radius * direction.sin()]
        })
        .collect();
    let mut rooms = vec![Room {
        outline,
        corridor: false,
    }];
    let pieces = random.between(9, 18);
    while rooms.len() < pieces {
        let (largest, _) = rooms
            .iter()
            .enumerate()
            .max_by(|(_, a), (_, b)| a.area().total_cmp(&b.area()))
            .expect("invariant: there is at least one room");
        let room = rooms.swap_remove(largest);
        rooms.extend(cut(&room, random));
    }
    let style = Finish {
        wall: random.uniform(0.12, 0.25),
        door: [0.95, 1.6],
        extra_doors: 0.35,
        furniture: random.uniform(0.04, 0.14),
        details: random.uniform(0.02, 0.1),
    };
    finish(&rooms, style, random, world);
    for room in &rooms {
        details(room, &[room.center()], Finish { details: 0.02, ..style }, random, world);
    }
    world.entrance = rooms[0].center();
}

/// Cuts a convex room from the middle of its longest side to somewhere opposite.
fn cut(room: &Room, random: &mut Random) -> [Room; 2] {
    let corners = &room.outline;
    let n = corners.len();
    let (longest, _) = (0..n)
        .map(|k| (k, distance(corners[k], corners[(k + 1) % n])))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .expect("invariant: rooms have corners");
    let start: Point = mix(corners[longest], corners[(longest + 1) % n], random.uniform(0.35, 0.65));
    // the side opposite: the one whose middle is farthest
    let opposite = (1..n)
        .map(|step| (longest + step) % n)
        .max_by(|&a, &b| {
            let far = |k: usize| distance(start, mix(corners[k], corners[(k + 1) % n], 0.5));
            far(a).total_cmp(&far(b))
        })
        .expect("invariant: rooms have at least three sides");
    let end = mix(
        corners[opposite],
        corners[(opposite + 1) % n],
        random.uniform(0.35, 0.65),
    );
    let walk = |from: Point, first: usize, last: usize, to: Point| {
        let mut outline = vec![from];
        let mut k = first;
        loop {
            outline.push(corners[k]);
            if k == last {
                break;
            }
            k = (k + 1) % n;
        }
        outline.push(to);
        // a corner on top of its neighbour would make a side without direction
        outline.dedup_by(|a, b| sub(*a, *b) == [0.0, 0.0]);
        Room {
            outline,
            corridor: false,
        }
    };
    [
        walk(start, (longest + 1) % n, opposite, end),
        walk(end, (opposite + 1) % n, longest, start),
    ]
}
