//! The normalised angle: the only place of the crate that knows degrees.

use std::f64::consts::{PI, TAU};
use std::ops::{Add, Neg, Sub};

use serde::{Deserialize, Serialize};

/// An angle in radians, counter-clockwise.
///
/// Invariant: always finite and in (-pi, pi]. Serialised as its radians.
///
/// ```
/// use mapweld::geometry::Angle;
/// assert_eq!(Angle::from_radians(-std::f64::consts::PI), Angle::HALF_TURN);
/// assert!((Angle::from_degrees(350.0) - Angle::from_degrees(-20.0)).degrees() - 10.0 < 1e-9);
/// assert!(Angle::parse(f64::NAN).is_none());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Angle(f64);

impl Angle {
    /// No rotation.
    pub const ZERO: Self = Self(0.0);
    /// pi, the one of the two names of the half turn that the range holds.
    pub const HALF_TURN: Self = Self(PI);
    /// A quarter turn counter-clockwise.
    pub const QUARTER_TURN: Self = Self(PI / 2.0);

    /// The angle of `radians`, wrapped into (-pi, pi]; `None` unless finite.
    #[must_use]
    pub fn parse(radians: f64) -> Option<Self> {
        radians.is_finite().then(|| Self(wrap(radians)))
    }

    /// The angle of `radians`, wrapped into (-pi, pi].
    ///
    /// # Panics
    /// When `radians` is not finite: use [`Angle::parse`] for values from outside.
    #[must_use]
    pub fn from_radians(radians: f64) -> Self {
        Self::parse(radians).expect("invariant: computed angles are finite")
    }

    /// The angle of `degrees`, wrapped; panics as [`Angle::from_radians`] does.
    #[must_use]
    pub fn from_degrees(degrees: f64) -> Self {
        Self::from_radians(degrees.to_radians())
    }

    /// Radians in (-pi, pi].
    #[must_use]
    pub fn radians(self) -> f64 {
        self.0
    }

    /// Degrees in (-180, 180]: for people's eyes only.
    #[must_use]
    pub fn degrees(self) -> f64 {
        self.0.to_degrees()
    }

    /// `(sin, cos)`.
    #[must_use]
    pub fn sin_cos(self) -> (f64, f64) {
        self.0.sin_cos()
    }

    /// The size of the rotation, in [0, pi] radians.
    #[must_use]
    pub fn magnitude(self) -> f64 {
        self.0.abs()
    }
}

fn wrap(radians: f64) -> f64 {
    if radians > -PI && radians <= PI {
        return radians; // exact for what is already in range: no rounding by the modulus
    }
    let wrapped = PI - (PI - radians).rem_euclid(TAU);
    if wrapped <= -PI { PI } else { wrapped }
}

impl Add for Angle {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(wrap(self.0 + other.0))
    }
}

impl Sub for Angle {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(wrap(self.0 - other.0))
    }
}

impl Neg for Angle {
    type Output = Self;
    fn neg(self) -> Self {
        Self(wrap(-self.0))
    }
}

impl From<Angle> for f64 {
    fn from(angle: Angle) -> Self {
        angle.0
    }
}

impl TryFrom<f64> for Angle {
    type Error = String;
    fn try_from(radians: f64) -> Result<Self, String> {
        Self::parse(radians).ok_or_else(|| format!("angle {radians} rad is not finite"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_finite_angle_is_wrapped_into_the_half_open_range(radians in -1e6..1e6_f64) {
            let angle = Angle::from_radians(radians);
            prop_assert!(angle.radians() > -PI && angle.radians() <= PI);
            prop_assert!((angle.radians().sin() - radians.sin()).abs() < 1e-8);
            prop_assert!((angle.radians().cos() - radians.cos()).abs() < 1e-8);
        }

        #[test]
        fn adding_and_subtracting_an_angle_changes_nothing(a in -PI..PI, b in -PI..PI) {
            let (a, b) = (Angle::from_radians(a), Angle::from_radians(b));
            prop_assert!((a + b - b - a).magnitude() < 1e-12);
        }
    }

    #[test]
    fn the_half_turn_has_one_name() {
        assert_eq!(Angle::from_radians(-PI), Angle::HALF_TURN);
        assert_eq!(-Angle::HALF_TURN, Angle::HALF_TURN);
        assert_eq!(Angle::from_radians(3.0 * PI), Angle::HALF_TURN);
    }

    #[test]
    fn angles_that_are_not_finite_are_refused() {
        assert_eq!(Angle::parse(f64::INFINITY), None);
        assert!(serde_json::from_str::<Angle>("null").is_err());
    }
}
