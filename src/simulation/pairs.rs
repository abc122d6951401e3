//! Labelled pairs of maps: of one place, of two places of the same building, of two buildings.
//!
//! Method: tours are drawn at random and tried out with a coarse preview (which 0.2 m cells would be seen), until the
//! preview's overlap is as wished; only then are the maps drawn, and the label is measured on the maps themselves.

use std::fmt;

use super::compare::{Comparison, compare, walls_within, weakly_constrained};
use super::drive::DriveLog;
use super::explore::frame_near;
use super::mapper::draw;
use super::numbers::count;
use super::preview::Preview;
use super::recipe::Recipe;
use super::tour::{Planner, Region};
use super::{Random, Scene, SimulationError, Tour, World, WorldKind};
use crate::geometry::{Point, Pose2};
use crate::grid::OccupancyGrid;

/// How the two maps of a pair are related.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relation {
    /// They show the same place, in part.
    Matching,
    /// They show two places of one building that have nothing in common.
    SameBuilding,
    /// They show two buildings.
    DifferentBuildings,
}

impl fmt::Display for Relation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Matching => "matching",
            Self::SameBuilding => "same-building",
            Self::DifferentBuildings => "different-building",
        })
    }
}

/// Which pair is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PairRequest {
    /// Seed of the whole set of pairs.
    pub seed: u64,
    /// The wanted label.
    pub relation: Relation,
    /// Kind of world of the fixed map.
    pub kind: WorldKind,
    /// How many worlds of each kind the set has, at least 1.
    pub worlds: u64,
    /// Number of the pair among those of its relation and kind.
    pub number: u64,
}

/// What is known of a pair.
#[derive(Debug, Clone, PartialEq)]
pub enum Truth {
    /// The maps belong together.
    Match {
        /// Pose of the moving map's frame in the fixed map's frame.
        pose_fixed_moving: Pose2,
        /// What they have in common there.
        common: Comparison,
    },
    /// The maps have nothing in common. The real relative pose, when they are of one building, serves to check that.
    Apart {
        /// Pose of the moving map's frame in the fixed map's frame; `None` for two buildings.
        placement: Option<Pose2>,
    },
}

/// Two maps and what is known of them.
#[derive(Debug, Clone, PartialEq)]
pub struct MapPair {
    /// The world or the two worlds, as `a` or `a|b`.
    pub building: String,
    /// The map that stays.
    pub fixed: OccupancyGrid,
    /// The map to be registered to it.
    pub moving: OccupancyGrid,
    /// The label.
    pub truth: Truth,
    /// What is out of the ordinary.
    pub tags: Vec<&'static str>,
}

/// Two places of one building are apart when walls of the two maps are nowhere nearer than this, in metres.
const APART: f64 = 0.6;
/// Two places of one building have nothing in common below this share of the smaller map.
const COMMON_MOST: f64 = 0.003;
/// A preview of a matching pair may miss the wished overlap by this much.
const OVERLAP_OFF: f64 = 0.12;
/// Matching maps have at least this much in common, in square metres: a corner of a room tells no pose.
const COMMON_LEAST: f64 = 8.0;
/// A map smaller than this is no map, in square metres.
const AREA_LEAST: f64 = 25.0;

/// Makes the pair; the same request gives the same bytes.
///
/// # Errors
/// [`SimulationError::NoPair`] when neither the requested world nor a few others can offer such a pair.
pub fn generate_pair(request: &PairRequest) -> Result<MapPair, SimulationError> {
    const WORLDS: u64 = 6;
    let mut result = Err(SimulationError::NothingSeen);
    for detour in 0..WORLDS {
        let random = Random::new(
            request.seed,
            &[request.kind as u64, request.relation as u64, request.number, detour],
        );
        let world = (request.number + detour) % request.worlds.max(1);
        result = PairMaker::new(request, world, random).and_then(PairMaker::make);
        if result.is_ok() {
            break;
        }
    }
    result
}

/// One robot's part in a pair.
struct Side {
    scene: Scene,
    planner: Planner,
    everywhere: Region,
}

impl Side {
    fn new(world: &World, visit: u64, moved_share: f64) -> Result<Self, SimulationError> {
        let scene = world.scene_at_visit(visit, moved_share);
        let planner = Planner::new(&scene, 0.25);
        let everywhere = planner.region(world.entrance(), f64::INFINITY)?;
        Ok(Self {
            scene,
            planner,
            everywhere,
        })
    }
}

struct PairMaker {
    relation: Relation,
    worlds: [World; 2],
    sides: [Side; 2],
    recipe: Recipe,
    random: Random,
}

