//! The places of the experiments, and the maps that robots bring from them.

mod basement;
mod building;
mod clutter;
mod ring;
mod yard;

pub(super) use basement::two_robots;
pub(super) use building::two_maps;
pub(super) use clutter::{cluttered_map, cut, distorted, similarity};
pub(super) use ring::three_robots;
pub(super) use yard::four_robots;

use super::numbers::real;
use crate::geometry::{Angle, Point, Pose2};
use crate::grid::OccupancyGrid;
use crate::simulation::{Drift, Lidar, Robot, Scene, SimulationError, Tour, explore};

/// A map that a robot has brought, with its truth.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mapped {
    /// What the robot is called.
    pub(super) name: &'static str,
    /// Its map.
    pub(super) map: OccupancyGrid,
    /// True pose of the map's frame in the world.
    pub(super) pose_world_map: Pose2,
    /// Metres driven.
    pub(super) driven_m: f64,
    /// Where it drove, in the world.
    pub(super) path: Vec<Point>,
}

impl Mapped {
    /// Drives the tour and draws the map in `frame`, a pose in the world.
    fn of_tour(
        name: &'static str,
        scene: &Scene,
        tour: &Tour,
        lidar: Lidar,
        frame: Pose2,
        seed: u64,
    ) -> Result<Self, SimulationError> {
        let robot = Robot {
            lidar,
            drift: Drift {
                jitter: 0.005,
                ..Drift::default()
            },
            ..Robot::default()
        };
        let exploration = explore(scene, tour, &robot, frame, 1, seed)?;
        let pose_world_map = exploration.pose_world_map;
        let last = exploration
            .snapshots
            .into_iter()
            .next_back()
            .ok_or(SimulationError::NothingSeen)?;
        Ok(Self {
            name,
            map: last.grid,
            pose_world_map,
            driven_m: last.driven,
            path: tour.poses.iter().map(|pose| pose.translation()).collect(),
        })
    }

    /// True pose of another map's frame in this one's.
    pub(super) fn pose_of(&self, other: &Self) -> Pose2 {
        self.pose_world_map.inverse() * other.pose_world_map
    }
}

/// A tour along straight legs, a pose every 0.3 m, looking ahead.
fn along(corners: &[Point]) -> Tour {
    const SPACING: f64 = 0.3;
    let mut poses = Vec::new();
    let mut left = 0.0;
    for leg in corners.windows(2) {
        let (dx, dy) = (leg[1][0] - leg[0][0], leg[1][1] - leg[0][1]);
        let length = dx.hypot(dy);
        let yaw = Angle::from_radians(dy.atan2(dx));
        let mut at = left;
        while at < length {
            let share = at / length;
            poses.push(Pose2::new(leg[0][0] + share * dx, leg[0][1] + share * dy, yaw));
            at += SPACING;
        }
        left = at - length;
    }
    Tour { poses }
}

/// Frames of robots that have the same origin but for some cells, each with its own yaw: what the paper's method needs.
fn frame_at([x, y]: Point, [dx, dy]: Point, yaw_degrees: f64) -> Pose2 {
    Pose2::new(x + dx, y + dy, Angle::from_degrees(yaw_degrees))
}

/// The mean of points.
fn middle(points: &[Point]) -> Point {
    let n = real(points.len().max(1));
    let sum = points.iter().fold([0.0, 0.0], |s, p| [s[0] + p[0], s[1] + p[1]]);
    [sum[0] / n, sum[1] / n]
}
