//! Furniture: what stands in rooms, what a lidar sees of it, and where it is put.

use super::Random;
use super::buildings::Room;
use super::shape::{Shape, distance, mix, norm, sub};
use crate::geometry::{Angle, Point, Pose2};

/// A piece of furniture: shapes about its own middle, and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Furniture {
    pub(super) parts: Vec<Shape>,
    pub(super) pose: Pose2,
}

impl Furniture {
    /// What the lidar sees of it when it stands at `pose`.
    pub(super) fn shapes(&self, pose: Pose2) -> impl Iterator<Item = Shape> {
        self.parts.iter().map(move |part| part.moved(pose))
    }

    /// A closed box: cupboards, desks with panels, beds, crates.
    pub(super) fn solid(pose: Pose2, length: f64, depth: f64) -> Self {
        Self {
            parts: vec![Shape::block(Pose2::IDENTITY, length, depth)],
            pose,
        }
    }

    /// A table: at lidar height only its four legs.
    pub(super) fn table(pose: Pose2, length: f64, depth: f64) -> Self {
        let leg = |x: f64, y: f64| Shape::Disc {
            center: [x * (length / 2.0 - 0.05), y * (depth / 2.0 - 0.05)],
            radius: 0.035,
        };
        Self {
            parts: vec![leg(1.0, 1.0), leg(1.0, -1.0), leg(-1.0, 1.0), leg(-1.0, -1.0)],
            pose,
        }
    }

    /// Something round: an office chair's column, a bin, a plant, a person.
    pub(super) fn round(center: Point, radius: f64) -> Self {
        Self {
            parts: vec![Shape::Disc {
                center: [0.0, 0.0],
                radius,
            }],
            pose: Pose2::new(center[0], center[1], Angle::ZERO),
        }
    }
}

/// Puts `per_square_metre` times the room's area of things into a convex room, away from its doors.
pub(super) fn furnish(room: &Room, doors: &[Point], per_square_metre: f64, random: &mut Random) -> Vec<Furniture> {
    let wanted = super::numbers::count(room.area() * per_square_metre * random.uniform(0.5, 1.5));
    let mut items: Vec<Furniture> = Vec::new();
    for _ in 0..wanted * 3 {
        if items.len() >= wanted {
            break;
        }
        let item = if random.chance(0.6) {
            along_a_wall(room, random)
        } else {
            in_the_middle(room, random)
        };
        let at = item.pose.translation();
        let blocks_a_door = doors.iter().any(|&door| distance(door, at) < 1.5);
        let crowds = items.iter().any(|other| distance(other.pose.translation(), at) < 0.9);
        if room.contains(at) && !blocks_a_door && !crowds {
            items.push(item);
        }
    }
    items
}

fn along_a_wall(room: &Room, random: &mut Random) -> Furniture {
    let k = random.below(room.outline.len());
    let (from, to) = (room.outline[k], room.outline[(k + 1) % room.outline.len()]);
    let (length, depth) = match random.below(3) {
        0 => (random.uniform(0.8, 2.4), random.uniform(0.35, 0.6)),
        1 => (random.uniform(1.2, 1.8), random.uniform(0.7, 0.9)),
        _ => (random.uniform(0.4, 0.8), random.uniform(0.4, 0.6)),
    };
    let side = sub(to, from);
    // outlines run counter-clockwise: the room lies to the left of each side
    let inward = [-side[1] / norm(side), side[0] / norm(side)];
    let margin = (length / 2.0 / norm(side)).min(0.5);
    let foot = mix(from, to, random.uniform(margin, 1.0 - margin));
    let off = depth / 2.0 + random.uniform(0.05, 0.15);
    let pose = Pose2::new(
        foot[0] + inward[0] * off,
        foot[1] + inward[1] * off,
        Angle::from_radians(side[1].atan2(side[0])),
    );
    Furniture::solid(pose, length, depth)
}

fn in_the_middle(room: &Room, random: &mut Random) -> Furniture {
    let center = room.center();
    let corner = random.pick(&room.outline);
    let at = mix(center, corner, random.uniform(0.0, 0.7));
    let side = sub(room.outline[1], room.outline[0]);
    let skew = random.pick(&[0.0, 0.0, 1.0]) * random.uniform(-0.7, 0.7);
    let pose = Pose2::new(at[0], at[1], Angle::from_radians(side[1].atan2(side[0]) + skew));
    match random.below(4) {
        0 | 1 => Furniture::table(pose, random.uniform(1.0, 2.0), random.uniform(0.7, 1.0)),
        2 => Furniture::round(at, random.uniform(0.05, 0.3)),
        _ => Furniture::solid(pose, random.uniform(0.8, 1.8), random.uniform(0.4, 0.9)),
    }
}