impl PairMaker {
    fn new(request: &PairRequest, number: u64, mut random: Random) -> Result<Self, SimulationError> {
        let world = |kind, number| World::generate(kind, request.seed.wrapping_mul(1000) + number);
        let fixed = world(request.kind, number);
        let moving = if request.relation == Relation::DifferentBuildings {
            let other = if random.chance(0.7) {
                request.kind
            } else {
                random.pick(&WorldKind::BUILDINGS)
            };
            let step = 1 + random.below(40) as u64;
            // of another kind any number will do; of the same kind it must be another one
            world(other, (number + step) % request.worlds.max(2))
        } else {
            fixed.clone()
        };
        let mut recipe = Recipe::draw(request.kind, &mut random)?;
        if request.relation == Relation::SameBuilding {
            recipe.lidar = recipe.lidar.with_max_range(random.uniform(5.0, 10.0));
            recipe.reach = [5.0, 12.0];
        }
        let visit = 2 * request.number;
        let sides = [
            Side::new(&fixed, visit, 0.0)?,
            Side::new(&moving, visit + 1, recipe.moved_share)?,
        ];
        Ok(Self {
            relation: request.relation,
            worlds: [fixed, moving],
            sides,
            recipe,
            random,
        })
    }

    fn make(mut self) -> Result<MapPair, SimulationError> {
        const FIXED_TRIES: usize = 6;
        if self.relation == Relation::DifferentBuildings && self.worlds[0].id() == self.worlds[1].id() {
            return Err(self.no_pair(0));
        }
        let wish = self.random.uniform(0.12, 0.9);
        for _ in 0..FIXED_TRIES {
            let Some((fixed, reach)) = self.tour(0, None) else {
                continue;
            };
            let Some(moving) = self.partner(&fixed, reach, wish) else {
                continue;
            };
            if let Some(pair) = self.draw([&fixed, &moving])? {
                return Ok(pair);
            }
        }
        Err(self.no_pair(FIXED_TRIES))
    }

    fn no_pair(&self, tries: usize) -> SimulationError {
        SimulationError::NoPair {
            relation: self.relation,
            world: self.worlds[0].id(),
            tries,
        }
    }

    /// A tour of one robot from the start or from anywhere, and how far it goes.
    fn tour(&mut self, side: usize, start: Option<Point>) -> Option<(Tour, f64)> {
        let Side {
            planner, everywhere, ..
        } = &self.sides[side];
        let random = &mut self.random;
        let start = start.or_else(|| planner.point_at(everywhere, 0.0, f64::INFINITY, random))?;
        let reach = random.uniform(self.recipe.reach[0], self.recipe.reach[1]);
        let region = planner.region(start, reach).ok()?;
        let length = reach * random.uniform(2.0, 5.0);
        let tour = planner.tour(&region, length, self.recipe.spacing, random);
        (tour.poses.len() >= 5).then_some((tour, reach))
    }

    /// A tour of the second robot that goes with the first one's as the relation demands.
    fn partner(&mut self, fixed: &Tour, reach: f64, wish: f64) -> Option<Tour> {
        const TRIES: usize = 10;
        if self.relation == Relation::DifferentBuildings {
            return self.tour(1, None).map(|(tour, _)| tour);
        }
        let lattice = Preview::lattice(&self.sides[0].scene);
        let seen = Preview::of(&self.sides[0].scene, lattice, fixed, &self.recipe.lidar);
        let start = fixed.poses.first()?.translation();
        let from_fixed = self.sides[0].planner.region(start, f64::INFINITY).ok()?;
        let mut best: Option<(f64, Tour)> = None;
        for _ in 0..TRIES {
            let [low, high] = match self.relation {
                Relation::Matching => [1.6 * reach * (0.7 - wish).max(0.0), 2.2 * reach * (1.0 - wish).max(0.1)],
                _ => [reach + 4.0, f64::INFINITY],
            };
            let near = self.sides[0].planner.point_at(&from_fixed, low, high, &mut self.random);
            let Some((tour, _)) = near.and_then(|point| self.tour(1, Some(point))) else {
                continue;
            };
            let other = Preview::of(&self.sides[1].scene, lattice, &tour, &self.recipe.lidar);
            if self.relation == Relation::SameBuilding {
                if seen.is_apart_from(&other) {
                    return Some(tour);
                }
                continue;
            }
            let off = (seen.overlap(&other) - wish).abs();
            if best.as_ref().is_none_or(|(before, _)| off < *before) {
                best = Some((off, tour));
            }
            if off < 0.06 {
                break;
            }
        }
        best.filter(|(off, _)| *off < OVERLAP_OFF).map(|(_, tour)| tour)
    }

