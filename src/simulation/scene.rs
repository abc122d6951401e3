//! A world at one moment, as a lidar meets it: solid or not, on fine cells.
//!
//! Method: rays jump over free space. Each cell holds its Chebyshev distance c to the nearest solid cell (two-pass
//! chamfer, exact for this norm). A ray in a cell of distance c leaves the square of side 2c - 1 around that cell in
//! one step, since all of it is free; with c = 1 this is the plain walk from cell to cell. Cost: the raster and two
//! passes over it to build; some ten steps a ray in a furnished room.

use super::numbers::index;
use super::shape::{Shape, around};
use crate::geometry::{Angle, Point, Pose2};
use crate::grid::Lattice;

/// What a lidar can hit: a raster of cells of [`Scene::RESOLUTION`] in the world's frame.
#[derive(Debug, Clone)]
pub struct Scene {
    lattice: Lattice,
    /// 0 = solid; else the distance in cells to the nearest solid cell, along the longer axis, at most 255.
    clearance: Vec<u8>,
}

/// A ray's first point in a cell must lie clearly beyond the border that it crossed.
const STEP_OVER: f64 = 1e-7;

impl Scene {
    /// Side of a cell in metres: half of the finest map that robots usually draw.
    pub const RESOLUTION: f64 = 0.025;
    /// Free space around what is drawn, in metres.
    const MARGIN: f64 = 0.5;

    /// Draws shapes in their order, each solid (`true`) or carved out (`false`).
    ///
    /// # Panics
    /// When there is no shape, or they spread over more than a lattice can hold (1 km on a side).
    #[must_use]
    pub fn draw(strokes: &[(Shape, bool)]) -> Self {
        let corners: Vec<Point> = strokes.iter().flat_map(|(s, _)| s.boxes()).flatten().collect();
        let [low, high] = around(&corners, Self::MARGIN);
        // on whole cells, so that a wall takes the same cells whatever else is drawn
        let low = low.map(|metres| (metres / Self::RESOLUTION).floor() * Self::RESOLUTION);
        let cells = |length: f64| index((length / Self::RESOLUTION).ceil());
        let lattice = Lattice::new(
            cells(high[0] - low[0]),
            cells(high[1] - low[1]),
            Self::RESOLUTION,
            Pose2::new(low[0], low[1], Angle::ZERO),
        )
        .expect("invariant: worlds are drawn with at least one shape and stay below 1 km");
        let mut clearance = vec![u8::MAX; lattice.cell_count()];
        for (shape, solid) in strokes {
            let value = if *solid { 0 } else { u8::MAX };
            for [from, to] in shape.boxes() {
                let ([u0, v0], [u1, v1]) = (lattice.to_cells(from), lattice.to_cells(to));
                for row in index(v0)..index(v1.ceil()).min(lattice.height()) {
                    let [first, y] = lattice.cell_center(0, row);
                    for column in index(u0)..index(u1.ceil()).min(lattice.width()) {
                        if shape.contains([first + f64::from(column) * Self::RESOLUTION, y]) {
                            clearance[lattice.index(column, row)] = value;
                        }
                    }
                }
            }
        }
        spread(&mut clearance, lattice.width() as usize);
        Self { lattice, clearance }
    }

    /// The cells.
    #[must_use]
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Whether there is something at the point; what lies outside of the raster is empty.
    #[must_use]
    pub fn is_solid(&self, point: Point) -> bool {
        self.cell(point) == Some(0)
    }

    /// Metres of free space around the point, along the longer axis and at most 6.3 m; 0 outside of the raster.
    #[must_use]
    pub fn clearance(&self, point: Point) -> f64 {
        f64::from(self.cell(point).unwrap_or(0)) * Self::RESOLUTION
    }

    /// Metres from `origin` along `direction` to the first solid cell, `None` when there is none within `max_range`.
    #[must_use]
    pub fn cast(&self, origin: Point, direction: Angle, max_range: f64) -> Option<f64> {
        let [u0, v0] = self.lattice.to_cells(origin);
        let (dv, du) = direction.sin_cos();
        let limit = max_range / Self::RESOLUTION;
        let mut travelled = 0.0;
        while travelled <= limit {
            let (column, row) = self.lattice.cell_of([u0 + du * travelled, v0 + dv * travelled])?;
            let clearance = self.clearance[self.lattice.index(column, row)];
            if clearance == 0 {
                return Some(travelled * Self::RESOLUTION);
            }
            let reach = f64::from(clearance - 1);
            let leave = |start: f64, slope: f64, cell: u32| {
                let cell = f64::from(cell);
                if slope > 0.0 {
                    (cell + 1.0 + reach - start) / slope
                } else if slope < 0.0 {
                    (cell - reach - start) / slope
                } else {
                    f64::INFINITY
                }
            };
            travelled = travelled.max(leave(u0, du, column).min(leave(v0, dv, row))) + STEP_OVER;
        }
        None
    }

    fn cell(&self, point: Point) -> Option<u8> {
        let (column, row) = self.lattice.cell_at(point)?;
        Some(self.clearance[self.lattice.index(column, row)])
    }
}

