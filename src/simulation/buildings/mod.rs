//! How buildings are laid out: convex rooms that share walls, doors that make all of them reachable.

mod angled;
mod campus;
mod hall;
mod office;
mod open;
mod passages;

use super::furniture::furnish;
use super::shape::{Shape, distance, dot, mix, norm, sub};
use super::{Random, World, WorldKind};
use crate::geometry::{Angle, Point, Pose2};

/// Fills an empty world.
pub(super) fn build(kind: WorldKind, random: &mut Random, world: &mut World) {
    match kind {
        WorldKind::Office => {
            let size = [random.uniform(24.0, 52.0), random.uniform(18.0, 36.0)];
            office::office(size, random, world);
        }
        WorldKind::Repetitive => office::repetitive(random, world),
        WorldKind::Hall => hall::hall(random, world),
        WorldKind::Angled => angled::angled(random, world),
        WorldKind::Clutter => open::clutter(random, world),
        WorldKind::Flat => office::flats(random, world),
        WorldKind::Corridors => passages::corridors(random, world),
        WorldKind::Blocks => open::blocks(random, world),
        WorldKind::Campus => campus::campus(random, world),
    }
}

/// The office of the demo: 34 m x 24 m, small enough that three robots see it all.
pub(super) fn demo(random: &mut Random, world: &mut World) {
    office::office([34.0, 24.0], random, world);
}

/// A convex room, corners counter-clockwise.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Room {
    pub(super) outline: Vec<Point>,
    pub(super) corridor: bool,
}

impl Room {
    pub(super) fn rectangle(low: Point, high: Point) -> Self {
        Self {
            outline: vec![low, [high[0], low[1]], high, [low[0], high[1]]],
            corridor: false,
        }
    }

    pub(super) fn into_corridor(mut self) -> Self {
        self.corridor = true;
        self
    }

    pub(super) fn center(&self) -> Point {
        let n = super::numbers::real(self.outline.len());
        let sum = self.outline.iter().fold([0.0, 0.0], |s, p| [s[0] + p[0], s[1] + p[1]]);
        [sum[0] / n, sum[1] / n]
    }

    pub(super) fn area(&self) -> f64 {
        self.sides().map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0
    }

    pub(super) fn contains(&self, p: Point) -> bool {
        self.sides()
            .all(|(a, b)| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0.0)
    }

    fn sides(&self) -> impl Iterator<Item = (Point, Point)> + '_ {
        let n = self.outline.len();
        (0..n).map(move |k| (self.outline[k], self.outline[(k + 1) % n]))
    }

    fn moved(&self, pose: Pose2) -> Self {
        Self {
            outline: self.outline.iter().map(|&p| pose.apply(p)).collect(),
            corridor: self.corridor,
        }
    }

    /// The piece of wall between two rooms, when they have one.
    fn shared_side(&self, other: &Self) -> Option<[Point; 2]> {
        const APART: f64 = 0.02;
        self.sides()
            .flat_map(|side| other.sides().map(move |theirs| (side, theirs)))
            .find_map(|((a, b), (c, d))| {
                let length = distance(a, b);
                let along = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
                let across = |p: Point| along[0] * (p[1] - a[1]) - along[1] * (p[0] - a[0]);
                if length < APART || across(c).abs() > APART || across(d).abs() > APART {
                    return None;
                }
                let (s, t) = (dot(sub(c, a), along), dot(sub(d, a), along));
                let (from, to) = (s.min(t).max(0.0), s.max(t).min(length));
                (to - from > 0.1).then(|| [mix(a, b, from / length), mix(a, b, to / length)])
            })
    }
}

/// How a storey is finished.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finish {
    /// Wall thickness in metres.
    pub(super) wall: f64,
    /// Least and greatest width of a door in metres.
    pub(super) door: [f64; 2],
    /// Share of the walls between rooms that have a door beyond those needed.
    pub(super) extra_doors: f64,
    /// Things per square metre.
    pub(super) furniture: f64,
    /// Columns, radiators, ducts: per metre of wall.
    pub(super) details: f64,
}

/// Draws rooms that share walls: outlines, doors until every room can be reached, wall details, furniture.
pub(super) fn finish(rooms: &[Room], finish: Finish, random: &mut Random, world: &mut World) {
    for room in rooms {
        world.outline(&room.outline, finish.wall);
    }
    let doors = connect(rooms, finish, random, world);
    for room in rooms {
        details(room, &doors, finish, random, world);
        let density = if room.corridor {
            finish.furniture / 5.0
        } else {
            finish.furniture
        };
        world.furniture.extend(furnish(room, &doors, density, random));
    }
}