    /// The pair of maps, unless they turn out not to be what was asked for.
    fn draw(&mut self, tours: [&Tour; 2]) -> Result<Option<MapPair>, SimulationError> {
        let mut maps = Vec::new();
        let mut frames = Vec::new();
        for side in [0, 1] {
            let (scene, recipe) = (&self.sides[side].scene, &self.recipe);
            let log = DriveLog::record(scene, tours[side], recipe.lidar, recipe.drift, &mut self.random);
            let believed = frame_near(tours[side], &mut self.random);
            let scatter = count(self.random.uniform(0.0, 1e9)) as u64;
            match draw(&log, believed, recipe.mappers[side], scatter) {
                Ok(map) => maps.push(map),
                Err(SimulationError::NothingSeen) => return Ok(None),
                Err(error) => return Err(error),
            }
            frames.push(log.true_frame(believed));
        }
        let (moving, fixed) = (maps.pop(), maps.pop());
        let (Some(fixed), Some(moving)) = (fixed, moving) else {
            return Ok(None);
        };
        let pose_fixed_moving = frames[0].inverse() * frames[1];
        let large = |map: &OccupancyGrid| map.known_area() >= AREA_LEAST && map.state_counts().occupied >= 150;
        if !(large(&fixed) && large(&moving)) {
            return Ok(None);
        }
        let mut tags = self.recipe.tags.clone();
        let truth = match self.relation {
            Relation::Matching => {
                let common = compare(&fixed, &moving, pose_fixed_moving);
                if !(0.1..=0.92).contains(&common.overlap) || common.common_area < COMMON_LEAST {
                    return Ok(None);
                }
                if weakly_constrained(&fixed, &moving, pose_fixed_moving) {
                    tags.push("weakly-constrained");
                }
                Truth::Match {
                    pose_fixed_moving,
                    common,
                }
            }
            Relation::SameBuilding => {
                let common = compare(&fixed, &moving, pose_fixed_moving);
                if common.overlap >= COMMON_MOST || walls_within(&fixed, &moving, pose_fixed_moving, APART) {
                    return Ok(None);
                }
                let placement = Some(pose_fixed_moving);
                Truth::Apart { placement }
            }
            Relation::DifferentBuildings => Truth::Apart { placement: None },
        };
        let [a, b] = [self.worlds[0].id(), self.worlds[1].id()];
        Ok(Some(MapPair {
            building: if a == b { a } else { format!("{a}|{b}") },
            fixed,
            moving,
            truth,
            tags,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(relation: Relation, kind: WorldKind) -> PairRequest {
        PairRequest {
            seed: 3,
            relation,
            kind,
            worlds: 4,
            number: 1,
        }
    }

    #[test]
    fn matching_maps_agree_under_the_truth_and_overlap_as_told() {
        for kind in [WorldKind::Office, WorldKind::Angled, WorldKind::Flat] {
            let pair = generate_pair(&request(Relation::Matching, kind)).expect("a pair");
            let Truth::Match {
                pose_fixed_moving,
                common,
            } = pair.truth
            else {
                panic!("{kind} is not labelled as a match")
            };
            assert!((0.1..=0.92).contains(&common.overlap), "{kind}: {common:?}");
            assert!(common.agreement > 0.6, "{kind}: {common:?}");
            // the label is symmetric
            let inverse = compare(&pair.moving, &pair.fixed, pose_fixed_moving.inverse());
            assert!(
                (inverse.overlap - common.overlap).abs() < 0.05,
                "{kind}: {inverse:?} {common:?}"
            );
            // and it is a truth: aside of it the maps agree less
            let aside = Pose2::new(
                pose_fixed_moving.x() + 0.4,
                pose_fixed_moving.y() + 0.4,
                pose_fixed_moving.yaw(),
            );
            assert!(
                compare(&pair.fixed, &pair.moving, aside).agreement < common.agreement,
                "{kind}"
            );
        }
    }

    #[test]
    fn two_places_of_a_building_have_no_area_and_no_wall_in_common() {
        for kind in [WorldKind::Repetitive, WorldKind::Hall] {
            let pair = generate_pair(&request(Relation::SameBuilding, kind)).expect("a pair");
            let Truth::Apart {
                placement: Some(placement),
            } = pair.truth
            else {
                panic!("{kind} is labelled as a match")
            };
            assert!(compare(&pair.fixed, &pair.moving, placement).overlap < COMMON_MOST);
            assert!(!walls_within(&pair.fixed, &pair.moving, placement, APART));
            assert!(!pair.building.contains('|'));
        }
    }

    #[test]
    fn two_buildings_are_two_and_the_same_request_gives_the_same_pair() {
        let wanted = request(Relation::DifferentBuildings, WorldKind::Blocks);
        let pair = generate_pair(&wanted).expect("a pair");
        assert_eq!(pair.truth, Truth::Apart { placement: None });
        let (a, b) = pair.building.split_once('|').expect("two worlds");
        assert_ne!(a, b);
        assert_eq!(generate_pair(&wanted), Ok(pair.clone()));
        let other = PairRequest { seed: 4, ..wanted };
        assert_ne!(generate_pair(&other), Ok(pair));
    }
}
