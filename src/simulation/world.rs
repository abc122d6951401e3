//! Worlds: buildings made from a seed, with furniture that may stand elsewhere on the next visit.

use std::fmt;
use std::str::FromStr;

use super::buildings;
use super::furniture::Furniture;
use super::shape::Shape;
use super::{Random, Scene, SimulationError};
use crate::geometry::{Angle, Point, Pose2};

/// What a world is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum WorldKind {
    /// Corridors and rooms of many sizes at right angles.
    Office,
    /// Rows of rooms that are all the same, furniture included: the nastiest place to tell where one is.
    Repetitive,
    /// A hall with shelves, columns and a few rooms in a corner.
    Hall,
    /// Wings at odd angles around a polygonal hall, rings of rooms around a court, slanted walls.
    Angled,
    /// A wide cluttered space with few walls.
    Clutter,
    /// Small flats side by side along a landing.
    Flat,
    /// Long corridors with niches and little else.
    Corridors,
    /// Thirty blocks of many sizes and directions in a walled yard.
    Blocks,
    /// Copies of one to five storeys turned in every direction, with streets between them.
    Campus,
}

impl WorldKind {
    /// The kinds that are one building: what pairs are made of when none is named.
    pub const BUILDINGS: [Self; 8] = [
        Self::Office,
        Self::Repetitive,
        Self::Hall,
        Self::Angled,
        Self::Clutter,
        Self::Flat,
        Self::Corridors,
        Self::Blocks,
    ];
    /// All kinds.
    pub const ALL: [Self; 9] = {
        let [a, b, c, d, e, f, g, h] = Self::BUILDINGS;
        [a, b, c, d, e, f, g, h, Self::Campus]
    };

    /// The name by which commands and files call the kind.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Office => "office",
            Self::Repetitive => "repetitive",
            Self::Hall => "hall",
            Self::Angled => "angled",
            Self::Clutter => "clutter",
            Self::Flat => "flat",
            Self::Corridors => "corridors",
            Self::Blocks => "blocks",
            Self::Campus => "campus",
        }
    }
}

impl fmt::Display for WorldKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for WorldKind {
    type Err = SimulationError;

    fn from_str(name: &str) -> Result<Self, SimulationError> {
        let named = Self::ALL.into_iter().find(|kind| kind.name() == name);
        named.ok_or_else(|| SimulationError::UnknownKind(name.to_owned()))
    }
}

/// A building: what stands fast, what can be moved, and a point from which robots set out.
///
/// A function of its kind and seed alone. Metres, in the world's own frame.
#[derive(Debug, Clone, PartialEq)]
pub struct World {
    kind: WorldKind,
    seed: u64,
    pub(super) strokes: Vec<(Shape, bool)>,
    pub(super) furniture: Vec<Furniture>,
    pub(super) entrance: Point,
}

impl World {
    /// The world of this kind and seed.
    #[must_use]
    pub fn generate(kind: WorldKind, seed: u64) -> Self {
        let mut random = Random::new(seed, &[kind as u64]);
        let mut world = Self::empty(kind, seed);
        buildings::build(kind, &mut random, &mut world);
        world
    }

    pub(super) fn empty(kind: WorldKind, seed: u64) -> Self {
        Self {
            kind,
            seed,
            strokes: Vec::new(),
            furniture: Vec::new(),
            entrance: [0.0, 0.0],
        }
    }

    /// What the world is like.
    #[must_use]
    pub fn kind(&self) -> WorldKind {
        self.kind
    }

    /// A name that no other world has: kind and seed.
    #[must_use]
    pub fn id(&self) -> String {
        format!("{}-{}", self.kind, self.seed)
    }

    /// Where robots enter: free, and connected to all that they can reach.
    #[must_use]
    pub fn entrance(&self) -> Point {
        self.entrance
    }

    /// The world as it was built.
    #[must_use]
    pub fn scene(&self) -> Scene {
        self.scene_at_visit(0, 0.0)
    }

