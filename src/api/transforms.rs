//! Poses as ROS tells them: `tf2_msgs/TFMessage` as JSON.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The transforms of one version: `tf2_msgs/TFMessage`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Transforms {
    /// One for each placed robot, ordered by robot.
    pub transforms: Vec<TransformStamped>,
}

/// The pose of a robot's map frame in the session frame: `geometry_msgs/TransformStamped`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TransformStamped {
    /// When and in which frame.
    pub header: TransformHeader,
    /// The robot's map frame: `ROBOT/map`.
    pub child_frame_id: String,
    /// Its pose in the header's frame.
    pub transform: Transform,
}

/// `std_msgs/Header`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct TransformHeader {
    /// When the version was published.
    pub stamp: Stamp,
    /// The session frame: the anchor robot's map frame.
    pub frame_id: String,
}

/// `builtin_interfaces/Time`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Stamp {
    /// Seconds since 1970.
    pub sec: i64,
    /// Nanoseconds.
    pub nanosec: u32,
}

/// `geometry_msgs/Transform`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Transform {
    /// Metres.
    pub translation: Vector3,
    /// A unit quaternion.
    pub rotation: Rotation,
}

/// `geometry_msgs/Vector3`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Vector3 {
    /// Metres along x.
    pub x: f64,
    /// Metres along y.
    pub y: f64,
    /// Metres along z: 0.
    pub z: f64,
}

/// `geometry_msgs/Quaternion`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Rotation {
    /// 0.
    pub x: f64,
    /// 0.
    pub y: f64,
    /// Sine of half the yaw.
    pub z: f64,
    /// Cosine of half the yaw.
    pub w: f64,
}

impl Transform {
    /// The transform of a planar pose.
    #[must_use]
    pub fn of_pose(pose: super::Pose) -> Self {
        let (z, w) = (pose.yaw / 2.0).sin_cos();
        Self {
            translation: Vector3 {
                x: pose.x,
                y: pose.y,
                z: 0.0,
            },
            rotation: Rotation { x: 0.0, y: 0.0, z, w },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_is_the_quaternion_of_a_quarter_turn_about_z() {
        let transform = Transform::of_pose(super::super::Pose {
            x: 1.0,
            y: 2.0,
            yaw: std::f64::consts::FRAC_PI_2,
        });
        let half = std::f64::consts::FRAC_1_SQRT_2;
        assert!((transform.rotation.z - half).abs() < 1e-12 && (transform.rotation.w - half).abs() < 1e-12);
    }
}