/// Chebyshev distance to the nearest 0, in place.
fn spread(cells: &mut [u8], width: usize) {
    let relax = |cells: &mut [u8], at: usize, from: usize| {
        cells[at] = cells[at].min(cells[from].saturating_add(1));
    };
    for at in 0..cells.len() {
        let column = at % width;
        if column > 0 {
            relax(cells, at, at - 1);
        }
        if at >= width {
            relax(cells, at, at - width);
            if column > 0 {
                relax(cells, at, at - width - 1);
            }
            if column + 1 < width {
                relax(cells, at, at - width + 1);
            }
        }
    }
    for at in (0..cells.len()).rev() {
        let column = at % width;
        if column + 1 < width {
            relax(cells, at, at + 1);
        }
        if at + width < cells.len() {
            relax(cells, at, at + width);
            if column > 0 {
                relax(cells, at, at + width - 1);
            }
            if column + 1 < width {
                relax(cells, at, at + width + 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::Random;

    fn cluttered(seed: u64) -> Scene {
        let mut random = Random::new(seed, &[]);
        let strokes: Vec<(Shape, bool)> = (0..12)
            .map(|k| {
                let center = [random.uniform(0.0, 4.0), random.uniform(0.0, 3.0)];
                let to = [random.uniform(0.0, 4.0), random.uniform(0.0, 3.0)];
                let bar = Shape::Bar {
                    from: center,
                    to,
                    thickness: 0.1,
                };
                let disc = Shape::Disc { center, radius: 0.2 };
                (if k % 2 == 0 { bar } else { disc }, random.chance(0.8))
            })
            .collect();
        Scene::draw(&strokes)
    }

    /// The nearest entry into any solid cell, by testing the ray against every one of them.
    fn cast_slowly(scene: &Scene, origin: Point, direction: Angle, max_range: f64) -> Option<f64> {
        let lattice = scene.lattice();
        let [u, v] = lattice.to_cells(origin);
        let (dv, du) = direction.sin_cos();
        let mut best: Option<f64> = None;
        for row in 0..lattice.height() {
            for column in 0..lattice.width() {
                if scene.clearance[lattice.index(column, row)] != 0 {
                    continue;
                }
                let slab = |start: f64, slope: f64, cell: u32| {
                    let (a, b) = (
                        (f64::from(cell) - start) / slope,
                        (f64::from(cell) + 1.0 - start) / slope,
                    );
                    (a.min(b), a.max(b))
                };
                let (near_u, far_u) = slab(u, du, column);
                let (near_v, far_v) = slab(v, dv, row);
                let (near, far) = (near_u.max(near_v).max(0.0), far_u.min(far_v));
                // a ray that only grazes a corner may be told either way
                if near + 1e-6 < far {
                    best = Some(best.map_or(near, |b| b.min(near)));
                }
            }
        }
        best.map(|cells| cells * Scene::RESOLUTION)
            .filter(|range| *range <= max_range)
    }

    #[test]
    fn rays_that_jump_meet_what_rays_tested_against_every_cell_meet() {
        for seed in 0..4 {
            let scene = cluttered(seed);
            let mut random = Random::new(seed, &[1]);
            for _ in 0..60 {
                let origin = [random.uniform(0.0, 4.0), random.uniform(0.0, 3.0)];
                let direction = Angle::from_radians(random.uniform(-3.1, 3.1));
                let (fast, slow) = (
                    scene.cast(origin, direction, 3.0),
                    cast_slowly(&scene, origin, direction, 3.0),
                );
                match (fast, slow) {
                    (Some(a), Some(b)) => assert!((a - b).abs() < 1e-5, "{origin:?} {direction:?}: {a} {b}"),
                    (a, b) => assert_eq!(a, b, "{origin:?} {direction:?}"),
                }
            }
        }
    }

    #[test]
    fn clearance_is_the_chebyshev_distance_to_the_nearest_solid_cell() {
        let scene = cluttered(9);
        let lattice = *scene.lattice();
        let cell = |column, row| scene.clearance[lattice.index(column, row)];
        let solid: Vec<(u32, u32)> = (0..lattice.height())
            .flat_map(|row| (0..lattice.width()).map(move |column| (column, row)))
            .filter(|&(column, row)| cell(column, row) == 0)
            .collect();
        for row in (0..lattice.height()).step_by(7) {
            for column in (0..lattice.width()).step_by(5) {
                let nearest = solid
                    .iter()
                    .map(|&(i, j)| i.abs_diff(column).max(j.abs_diff(row)))
                    .min();
                assert_eq!(Some(u32::from(cell(column, row))), nearest);
            }
        }
    }

    #[test]
    fn an_axis_parallel_ray_stops_at_the_wall() {
        let wall = Shape::Bar {
            from: [2.0, -1.0],
            to: [2.0, 1.0],
            thickness: 0.2,
        };
        let range = Scene::draw(&[(wall, true)])
            .cast([1.4, 0.01], Angle::ZERO, 5.0)
            .expect("a wall");
        assert!((range - 0.5).abs() <= Scene::RESOLUTION, "{range}");
        assert_eq!(
            Scene::draw(&[(wall, true)]).cast([1.4, 0.01], Angle::HALF_TURN, 5.0),
            None
        );
    }
}
