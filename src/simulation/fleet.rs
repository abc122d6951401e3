//! Fleets: many robots in one building, each overlapping an earlier one, with their poses; and robots of another one.
//!
//! Method: each robot after the first starts on the way of an earlier one and drives tours that are tried out with a
//! coarse preview until what it sees overlaps the earlier one's as wished. Maps are drawn as the tour goes on, so that
//! a fleet may be one map a robot, or a sequence of growing ones.

use super::explore::{Robot, explore, frame_near};
use super::preview::Preview;
use super::recipe::Recipe;
use super::tour::{Planner, Region};
use super::{Random, Scene, SimulationError, Tour, World, WorldKind};
use crate::geometry::{Point, Pose2};
use crate::grid::OccupancyGrid;

/// Which fleet is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FleetRequest {
    /// Seed of everything.
    pub seed: u64,
    /// Kind of the building.
    pub kind: WorldKind,
    /// Number of the fleet among those of its kind: each is in a building of its own.
    pub number: u64,
    /// Robots in the building, at least 1.
    pub robots: usize,
    /// Robots in another building of the same kind.
    pub strangers: usize,
    /// Maps of each robot as it goes on, at least 1.
    pub snapshots: usize,
}

/// A robot's maps, and where their frame is.
#[derive(Debug, Clone, PartialEq)]
pub struct FleetRobot {
    /// Pose of the frame of its maps in the world; `None` for a robot of another building.
    pub pose_world_map: Option<Pose2>,
    /// Its maps in one frame, the last one of its whole tour.
    pub maps: Vec<OccupancyGrid>,
}

/// Robots and their maps, in no order.
#[derive(Debug, Clone, PartialEq)]
pub struct Fleet {
    /// The world, or both as `a|b`.
    pub building: String,
    /// The robots.
    pub robots: Vec<FleetRobot>,
    /// What is out of the ordinary about them.
    pub tags: Vec<&'static str>,
}

/// Makes the fleet; the same request gives the same bytes.
///
/// # Errors
/// When there is nowhere to drive, or no tour overlaps an earlier one.
pub fn generate_fleet(request: &FleetRequest) -> Result<Fleet, SimulationError> {
    let mut random = Random::new(request.seed, &[2, request.kind as u64, request.number]);
    let recipe = Recipe::draw(request.kind, &mut random)?;
    let world = |number: u64| World::generate(request.kind, request.seed.wrapping_mul(1000) + number);
    let (home, other) = (world(request.number), world(request.number + 500));
    let mut robots = Vec::new();
    let visits: &[(&World, usize)] = &[(&home, request.robots), (&other, request.strangers)];
    for (place, &(world, count)) in visits.iter().enumerate() {
        if count == 0 {
            continue;
        }
        let mut party = Party::new(world, &recipe)?;
        for _ in 0..count {
            let tour = party.next_tour(&mut random).ok_or_else(|| SimulationError::NoFleet {
                world: world.id(),
                robots: count,
                tours: party.tours.len(),
            })?;
            let (pose_world_map, maps) = party.drive(&tour, request.snapshots, &mut random)?;
            let pose_world_map = (place == 0).then_some(pose_world_map);
            robots.push(FleetRobot { pose_world_map, maps });
        }
    }
    random.shuffle(&mut robots);
    Ok(Fleet {
        building: if request.strangers == 0 {
            home.id()
        } else {
            format!("{}|{}", home.id(), other.id())
        },
        robots,
        tags: recipe.tags,
    })
}

/// The robots of one building.
struct Party<'a> {
    world: &'a World,
    recipe: &'a Recipe,
    scene: Scene,
    planner: Planner,
    everywhere: Region,
    tours: Vec<(Tour, Preview)>,
}

impl<'a> Party<'a> {
    fn new(world: &'a World, recipe: &'a Recipe) -> Result<Self, SimulationError> {
        let scene = world.scene();
        let planner = Planner::new(&scene, 0.25);
        Ok(Self {
            world,
            recipe,
            everywhere: planner.region(world.entrance(), f64::INFINITY)?,
            scene,
            planner,
            tours: Vec::new(),
        })
    }