    /// The world on a later visit, when `moved_share` of the furniture has been moved, turned or taken away. The same
    /// visit finds the same things in the same places.
    #[must_use]
    pub fn scene_at_visit(&self, visit: u64, moved_share: f64) -> Scene {
        let mut random = Random::new(self.seed, &[self.kind as u64, 1 + visit]);
        let mut strokes = self.strokes.clone();
        for item in &self.furniture {
            let moved = random.chance(moved_share);
            let gone = random.chance(0.3);
            let shift = Pose2::new(
                random.uniform(-1.5, 1.5),
                random.uniform(-1.5, 1.5),
                Angle::from_radians(random.uniform(-1.6, 1.6)),
            );
            match (moved, gone) {
                (false, _) => strokes.extend(item.shapes(item.pose).map(|shape| (shape, true))),
                (true, false) => strokes.extend(item.shapes(item.pose * shift).map(|shape| (shape, true))),
                (true, true) => {}
            }
        }
        Scene::draw(&strokes)
    }

    /// Draws a straight wall.
    pub(super) fn wall(&mut self, from: Point, to: Point, thickness: f64) {
        self.strokes.push((Shape::Bar { from, to, thickness }, true));
    }

    /// Carves a straight passage of `width` out of what is drawn so far.
    pub(super) fn carve(&mut self, from: Point, to: Point, width: f64) {
        let shape = Shape::Bar {
            from,
            to,
            thickness: width,
        };
        self.strokes.push((shape, false));
    }

    /// Draws walls along the sides of a polygon, closed at the corners.
    pub(super) fn outline(&mut self, polygon: &[Point], thickness: f64) {
        for (k, &from) in polygon.iter().enumerate() {
            self.wall(from, polygon[(k + 1) % polygon.len()], thickness);
            let corner = Shape::Disc {
                center: from,
                radius: thickness / 2.0,
            };
            self.strokes.push((corner, true));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::tour::Planner;

    #[test]
    fn the_same_seed_gives_the_same_world_and_another_seed_another() {
        for kind in WorldKind::ALL {
            assert_eq!(World::generate(kind, 3), World::generate(kind, 3));
            assert_ne!(World::generate(kind, 3).strokes, World::generate(kind, 4).strokes);
        }
    }

    #[test]
    fn every_world_has_room_to_drive_in_from_its_entrance() {
        for kind in WorldKind::ALL {
            for seed in 0..3 {
                let world = World::generate(kind, seed);
                let scene = world.scene();
                let planner = Planner::new(&scene, 0.25);
                let area = planner
                    .region(world.entrance(), f64::INFINITY)
                    .map_or(0.0, |r| r.area());
                let least = if kind == WorldKind::Flat { 30.0 } else { 100.0 };
                assert!(area > least, "{} has {area} m2 to drive in", world.id());
            }
        }
    }

    #[test]
    fn nothing_can_be_seen_through_the_outer_walls() {
        for kind in WorldKind::ALL {
            let world = World::generate(kind, 11);
            let scene = world.scene();
            for k in 0..720_u32 {
                let direction = Angle::from_radians(f64::from(k) * std::f64::consts::TAU / 720.0);
                assert!(
                    scene.cast(world.entrance(), direction, 200.0).is_some(),
                    "{}: a ray leaves the world",
                    world.id()
                );
            }
        }
    }

    #[test]
    fn furniture_moves_between_visits_and_walls_do_not() {
        let world = World::generate(WorldKind::Office, 1);
        let bare = World {
            furniture: Vec::new(),
            ..world.clone()
        };
        let (bare, before, after) = (bare.scene(), world.scene(), world.scene_at_visit(5, 0.5));
        let mut changed = 0;
        for row in 0..bare.lattice().height() {
            for column in 0..bare.lattice().width() {
                let point = bare.lattice().cell_center(column, row);
                let (was, is) = (before.is_solid(point), after.is_solid(point));
                assert!(!bare.is_solid(point) || (was && is), "the wall at {point:?} has gone");
                changed += usize::from(was != is);
            }
        }
        assert!(changed > 1000, "{changed}");
    }

    #[test]
    fn kinds_are_parsed_by_their_names() {
        for kind in WorldKind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
        }
        let error = "castle".parse::<WorldKind>().expect_err("no castles");
        assert!(error.to_string().contains("castle") && error.to_string().contains("repetitive"));
    }
}
