//! A robot's drive: what it saw from where, and where it believed to be.

use super::lidar::{Lidar, Observation};
use super::odometry::{Drift, rigid_fit};
use super::{Random, Scene, Tour};
use crate::geometry::{Point, Pose2};

/// What a robot saw on a tour.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveLog {
    /// The lidar that saw it.
    pub lidar: Lidar,
    /// One a pose of the tour.
    pub observations: Vec<Observation>,
}

impl DriveLog {
    /// Drives the tour and scans at each of its poses.
    #[must_use]
    pub fn record(scene: &Scene, tour: &Tour, lidar: Lidar, drift: Drift, random: &mut Random) -> Self {
        let believed = drift.believed(tour, random);
        let observations = tour
            .poses
            .iter()
            .zip(believed)
            .map(|(&pose_world_robot, believed)| Observation {
                pose_world_robot,
                believed,
                ranges: lidar.scan(scene, pose_world_robot, random),
            })
            .collect();
        Self { lidar, observations }
    }

    /// Where a frame that the robot believes to be at `believed` truly is, as well as a rigid pose can tell.
    #[must_use]
    pub fn true_frame(&self, believed: Pose2) -> Pose2 {
        let pairs: Vec<_> = self
            .observations
            .iter()
            .map(|o| (o.pose_world_robot, o.believed))
            .collect();
        rigid_fit(&pairs).inverse() * believed
    }
}

/// Where the beams of a scan end, in the world as the robot believes it; whether they hit something there.
pub(super) fn ends(lidar: &Lidar, observation: &Observation, clear: f64) -> impl Iterator<Item = (bool, Point)> {
    let [x, y] = observation.believed.translation();
    let yaw = observation.believed.yaw();
    let limit = clear.min(lidar.max_range());
    observation.ranges.iter().enumerate().filter_map(move |(beam, range)| {
        let (sin, cos) = (yaw + lidar.direction(beam)).sin_cos();
        let at = |range: f64| [x + range * cos, y + range * sin];
        match range {
            Some(range) => Some((true, at(*range))),
            None => (limit > 0.0).then(|| (false, at(limit))),
        }
    })
}