    /// The tour that overlaps an earlier one most nearly as wished.
    fn next_tour(&mut self, random: &mut Random) -> Option<Tour> {
        const TRIES: usize = 24;
        const LEAST: f64 = 0.2;
        const NEAR_ENOUGH: f64 = 0.05;
        let lattice = Preview::lattice(&self.scene);
        let wish = random.uniform(0.3, 0.55);
        let mut best: Option<(f64, Tour, Preview)> = None;
        for _ in 0..TRIES {
            let Some(tour) = self.a_tour(random) else { continue };
            let seen = Preview::of(&self.scene, lattice, &tour, &self.recipe.lidar);
            let overlaps = self.tours.iter().map(|(_, earlier)| earlier.overlap(&seen));
            let overlap = overlaps.fold(0.0, f64::max);
            if !self.tours.is_empty() && overlap < LEAST {
                continue;
            }
            let off = if self.tours.is_empty() {
                0.0
            } else {
                (overlap - wish).abs()
            };
            if best.as_ref().is_none_or(|(before, ..)| off < *before) {
                best = Some((off, tour, seen));
            }
            if off < NEAR_ENOUGH {
                break;
            }
        }
        let (_, tour, seen) = best?;
        self.tours.push((tour.clone(), seen));
        Some(tour)
    }

    /// A tour from anywhere, or from some way off a point of an earlier one.
    fn a_tour(&self, random: &mut Random) -> Option<Tour> {
        let [low, high] = self.recipe.reach;
        let reach = random.uniform(low, high);
        let start: Point = if self.tours.is_empty() {
            self.planner.point_at(&self.everywhere, 0.0, f64::INFINITY, random)?
        } else {
            let (earlier, _) = &self.tours[random.below(self.tours.len())];
            let from = earlier.poses[random.below(earlier.poses.len())].translation();
            let around = self.planner.region(from, 1.5 * reach).ok()?;
            self.planner.point_at(&around, 0.0, f64::INFINITY, random)?
        };
        let region = self.planner.region(start, reach).ok()?;
        let tour = (self.planner).tour(&region, reach * random.uniform(2.0, 5.0), self.recipe.spacing, random);
        (tour.poses.len() >= 5).then_some(tour)
    }

    /// Where the frame of the maps is, and the maps.
    fn drive(
        &self,
        tour: &Tour,
        snapshots: usize,
        random: &mut Random,
    ) -> Result<(Pose2, Vec<OccupancyGrid>), SimulationError> {
        let robot = Robot {
            lidar: self.recipe.lidar,
            mapper: self.recipe.mappers[random.below(2)],
            drift: self.recipe.drift,
        };
        let visit = 1 + random.below(1 << 30) as u64;
        let scene = if self.recipe.moved_share > 0.0 {
            &self.world.scene_at_visit(visit, self.recipe.moved_share)
        } else {
            &self.scene
        };
        let frame = frame_near(tour, random);
        let drive = explore(scene, tour, &robot, frame, snapshots, visit)?;
        let maps = drive.snapshots.into_iter().map(|snapshot| snapshot.grid);
        Ok((drive.pose_world_map, maps.collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::compare::compare;
    use super::*;

    const REQUEST: FleetRequest = FleetRequest {
        seed: 3,
        kind: WorldKind::Office,
        number: 1,
        robots: 3,
        strangers: 1,
        snapshots: 2,
    };

    #[test]
    fn each_robot_overlaps_another_as_its_pose_says_and_strangers_have_none() {
        let fleet = generate_fleet(&REQUEST).expect("a fleet");
        assert_eq!(fleet, generate_fleet(&REQUEST).expect("the same fleet"));
        assert!(fleet.building.contains('|') && fleet.robots.len() == 4);
        let known: Vec<_> = fleet
            .robots
            .iter()
            .filter_map(|robot| Some((robot.pose_world_map?, &robot.maps)))
            .collect();
        assert_eq!(known.len(), 3);
        for (a, (pose_a, maps_a)) in known.iter().enumerate() {
            let best = (0..3).filter(|&b| b != a).map(|b| {
                let (pose_b, maps_b) = &known[b];
                compare(&maps_a[1], &maps_b[1], pose_a.inverse() * *pose_b)
            });
            let best = best.max_by(|x, y| x.overlap.total_cmp(&y.overlap)).expect("two others");
            assert!(best.overlap > 0.12 && best.agreement > 0.5, "{best:?}");
            let grown = compare(&maps_a[1], &maps_a[0], Pose2::IDENTITY);
            assert!(grown.overlap > 0.95, "one frame: {grown:?}");
        }
    }

    #[test]
    fn a_campus_has_fleets_too() {
        let request = FleetRequest {
            kind: WorldKind::Campus,
            robots: 2,
            strangers: 0,
            snapshots: 1,
            ..REQUEST
        };
        let fleet = generate_fleet(&request).expect("a fleet");
        assert_eq!((fleet.robots.len(), fleet.building.as_str()), (2, "campus-3001"));
    }
}
