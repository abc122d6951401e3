//! Poses: elements of SE(2).

use std::ops::Mul;

use serde::{Deserialize, Serialize};

use super::{Angle, Point};

/// The pose of one frame in another: a rotation by `yaw`, then a translation by `(x, y)` metres (the paper's eq. 12).
///
/// Named after both frames, so that inner names cancel when composed: `pose_a_b` is the pose of frame b in frame a,
/// `p_a = pose_a_b.apply(p_b)`, and `pose_a_c = pose_a_b * pose_b_c`.
///
/// Invariant: x and y are finite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Fields", into = "Fields")]
pub struct Pose2 {
    x: f64,
    y: f64,
    yaw: Angle,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Fields {
    x: f64,
    y: f64,
    yaw: f64,
}

impl Pose2 {
    /// The pose of a frame in itself.
    pub const IDENTITY: Self = Self {
        x: 0.0,
        y: 0.0,
        yaw: Angle::ZERO,
    };

    /// A pose from metres and an angle; `None` unless all are finite.
    #[must_use]
    pub fn parse(x: f64, y: f64, yaw: f64) -> Option<Self> {
        let yaw = Angle::parse(yaw)?;
        (x.is_finite() && y.is_finite()).then_some(Self { x, y, yaw })
    }

    /// A pose from metres and an angle.
    ///
    /// # Panics
    /// When x or y is not finite: use [`Pose2::parse`] for values from outside.
    #[must_use]
    pub fn new(x: f64, y: f64, yaw: Angle) -> Self {
        assert!(x.is_finite() && y.is_finite(), "invariant: computed poses are finite");
        Self { x, y, yaw }
    }

    /// Metres along x.
    #[must_use]
    pub fn x(self) -> f64 {
        self.x
    }

    /// Metres along y.
    #[must_use]
    pub fn y(self) -> f64 {
        self.y
    }

    /// The rotation.
    #[must_use]
    pub fn yaw(self) -> Angle {
        self.yaw
    }

    /// The translation `[x, y]` in metres.
    #[must_use]
    pub fn translation(self) -> Point {
        [self.x, self.y]
    }

    /// `pose_b_a` of `pose_a_b`.
    #[must_use]
    pub fn inverse(self) -> Self {
        let (sin, cos) = self.yaw.sin_cos();
        Self {
            x: -(cos * self.x + sin * self.y),
            y: sin * self.x - cos * self.y,
            yaw: -self.yaw,
        }
    }

    /// The point of the inner frame, told in the outer one. For many points use [`Pose2::motion`].
    #[must_use]
    pub fn apply(self, point: Point) -> Point {
        self.motion().apply(point)
    }

    /// The same pose with sine and cosine at hand.
    #[must_use]
    pub fn motion(self) -> Motion {
        let (sin, cos) = self.yaw.sin_cos();
        Motion {
            x: self.x,
            y: self.y,
            sin,
            cos,
        }
    }
}

impl Mul for Pose2 {
    type Output = Self;
    #[expect(clippy::suspicious_arithmetic_impl, reason = "composing poses adds their rotations")]
    fn mul(self, inner: Self) -> Self {
        let [x, y] = self.apply([inner.x, inner.y]);
        Self {
            x,
            y,
            yaw: self.yaw + inner.yaw,
        }
    }
}

impl From<Pose2> for Fields {
    fn from(pose: Pose2) -> Self {
        Self {
            x: pose.x,
            y: pose.y,
            yaw: pose.yaw.radians(),
        }
    }
}

impl TryFrom<Fields> for Pose2 {
    type Error = String;
    fn try_from(fields: Fields) -> Result<Self, String> {
        Self::parse(fields.x, fields.y, fields.yaw)
            .ok_or_else(|| format!("pose ({}, {}, {}) is not finite", fields.x, fields.y, fields.yaw))
    }
}

/// A [`Pose2`] prepared for many points: `p_outer = R p_inner + (x, y)`.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    /// Metres along x.
    pub x: f64,
    /// Metres along y.
    pub y: f64,
    /// Sine of the yaw.
    pub sin: f64,
    /// Cosine of the yaw.
    pub cos: f64,
}

impl Motion {
    /// The point of the inner frame, told in the outer one.
    #[must_use]
    #[inline]
    pub fn apply(&self, [x, y]: Point) -> Point {
        let [x, y] = self.rotate([x, y]);
        [x + self.x, y + self.y]
    }

    /// The vector of the inner frame, told in the outer one: rotated, not translated.
    #[must_use]
    #[inline]
    pub fn rotate(&self, [x, y]: Point) -> Point {
        [self.cos * x - self.sin * y, self.sin * x + self.cos * y]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pose() -> impl Strategy<Value = Pose2> {
        (-1e3..1e3_f64, -1e3..1e3_f64, -4.0..4.0_f64).prop_map(|(x, y, yaw)| Pose2::new(x, y, Angle::from_radians(yaw)))
    }

    fn near(a: Point, b: Point) -> bool {
        (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-8
    }

    proptest! {
        #[test]
        fn a_pose_times_its_inverse_is_the_identity(pose in pose()) {
            let id = pose * pose.inverse();
            prop_assert!(near(id.translation(), [0.0, 0.0]) && id.yaw().magnitude() < 1e-12);
        }

        #[test]
        fn composing_is_applying_one_after_the_other(a in pose(), b in pose(), x in -1e2..1e2_f64, y in -1e2..1e2_f64) {
            prop_assert!(near((a * b).apply([x, y]), a.apply(b.apply([x, y]))));
        }

        #[test]
        fn a_pose_survives_json(pose in pose()) {
            let text = serde_json::to_string(&pose).expect("a pose serialises");
            let back: Pose2 = serde_json::from_str(&text).expect("a pose parses");
            prop_assert!(near(back.translation(), pose.translation()) && (back.yaw() - pose.yaw()).magnitude() < 1e-12);
        }
    }

    #[test]
    fn a_quarter_turn_takes_x_to_y() {
        let pose_a_b = Pose2::new(1.0, 2.0, Angle::QUARTER_TURN);
        assert!(near(pose_a_b.apply([3.0, 0.0]), [1.0, 5.0]));
    }

    #[test]
    fn poses_that_are_not_finite_are_refused() {
        assert_eq!(Pose2::parse(f64::NAN, 0.0, 0.0), None);
        assert!(serde_json::from_str::<Pose2>(r#"{"x":1e999,"y":0,"yaw":0}"#).is_err());
    }
}
