//! A planar lidar.

use super::numbers::real;
use super::{Random, Scene, SimulationError, within};
use crate::geometry::{Angle, Pose2};

/// A planar lidar: equally spaced beams, symmetric about the robot's x axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lidar {
    beams: usize,
    field_of_view: f64,
    max_range: f64,
    noise: f64,
}

/// One scan: where the robot truly was, and what it measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// True pose of the robot in the world.
    pub pose_world_robot: Pose2,
    /// Where the robot believes to be; the same, or with drift.
    pub believed: Pose2,
    /// Metres by beam, from the rightmost counter-clockwise; `None` where nothing came back.
    pub ranges: Vec<Option<f64>>,
}

impl Lidar {
    /// A lidar of `beams` (1 to 100 000) over `field_of_view` radians (at most 2 pi) that sees up to `max_range` metres
    /// (0.1 to 1000), each range with normal noise of standard deviation `noise` metres (at most 1).
    ///
    /// # Errors
    /// [`SimulationError::OutOfRange`] names the value and the limits.
    pub fn new(beams: usize, field_of_view: f64, max_range: f64, noise: f64) -> Result<Self, SimulationError> {
        within("beams", real(beams), 1.0, 100_000.0, "")?;
        within("field of view", field_of_view, 1e-3, std::f64::consts::TAU, " rad")?;
        within("maximum range", max_range, 0.1, 1000.0, " m")?;
        within("range noise", noise, 0.0, 1.0, " m")?;
        Ok(Self {
            beams,
            field_of_view,
            max_range,
            noise,
        })
    }

    /// How many beams it has.
    #[must_use]
    pub fn beams(&self) -> usize {
        self.beams
    }

    /// Metres that it sees at most.
    #[must_use]
    pub fn max_range(&self) -> f64 {
        self.max_range
    }

    /// The same lidar with another range limit, kept within what a lidar can have.
    #[must_use]
    pub fn with_max_range(self, max_range: f64) -> Self {
        Self {
            max_range: max_range.clamp(0.1, 1000.0),
            ..self
        }
    }

    /// Direction of a beam in the robot's frame. A full turn has no two beams in the same direction.
    #[must_use]
    pub fn direction(&self, beam: usize) -> Angle {
        let full_turn = self.field_of_view >= std::f64::consts::TAU - 1e-9;
        let gaps = if full_turn { self.beams } else { self.beams.max(2) - 1 };
        Angle::from_radians(self.field_of_view * (real(beam) / real(gaps) - 0.5))
    }

    /// What the lidar measures from a pose.
    #[must_use]
    pub fn scan(&self, scene: &Scene, pose_world_robot: Pose2, random: &mut Random) -> Vec<Option<f64>> {
        (0..self.beams)
            .map(|beam| {
                let direction = pose_world_robot.yaw() + self.direction(beam);
                let range = scene.cast(pose_world_robot.translation(), direction, self.max_range);
                // noise is drawn for every beam, so that the stream does not depend on what is hit
                let noise = random.normal(self.noise);
                range.map(|range| (range + noise).clamp(0.0, self.max_range))
            })
            .collect()
    }
}

impl Default for Lidar {
    /// 361 beams over 270 degrees up to 12 m, noise 1 cm: a common indoor lidar.
    fn default() -> Self {
        Self {
            beams: 361,
            field_of_view: 1.5 * std::f64::consts::PI,
            max_range: 12.0,
            noise: 0.01,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::Shape;

    #[test]
    fn beams_spread_over_the_field_of_view() {
        let lidar = Lidar::new(3, std::f64::consts::PI, 5.0, 0.0).expect("valid");
        let points = |lidar: &Lidar, degrees: &[f64]| {
            let off = |(beam, &at): (usize, &f64)| (lidar.direction(beam) - Angle::from_degrees(at)).magnitude();
            degrees.iter().enumerate().map(off).all(|off| off < 1e-9)
        };
        assert!(points(&lidar, &[-90.0, 0.0, 90.0]));
        let turn = Lidar::new(4, std::f64::consts::TAU, 5.0, 0.0).expect("valid");
        assert!(points(&turn, &[180.0, -90.0, 0.0, 90.0]));
    }

    #[test]
    fn a_scan_tells_the_distance_to_the_walls_around() {
        let room = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
        let strokes: Vec<(Shape, bool)> = (0..4)
            .map(|k| Shape::Bar {
                from: room[k],
                to: room[(k + 1) % 4],
                thickness: 0.1,
            })
            .map(|shape| (shape, true))
            .collect();
        let scene = Scene::draw(&strokes);
        let lidar = Lidar::new(4, std::f64::consts::TAU, 5.0, 0.0).expect("valid");
        let pose = Pose2::new(1.0, 1.0, Angle::ZERO);
        let ranges = lidar.scan(&scene, pose, &mut Random::new(0, &[]));
        for (range, expected) in ranges.iter().zip([0.95, 0.95, 2.95, 1.95]) {
            assert!((range.expect("a wall") - expected).abs() < 0.03, "{ranges:?}");
        }
        let short = lidar.with_max_range(1.5).scan(&scene, pose, &mut Random::new(0, &[]));
        assert_eq!(short[2], None);
    }

    #[test]
    fn lidars_out_of_range_are_refused_with_the_limit() {
        let error = Lidar::new(10, 7.0, 5.0, 0.0).expect_err("more than a full turn");
        assert!(error.to_string().contains("field of view 7"), "{error}");
        assert!(Lidar::new(0, 3.0, 5.0, 0.0).is_err());
        assert!(Lidar::new(10, 3.0, f64::NAN, 0.0).is_err());
        assert!(Lidar::new(10, 3.0, 5.0, -0.1).is_err());
    }
}
