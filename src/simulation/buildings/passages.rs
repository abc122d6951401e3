//! Long corridors: a mesh of passages carved out of solid ground, with niches and little else.

use crate::geometry::Point;
use crate::simulation::numbers::{count, real};
use crate::simulation::shape::Shape;
use crate::simulation::{Random, World};

/// Two or three passages each way that cross at uneven distances; door niches, columns, a few open bays.
pub(super) fn corridors(random: &mut Random, world: &mut World) {
    let lines = |random: &mut Random, number: usize| {
        let mut at = 3.0;
        (0..number)
            .map(|_| {
                at += random.uniform(9.0, 20.0);
                at
            })
            .collect::<Vec<f64>>()
    };
    let (across, up) = (random.between(2, 3), random.between(2, 3));
    let (ys, xs) = (lines(random, across), lines(random, up));
    let overhang = [random.uniform(0.0, 8.0), random.uniform(0.0, 8.0)];
    let (first, last) = ([xs[0], ys[0]], [xs[up - 1], ys[across - 1]]);
    let middle = f64::midpoint(first[1], last[1]);
    let ground = Shape::Bar {
        from: [first[0] - 16.0, middle],
        to: [last[0] + 16.0, middle],
        thickness: last[1] - first[1] + 32.0,
    };
    world.strokes.push((ground, true));
    for &y in &ys {
        let ends = [
            first[0] - overhang[0] * random.unit(),
            last[0] + overhang[0] * random.unit(),
        ];
        passage([ends[0], y], [ends[1], y], random, world);
    }
    for &x in &xs {
        let ends = [
            first[1] - overhang[1] * random.unit(),
            last[1] + overhang[1] * random.unit(),
        ];
        passage([x, ends[0]], [x, ends[1]], random, world);
    }
    world.entrance = [xs[0], ys[0]];
}

fn passage(from: Point, to: Point, random: &mut Random, world: &mut World) {
    let width = random.uniform(1.8, 3.2);
    let along = usize::from(to[1] - from[1] > to[0] - from[0]);
    let (mut start, mut end) = (from, to);
    start[along] -= width / 2.0;
    end[along] += width / 2.0;
    world.carve(start, end, width);
    let length = end[along] - start[along];
    let side = |random: &mut Random| if random.chance(0.5) { 1.0 } else { -1.0 };
    // closed doors stand back a hand's breadth from the wall
    for _ in 0..count(length / random.uniform(4.0, 12.0)) {
        let at = random.uniform(1.0, length - 1.0);
        let (deep, wide) = (random.uniform(0.08, 0.3), random.uniform(0.9, 1.6));
        recess(start, along, at, side(random) * width / 2.0, [wide, deep], world);
    }
    for _ in 0..random.below(3) {
        let at = random.uniform(3.0, (length - 3.0).max(3.1));
        let bay = [random.uniform(2.0, 6.0), random.uniform(1.5, 5.0)];
        recess(start, along, at, side(random) * width / 2.0, bay, world);
    }
    for _ in 0..random.below(4) {
        let mut center = start;
        center[along] += random.uniform(1.5, length - 1.5);
        center[1 - along] += side(random) * (width / 2.0 - real(random.below(2)) * 0.1);
        let radius = random.uniform(0.15, 0.3);
        world.strokes.push((Shape::Disc { center, radius }, true));
    }
}

/// Carves a rectangle of `[along, deep]` metres out of the passage's side at `edge` metres from its middle.
fn recess(start: Point, along: usize, at: f64, edge: f64, [wide, deep]: [f64; 2], world: &mut World) {
    let (mut from, mut to) = (start, start);
    from[along] += at - wide / 2.0;
    to[along] += at + wide / 2.0;
    let middle = edge + edge.signum() * (deep - 0.2) / 2.0;
    from[1 - along] += middle;
    to[1 - along] += middle;
    world.carve(from, to, deep + 0.2);
}
