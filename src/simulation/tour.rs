//! Where a robot drives: tours through the free space of a scene.
//!
//! Method: a lattice of 0.15 m cells, passable where the robot's radius is clear of all that is solid. From where the
//! robot is, cheapest paths to every cell of its region (Dijkstra, cells near walls cost double); the next waypoint is
//! the one of some random candidates that lies farthest from where it has been, less a little for the way there. Paths
//! are smoothed and cut into equal steps.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::numbers::{index, real};
use super::shape::{distance, mix};
use super::{Random, Scene, SimulationError};
use crate::geometry::{Angle, Point, Pose2};
use crate::grid::Lattice;

/// The free space of a scene for robots of one size.
#[derive(Debug, Clone)]
pub struct Planner {
    lattice: Lattice,
    /// Cost of a step onto the cell; 0 = impassable.
    cost: Vec<u32>,
    radius: f64,
}

/// Cells that can be reached from a point without going farther than some way.
#[derive(Debug, Clone)]
pub struct Region {
    start: usize,
    cells: Vec<usize>,
    /// Cost of the way from the start by cell; [`FAR`] outside of the region.
    reach: Vec<u32>,
}

/// A robot's poses, one a scan, in the world.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tour {
    /// In the order in which they are driven.
    pub poses: Vec<Pose2>,
}

const FAR: u32 = u32::MAX;
const STRAIGHT: u32 = 5;
const DIAGONAL: u32 = 7;

impl Region {
    /// Square metres that the robot's middle can be in.
    #[must_use]
    pub fn area(&self) -> f64 {
        real(self.cells.len()) * Planner::RESOLUTION * Planner::RESOLUTION
    }
}

impl Planner {
    /// Side of a planning cell in metres.
    pub const RESOLUTION: f64 = 0.15;

    /// The free space for a robot of this radius in metres.
    ///
    /// # Panics
    /// Never for a scene that was drawn: its planning lattice is smaller than its own.
    #[must_use]
    pub fn new(scene: &Scene, radius: f64) -> Self {
        let fine = scene.lattice();
        let cells = |count: u32| index((f64::from(count) * fine.resolution() / Self::RESOLUTION).ceil());
        let lattice = Lattice::new(
            cells(fine.width()),
            cells(fine.height()),
            Self::RESOLUTION,
            fine.origin(),
        )
        .expect("invariant: coarser than the scene's own lattice");
        let mut cost = vec![0; lattice.cell_count()];
        for row in 0..lattice.height() {
            for column in 0..lattice.width() {
                let clearance = scene.clearance(lattice.cell_center(column, row));
                if clearance >= radius {
                    cost[lattice.index(column, row)] = if clearance < radius + 0.3 { 2 } else { 1 };
                }
            }
        }
        Self { lattice, cost, radius }
    }

    /// All that can be reached from near `start` on a way of at most `reach` metres.
    ///
    /// # Errors
    /// [`SimulationError::NoRoom`] when no free cell is within 1 m of `start`.
    pub fn region(&self, start: Point, reach: f64) -> Result<Region, SimulationError> {
        let start = self.nearest_free(start)?;
        let limit = reach / Self::RESOLUTION * f64::from(STRAIGHT);
        let limit = if limit >= f64::from(FAR) { FAR - 1 } else { index(limit) };
        let (reach, _) = self.flood(start, limit, |_| true);
        let cells = (0..reach.len()).filter(|&cell| reach[cell] != FAR).collect();
        Ok(Region { start, cells, reach })
    }

    /// A random point of the region whose way from its start is `from` to `to` metres long, if there is any.
    pub fn point_at(&self, region: &Region, from: f64, to: f64, random: &mut Random) -> Option<Point> {
        let metres = |cell: usize| f64::from(region.reach[cell]) * Self::RESOLUTION / f64::from(STRAIGHT);
        let ring: Vec<usize> = region
            .cells
            .iter()
            .copied()
            .filter(|&cell| (from..=to).contains(&metres(cell)))
            .collect();
        (!ring.is_empty()).then(|| self.center(random.pick(&ring)))
    }

    /// Drives from the region's start through the region until `length` metres are driven or it is explored, with a
    /// pose every `spacing` metres.
    #[must_use]
    pub fn tour(&self, region: &Region, length: f64, spacing: f64, random: &mut Random) -> Tour {
        let mut path = vec![self.center(region.start)];
        let mut driven = 0.0;
        let mut here = region.start;
        for _ in 0..200 {
            if driven >= length {
                break;
            }
            let (cost, parent) = self.flood(here, FAR - 1, |cell| region.reach[cell] != FAR);
            let worth = |cell: usize| {
                let there = self.center(cell);
                let new = path.iter().map(|&p| distance(p, there)).fold(f64::INFINITY, f64::min);
                new - 0.1 * f64::from(cost[cell]) * Self::RESOLUTION / f64::from(STRAIGHT)
            };
            let candidates: Vec<(usize, f64)> = (0..16)
                .map(|_| random.pick(&region.cells))
                .filter(|&cell| cost[cell] != FAR && cell != here)
                .map(|cell| (cell, worth(cell)))
                .collect();
            let Some(&(next, _)) = candidates.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else {
                break;
            };
            let mut leg = vec![next];
            while let Some(&cell) = leg.last().filter(|&&cell| cell != here) {
                leg.push(parent[cell]);
            }
            for &cell in leg.iter().rev().skip(1) {
                let point = self.center(cell);
                driven += path.last().map_or(0.0, |&last| distance(last, point));
                path.push(point);
                if driven >= length {
                    break;
                }
            }
            here = next;
        }
        Tour {
            poses: steps(&self.smooth(&path), spacing),
        }
    }

