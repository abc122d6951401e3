//! Robots that explore: growing maps in a frame of their own, as the demo shows them.

use super::compare::compare;
use super::drive::DriveLog;
use super::lidar::Lidar;
use super::mapper::{Mapper, MapperParams};
use super::numbers::real;
use super::odometry::Drift;
use super::shape::distance;
use super::tour::Planner;
use super::{Random, Scene, SimulationError, Tour, World, WorldKind, buildings};
use crate::geometry::{Angle, Point, Pose2};
use crate::grid::OccupancyGrid;

/// What a robot is equipped with.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Robot {
    /// Its lidar.
    pub lidar: Lidar,
    /// How it draws its map.
    pub mapper: MapperParams,
    /// How its belief of where it is goes astray.
    pub drift: Drift,
}

/// A robot's map at one moment. All snapshots of a robot share one frame; the lattice's origin moves as the map grows.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// The map so far.
    pub grid: OccupancyGrid,
    /// Where the robot believes to be, in its map's frame.
    pub pose_map_robot: Pose2,
    /// Scans so far.
    pub scans: usize,
    /// Metres driven so far.
    pub driven: f64,
}

/// A whole exploration and its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Exploration {
    /// True pose of the map's frame in the world: `pose_world_a.inverse() * pose_world_b` is the truth between robots.
    pub pose_world_map: Pose2,
    /// Growing maps, the last one of the whole tour.
    pub snapshots: Vec<Snapshot>,
}

/// Drives a tour and takes `pushes` snapshots of the growing map at equal distances; `frame` is the pose of the map's
/// frame in the world as the robot believes it.
///
/// # Errors
/// When the mapper's parameters are out of range or nothing was seen by the first snapshot.
pub fn explore(
    scene: &Scene,
    tour: &Tour,
    robot: &Robot,
    frame: Pose2,
    pushes: usize,
    seed: u64,
) -> Result<Exploration, SimulationError> {
    let log = DriveLog::record(scene, tour, robot.lidar, robot.drift, &mut Random::new(seed, &[0]));
    let mut mapper = Mapper::new(&log, frame, robot.mapper, seed)?;
    let mut snapshots = Vec::with_capacity(pushes);
    let mut driven = 0.0;
    let mut last: Option<Point> = None;
    for (k, observation) in log.observations.iter().enumerate() {
        mapper.integrate(&log.lidar, observation);
        let here = observation.pose_world_robot.translation();
        driven += last.replace(here).map_or(0.0, |before| distance(before, here));
        // the n-th snapshot is due when n / pushes of all scans are in
        if (k + 1) * pushes / log.observations.len() > snapshots.len() {
            snapshots.push(Snapshot {
                grid: mapper.map()?,
                pose_map_robot: frame.inverse() * observation.believed,
                scans: k + 1,
                driven,
            });
        }
    }
    Ok(Exploration {
        pose_world_map: log.true_frame(frame),
        snapshots,
    })
}

/// The building of the demo: an office of 34 m x 24 m.
#[must_use]
pub fn demo_building(seed: u64) -> World {
    let mut world = World::empty(WorldKind::Office, seed);
    buildings::demo(
        &mut Random::new(seed, &[WorldKind::Office as u64, u64::MAX]),
        &mut world,
    );
    world
}

/// Robots that explore overlapping parts of a world, each in a frame of its own, with `pushes` snapshots each.
///
/// Of some seeded attempts the one is taken in which the least connected robot's final map overlaps most with another.
///
/// # Errors
/// When there is nowhere to drive.
///
/// # Panics
/// When `robots` or `pushes` is 0.
pub fn demo_robots(
    world: &World,
    robots: usize,
    pushes: usize,
    seed: u64,
) -> Result<Vec<Exploration>, SimulationError> {
    const ATTEMPTS: u64 = 8;
    assert!(robots > 0 && pushes > 0, "invariant: a demo has robots that push maps");
    let mut best: Option<(f64, Vec<Exploration>)> = None;
    for attempt in 0..ATTEMPTS {
        let team = demo_team(world, robots, pushes, seed, attempt)?;
        let bond = weakest_bond(&team);
        if best.as_ref().is_none_or(|(before, _)| bond > *before) {
            best = Some((bond, team));
        }
        if bond > 0.35 {
            break;
        }
    }
    Ok(best.expect("invariant: there was at least one attempt").1)
}

