//! Where a robot believes to be: slow drift of its heading, and the position error that follows from it.
//!
//! Convention: beliefs are told in the world's frame, as if the robot had started out right.
//! Method: the heading error is a sum of two sines of the driven length. (1) Each believed step is the true step,
//! rotated by the error. (2) The position error is kept below a limit, as a mapper with local loop closures does.
//! (3) A bent map has no exact rigid pose; its truth is the least-squares rigid motion D with D true = believed over
//! all scans, each standing for its position and for two points 4 m ahead of and beside it, so that headings count.

use super::numbers::real;
use super::shape::{norm, sub};
use super::{Random, Tour};
use crate::geometry::{Angle, Point, Pose2};

/// How a robot's belief of its pose goes astray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drift {
    /// Greatest heading error in radians.
    pub heading: f64,
    /// Greatest position error in metres.
    pub position: f64,
    /// Standard deviation of the error of each single pose in metres, on each axis.
    pub jitter: f64,
}

/// Radius at which heading errors are weighed against position errors, in metres.
const LEVER: f64 = 4.0;

impl Drift {
    /// The poses that the robot believes in.
    #[must_use]
    pub fn believed(&self, tour: &Tour, random: &mut Random) -> Vec<Pose2> {
        let waves = [random.uniform(12.0, 25.0), random.uniform(25.0, 60.0)];
        let phases = [random.uniform(0.0, 6.3), random.uniform(0.0, 6.3)];
        let heading = |driven: f64| {
            let wave = |k: usize| (std::f64::consts::TAU * driven / waves[k] + phases[k]).sin();
            self.heading * (wave(0) + wave(1)) / 2.0
        };
        let mut driven = 0.0;
        let mut error: Point = [0.0, 0.0];
        let mut last = tour.poses.first().copied().unwrap_or(Pose2::IDENTITY);
        tour.poses
            .iter()
            .map(|&pose| {
                let step = sub(pose.translation(), last.translation());
                last = pose;
                driven += norm(step);
                let turned = Pose2::new(0.0, 0.0, Angle::from_radians(heading(driven))).apply(step);
                error = [error[0] + turned[0] - step[0], error[1] + turned[1] - step[1]];
                if norm(error) > self.position {
                    let keep = self.position / norm(error);
                    error = error.map(|e| e * keep);
                }
                Pose2::new(
                    pose.x() + error[0] + random.normal(self.jitter),
                    pose.y() + error[1] + random.normal(self.jitter),
                    pose.yaw() + Angle::from_radians(heading(driven) + random.normal(self.jitter / LEVER)),
                )
            })
            .collect()
    }
}

/// The rigid motion D that takes true poses nearest to believed ones; the identity when there are none.
#[must_use]
pub(super) fn rigid_fit(pairs: &[(Pose2, Pose2)]) -> Pose2 {
    if pairs.is_empty() {
        return Pose2::IDENTITY;
    }
    let marks = |pose: Pose2| [[0.0, 0.0], [LEVER, 0.0], [0.0, LEVER]].map(|p| pose.apply(p));
    let points: Vec<(Point, Point)> = pairs
        .iter()
        .flat_map(|&(a, b)| marks(a).into_iter().zip(marks(b)))
        .collect();
    let n = real(points.len());
    let mean = |of: &dyn Fn(&(Point, Point)) -> Point| {
        let sum = points
            .iter()
            .map(of)
            .fold([0.0, 0.0], |s, p| [s[0] + p[0], s[1] + p[1]]);
        [sum[0] / n, sum[1] / n]
    };
    let (from, to) = (mean(&|p| p.0), mean(&|p| p.1));
    let (mut dot, mut cross) = (0.0, 0.0);
    for &(a, b) in &points {
        let (a, b) = (sub(a, from), sub(b, to));
        dot += a[0] * b[0] + a[1] * b[1];
        cross += a[0] * b[1] - a[1] * b[0];
    }
    let turn = Pose2::new(0.0, 0.0, Angle::from_radians(cross.atan2(dot)));
    let [x, y] = sub(to, turn.apply(from));
    Pose2::new(x, y, turn.yaw())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn straight() -> Tour {
        Tour {
            poses: (0..100)
                .map(|k| Pose2::new(0.3 * f64::from(k), 2.0, Angle::ZERO))
                .collect(),
        }
    }

    #[test]
    fn without_drift_a_robot_knows_where_it_is() {
        assert_eq!(
            Drift::default().believed(&straight(), &mut Random::new(3, &[])),
            straight().poses
        );
    }

    #[test]
    fn drift_stays_within_its_limits_but_is_there() {
        let drift = Drift {
            heading: 0.02,
            position: 0.2,
            jitter: 0.0,
        };
        let believed = drift.believed(&straight(), &mut Random::new(3, &[]));
        let error = |k: usize| norm(sub(believed[k].translation(), straight().poses[k].translation()));
        let greatest = (0..100).map(error).fold(0.0, f64::max);
        assert!(greatest > 0.02 && greatest <= 0.2 + 1e-9, "{greatest}");
    }

    #[test]
    fn the_rigid_fit_finds_a_rigid_motion() {
        let motion = Pose2::new(3.0, -1.0, Angle::from_radians(2.0));
        let pairs: Vec<_> = straight().poses.iter().map(|&p| (p, motion * p)).collect();
        let fit = rigid_fit(&pairs);
        assert!((fit.x() - 3.0).abs() < 1e-9 && (fit.y() + 1.0).abs() < 1e-9);
        assert!((fit.yaw() - motion.yaw()).magnitude() < 1e-12);
    }
}