/// Opens doors (their middles are returned): wide passages between corridors, then a spanning tree, then some more.
fn connect(rooms: &[Room], finish: Finish, random: &mut Random, world: &mut World) -> Vec<Point> {
    let mut shared: Vec<(usize, usize, [Point; 2])> = Vec::new();
    for (i, room) in rooms.iter().enumerate() {
        for (j, other) in rooms.iter().enumerate().skip(i + 1) {
            if let Some(side) = room.shared_side(other) {
                shared.push((i, j, side));
            }
        }
    }
    let mut reached: Vec<bool> = rooms.iter().map(|room| room.corridor).collect();
    if !reached.contains(&true) {
        reached[0] = true;
    }
    let mut doors = Vec::new();
    for &(i, j, [a, b]) in &shared {
        if rooms[i].corridor && rooms[j].corridor {
            let inset = (finish.wall / 2.0 / distance(a, b)).min(0.4);
            world.carve(mix(a, b, inset), mix(b, a, inset), finish.wall + 0.05);
            doors.push(mix(a, b, 0.5));
        }
    }
    let fits = |[a, b]: [Point; 2]| distance(a, b) > finish.door[0] + 0.3;
    loop {
        let open: Vec<usize> = (0..shared.len())
            .filter(|&k| fits(shared[k].2) && reached[shared[k].0] != reached[shared[k].1])
            .collect();
        if open.is_empty() {
            break;
        }
        let (i, j, side) = shared[random.pick(&open)];
        reached[i] = true;
        reached[j] = true;
        doors.push(open_door(side, finish, random, world));
    }
    for &(i, j, side) in &shared {
        if !(rooms[i].corridor && rooms[j].corridor) && fits(side) && random.chance(finish.extra_doors) {
            doors.push(open_door(side, finish, random, world));
        }
    }
    doors
}

fn open_door([a, b]: [Point; 2], finish: Finish, random: &mut Random, world: &mut World) -> Point {
    let length = distance(a, b);
    let width = random.uniform(finish.door[0], finish.door[1]).min(length - 0.3);
    let middle = random.uniform(width / 2.0 + 0.15, length - width / 2.0 - 0.15);
    let at = |s: f64| mix(a, b, s / length);
    world.carve(at(middle - width / 2.0), at(middle + width / 2.0), finish.wall + 0.1);
    at(middle)
}

/// Small things built onto the walls: what makes one real wall differ from the next.
fn details(room: &Room, doors: &[Point], finish: Finish, random: &mut Random, world: &mut World) {
    for (a, b) in room.sides() {
        let length = distance(a, b);
        for _ in 0..super::numbers::count(length * finish.details + random.unit()) {
            let foot = mix(a, b, random.unit());
            let (long, deep) = (random.uniform(0.15, 0.7), random.uniform(0.1, 0.25));
            if doors.iter().any(|&door| distance(door, foot) < 1.1) {
                continue;
            }
            let side = sub(b, a);
            let inward = [-side[1] / norm(side), side[0] / norm(side)];
            let off = f64::midpoint(finish.wall, deep);
            let pose = Pose2::new(
                foot[0] + inward[0] * off,
                foot[1] + inward[1] * off,
                Angle::from_radians(side[1].atan2(side[0])),
            );
            world.strokes.push((Shape::block(pose, long, deep), true));
        }
    }
}

/// Splits a rectangle into rooms with sides of at least `least` metres, stopping at random below `most`.
pub(super) fn split(low: Point, high: Point, least: f64, most: f64, random: &mut Random, rooms: &mut Vec<Room>) {
    let size = sub(high, low);
    let axis = usize::from(size[1] > size[0] * random.uniform(0.8, 1.25));
    let done = size[axis] <= most && random.chance(0.6);
    if size[axis] < 2.0 * least || done {
        rooms.push(Room::rectangle(low, high));
        return;
    }
    let at = low[axis] + random.uniform(least, size[axis] - least);
    let (mut middle_low, mut middle_high) = (low, high);
    middle_low[axis] = at;
    middle_high[axis] = at;
    split(low, middle_high, least, most, random, rooms);
    split(middle_low, high, least, most, random, rooms);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_side_by_side_share_the_wall_between_them() {
        let a = Room::rectangle([0.0, 0.0], [4.0, 3.0]);
        let b = Room::rectangle([4.0, 1.0], [6.0, 5.0]);
        let [from, to] = a.shared_side(&b).expect("a common wall");
        assert_eq!([from.map(f64::round), to.map(f64::round)], [[4.0, 1.0], [4.0, 3.0]]);
        assert_eq!(a.shared_side(&Room::rectangle([5.0, 0.0], [6.0, 3.0])), None);
    }

    #[test]
    fn splitting_covers_the_rectangle() {
        let mut rooms = Vec::new();
        split([0.0, 0.0], [20.0, 12.0], 2.5, 6.0, &mut Random::new(2, &[]), &mut rooms);
        let area: f64 = rooms.iter().map(Room::area).sum();
        assert!((area - 240.0).abs() < 1e-9 && rooms.len() > 5);
    }
}