fn demo_team(
    world: &World,
    robots: usize,
    pushes: usize,
    seed: u64,
    attempt: u64,
) -> Result<Vec<Exploration>, SimulationError> {
    let mut random = Random::new(seed, &[1, attempt]);
    let scene = world.scene();
    let planner = Planner::new(&scene, 0.25);
    let everywhere = planner.region(world.entrance(), f64::INFINITY)?;
    let mut starts: Vec<Point> = Vec::new();
    let mut team = Vec::new();
    for number in 0..robots {
        let candidates: Vec<Point> = (0..12)
            .filter_map(|_| planner.point_at(&everywhere, 0.0, f64::INFINITY, &mut random))
            .collect();
        let apart = |p: Point| starts.iter().map(|&s| distance(s, p)).fold(f64::INFINITY, f64::min);
        let start = candidates
            .into_iter()
            .max_by(|&a, &b| apart(a).total_cmp(&apart(b)))
            .unwrap_or(world.entrance());
        starts.push(start);
        let region = planner.region(start, random.uniform(20.0, 28.0))?;
        let tour = planner.tour(&region, 100.0, 0.35, &mut random);
        let robot = Robot {
            drift: Drift {
                jitter: 0.005,
                ..Drift::default()
            },
            ..Robot::default()
        };
        let frame = frame_near(&tour, &mut random);
        team.push(explore(
            &scene,
            &tour,
            &robot,
            frame,
            pushes,
            seed ^ (number as u64 + 1),
        )?);
    }
    Ok(team)
}

/// A frame as robots choose theirs: near where they start, in any direction.
pub(super) fn frame_near(tour: &Tour, random: &mut Random) -> Pose2 {
    let start = tour.poses.first().map_or([0.0, 0.0], |pose| pose.translation());
    Pose2::new(
        start[0] + random.uniform(-3.0, 3.0),
        start[1] + random.uniform(-3.0, 3.0),
        Angle::from_radians(random.uniform(-std::f64::consts::PI, std::f64::consts::PI)),
    )
}

/// The least, over the robots, of the best overlap that its final map has with another's.
fn weakest_bond(team: &[Exploration]) -> f64 {
    let overlap = |a: &Exploration, b: &Exploration| match (a.snapshots.last(), b.snapshots.last()) {
        (Some(fixed), Some(moving)) => {
            let pose_fixed_moving = a.pose_world_map.inverse() * b.pose_world_map;
            compare(&fixed.grid, &moving.grid, pose_fixed_moving).overlap
        }
        _ => 0.0,
    };
    let bonds = (0..team.len()).map(|i| {
        let others = (0..team.len()).filter(|&j| j != i);
        others.map(|j| overlap(&team[i], &team[j])).fold(0.0, f64::max)
    });
    bonds.fold(real(team.len()), f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_robots_map_overlapping_parts_of_the_demo_building() {
        let world = demo_building(7);
        let team = demo_robots(&world, 3, 4, 7).expect("a demo");
        assert_eq!(team.len(), 3);
        assert!(weakest_bond(&team) > 0.3, "{}", weakest_bond(&team));
        for robot in &team {
            assert_eq!(robot.snapshots.len(), 4);
            for pair in robot.snapshots.windows(2) {
                assert!(pair[0].grid.known_area() < pair[1].grid.known_area());
                assert!(pair[0].driven < pair[1].driven && pair[0].scans < pair[1].scans);
            }
            // one frame: an earlier snapshot lies within a later one as it is
            let compared = compare(&robot.snapshots[3].grid, &robot.snapshots[0].grid, Pose2::IDENTITY);
            assert!(compared.overlap > 0.99 && compared.agreement > 0.9, "{compared:?}");
        }
        let truth = team[0].pose_world_map.inverse() * team[1].pose_world_map;
        let last = |k: usize| &team[k].snapshots[3].grid;
        assert!(compare(last(0), last(1), truth).agreement > 0.8);
        assert_eq!(
            demo_robots(&world, 3, 4, 7).expect("a demo"),
            team,
            "the same seed, the same demo"
        );
    }
}