    fn center(&self, cell: usize) -> Point {
        let (column, row) = self.place(cell);
        self.lattice.cell_center(column, row)
    }

    #[expect(clippy::cast_possible_truncation, reason = "cells of a lattice are indexed by u32")]
    fn place(&self, cell: usize) -> (u32, u32) {
        let width = self.lattice.width() as usize;
        ((cell % width) as u32, (cell / width) as u32)
    }

    fn passable(&self, point: Point) -> bool {
        self.lattice
            .cell_at(point)
            .is_some_and(|(column, row)| self.cost[self.lattice.index(column, row)] > 0)
    }

    fn nearest_free(&self, point: Point) -> Result<usize, SimulationError> {
        let near = |cell: &usize| distance(self.center(*cell), point);
        (0..self.cost.len())
            .filter(|&cell| self.cost[cell] > 0)
            .min_by(|a, b| near(a).total_cmp(&near(b)))
            .filter(|cell| near(cell) <= 1.0)
            .ok_or(SimulationError::NoRoom {
                x: point[0],
                y: point[1],
                radius: self.radius,
            })
    }

    /// Costs of the cheapest ways from `start`, and the cell before each on that way.
    fn flood(&self, start: usize, limit: u32, allowed: impl Fn(usize) -> bool) -> (Vec<u32>, Vec<usize>) {
        let mut cost = vec![FAR; self.cost.len()];
        let mut parent = vec![start; self.cost.len()];
        let mut open = BinaryHeap::from([Reverse((0_u32, start))]);
        cost[start] = 0;
        while let Some(Reverse((so_far, cell))) = open.pop() {
            if so_far > cost[cell] {
                continue;
            }
            for (next, step) in self.neighbours(cell) {
                let total = so_far.saturating_add(step * self.cost[next]);
                if self.cost[next] > 0 && total < cost[next] && total <= limit && allowed(next) {
                    cost[next] = total;
                    parent[next] = cell;
                    open.push(Reverse((total, next)));
                }
            }
        }
        (cost, parent)
    }

    fn neighbours(&self, cell: usize) -> impl Iterator<Item = (usize, u32)> {
        let (column, row) = self.place(cell);
        let (width, height) = (self.lattice.width(), self.lattice.height());
        let columns = column.saturating_sub(1)..=(column + 1).min(width - 1);
        let rows = row.saturating_sub(1)..=(row + 1).min(height - 1);
        rows.flat_map(move |j| columns.clone().map(move |i| (i, j)))
            .filter(move |&at| at != (column, row))
            .map(move |(i, j)| {
                let step = if i == column || j == row { STRAIGHT } else { DIAGONAL };
                (j as usize * width as usize + i as usize, step)
            })
    }

    /// A running mean over five points, kept where it stays clear of walls.
    fn smooth(&self, path: &[Point]) -> Vec<Point> {
        (0..path.len())
            .map(|k| {
                let near = &path[k.saturating_sub(2)..(k + 3).min(path.len())];
                let sum = near.iter().fold([0.0, 0.0], |s, p| [s[0] + p[0], s[1] + p[1]]);
                let mean = [sum[0] / real(near.len()), sum[1] / real(near.len())];
                if self.passable(mean) { mean } else { path[k] }
            })
            .collect()
    }
}

/// Points every `spacing` metres along a path, looking ahead along it.
fn steps(path: &[Point], spacing: f64) -> Vec<Pose2> {
    let mut points: Vec<Point> = path.first().copied().into_iter().collect();
    let mut left = spacing;
    for pair in path.windows(2) {
        let length = distance(pair[0], pair[1]);
        let mut at = 0.0;
        while length - at >= left {
            at += left;
            points.push(mix(pair[0], pair[1], at / length));
            left = spacing;
        }
        left -= length - at;
    }
    let heading = |k: usize| {
        let (from, to) = (points[k.saturating_sub(1)], points[(k + 1).min(points.len() - 1)]);
        Angle::from_radians((to[1] - from[1]).atan2(to[0] - from[0]))
    };
    (0..points.len())
        .map(|k| Pose2::new(points[k][0], points[k][1], heading(k)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::{World, WorldKind};

    #[test]
    fn a_tour_stays_in_free_space_and_moves_in_equal_steps() {
        let world = World::generate(WorldKind::Office, 5);
        let scene = world.scene();
        let planner = Planner::new(&scene, 0.25);
        let region = planner.region(world.entrance(), 15.0).expect("room to drive in");
        let tour = planner.tour(&region, 40.0, 0.35, &mut Random::new(1, &[]));
        assert!(tour.poses.len() > 100, "{}", tour.poses.len());
        for pose in &tour.poses {
            assert!(scene.clearance(pose.translation()) > 0.1, "{pose:?}");
        }
        for pair in tour.poses.windows(2) {
            let step = distance(pair[0].translation(), pair[1].translation());
            assert!(step <= 0.35 + 1e-9, "{step}");
        }
    }

    #[test]
    fn a_region_ends_where_the_way_gets_too_long() {
        let world = World::generate(WorldKind::Blocks, 5);
        let scene = world.scene();
        let planner = Planner::new(&scene, 0.25);
        let (small, large) = (
            planner.region(world.entrance(), 4.0).expect("free"),
            planner.region(world.entrance(), 9.0).expect("free"),
        );
        assert!(small.area() < large.area());
        let point = planner
            .point_at(&large, 8.0, 9.0, &mut Random::new(1, &[]))
            .expect("far cells");
        assert!(distance(point, world.entrance()) < 9.2);
        assert!(planner.region([-100.0, 0.0], 5.0).is_err());
    }
}
