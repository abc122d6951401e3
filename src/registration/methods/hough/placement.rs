//! Where the moving map lies on the fixed one while hypotheses are searched: a pose between the two maps' LOCAL frames.
//!
//! Convention: a local frame has the axes of its map's lattice and its origin in the middle of the map's occupied
//! cells, so that coordinates are small and single precision is enough wherever the map's own frame may be.

use super::num::narrow;
use crate::geometry::{Angle, Pose2};

/// `p_fixed = R(yaw) p_moving + (x, y)`, metres and radians, between local frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) yaw: f64,
}

/// A placement with sine and cosine at hand, in single precision.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rigid {
    pub(super) x: f32,
    pub(super) y: f32,
    pub(super) sin: f32,
    pub(super) cos: f32,
}

/// A placement with sine and cosine at hand, in double precision.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turned {
    x: f64,
    y: f64,
    sin: f64,
    cos: f64,
}

/// The first and second moments of a map's wall samples, in its local frame.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    pub(super) mean: [f64; 2],
    pub(super) mean_square: f64,
}

impl Placement {
    pub(super) fn rigid(self) -> Rigid {
        let (sin, cos) = self.yaw.sin_cos();
        Rigid {
            x: narrow(self.x),
            y: narrow(self.y),
            sin: narrow(sin),
            cos: narrow(cos),
        }
    }

    /// The pose between the maps' own frames: `pose_map_fixed_local * placement * pose_map_moving_local^-1`.
    pub(super) fn between_maps(self, fixed_frame: Pose2, moving_frame: Pose2) -> Pose2 {
        fixed_frame * self.pose() * moving_frame.inverse()
    }

    /// Back from a pose between the maps' own frames.
    pub(super) fn of_maps(pose: Pose2, fixed_frame: Pose2, moving_frame: Pose2) -> Self {
        let local = fixed_frame.inverse() * pose * moving_frame;
        Self {
            x: local.x(),
            y: local.y(),
            yaw: local.yaw().radians(),
        }
    }

    pub(super) fn pose(self) -> Pose2 {
        Pose2::new(self.x, self.y, Angle::from_radians(self.yaw))
    }

    /// RMS distance in metres between the moving map's walls under two placements.
    pub(super) fn distance(self, other: Self, moving: Moments) -> f64 {
        self.turned().distance(other.turned(), moving)
    }

    /// With sine and cosine at hand, for many distances.
    pub(super) fn turned(self) -> Turned {
        let (sin, cos) = self.yaw.sin_cos();
        let Self { x, y, .. } = self;
        Turned { x, y, sin, cos }
    }
}

impl Turned {
    /// See [`Placement::distance`].
    pub(super) fn distance(self, other: Self, moving: Moments) -> f64 {
        let (dx, dy) = (self.x - other.x, self.y - other.y);
        let (c, s) = (self.cos - other.cos, self.sin - other.sin);
        let [mx, my] = moving.mean;
        let square = (c * c + s * s) * moving.mean_square
            + 2.0 * (dx * (c * mx - s * my) + dy * (s * mx + c * my))
            + dx * dx
            + dy * dy;
        square.max(0.0).sqrt()
    }
}

impl Rigid {
    pub(super) const IDENTITY: Self = Self {
        x: 0.0,
        y: 0.0,
        sin: 0.0,
        cos: 1.0,
    };

    #[inline]
    pub(super) fn apply(self, x: f32, y: f32) -> (f32, f32) {
        let (x, y) = self.rotate(x, y);
        (x + self.x, y + self.y)
    }

    #[inline]
    pub(super) fn rotate(self, x: f32, y: f32) -> (f32, f32) {
        (self.cos * x - self.sin * y, self.sin * x + self.cos * y)
    }

    pub(super) fn inverse(self) -> Self {
        Self {
            x: -(self.cos * self.x + self.sin * self.y),
            y: self.sin * self.x - self.cos * self.y,
            sin: -self.sin,
            cos: self.cos,
        }
    }
}
