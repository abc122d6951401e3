//! A pose as it is written down.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::geometry::Pose2;

/// A pose in the plane: metres and radians, x right, y up, counter-clockwise (REP 103).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(example = json!({ "x": 12.5, "y": -3.25, "yaw": 0.785 }))]
pub struct Pose {
    /// Metres along x.
    pub x: f64,
    /// Metres along y.
    pub y: f64,
    /// Radians, in (-pi, pi].
    pub yaw: f64,
}

impl From<Pose2> for Pose {
    fn from(pose: Pose2) -> Self {
        Self {
            x: pose.x(),
            y: pose.y(),
            yaw: pose.yaw().radians(),
        }
    }
}

impl Pose {
    /// The pose to compute with; `None` unless its numbers are finite.
    #[must_use]
    pub fn to_pose2(self) -> Option<Pose2> {
        Pose2::parse(self.x, self.y, self.yaw)
    }
}
