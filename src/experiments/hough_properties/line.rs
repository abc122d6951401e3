//! Lines, and where a Hough image has them.

use crate::experiments::figure::Panel;
use crate::geometry::{Angle, Point, Pose2};
use crate::registration::methods::hough_peaks::{HoughView, PeakView};
/// A line about the frame's origin, in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub(super) theta: Angle,
    pub(super) rho: f64,
}

impl Line {
    pub(super) fn of(peak: &PeakView, center: Point) -> Self {
        let (sin, cos) = peak.theta.sin_cos();
        Self {
            theta: peak.theta,
            rho: peak.rho + center[0] * cos + center[1] * sin,
        }
    }

    /// Eq. 2 and 3.
    pub(super) fn moved(self, motion: Pose2) -> Self {
        let theta = self.theta + motion.yaw();
        let (sin, cos) = theta.sin_cos();
        Self {
            theta,
            rho: self.rho + motion.x() * cos + motion.y() * sin,
        }
    }

    /// Where a peak of H stands in H' by the formula that is displayed below eq. 3.
    pub(super) fn moved_as_displayed(self, motion: Pose2) -> Self {
        let (sin, cos) = self.theta.sin_cos();
        Self {
            theta: self.theta - motion.yaw(),
            rho: self.rho - motion.x() * cos - motion.y() * sin,
        }
    }

    /// Its place in an image: a direction in [-90, 90) degrees, and the distance from the image's centre.
    pub(super) fn in_view(self, view: &HoughView) -> (f64, f64) {
        let (sin, cos) = self.theta.sin_cos();
        let rho = self.rho - view.center[0] * cos - view.center[1] * sin;
        let degrees = self.theta.degrees();
        if degrees >= 90.0 {
            (degrees - 180.0, -rho)
        } else if degrees < -90.0 {
            (degrees + 180.0, -rho)
        } else {
            (degrees, rho)
        }
    }

    /// The most votes within a degree and two cells of its place.
    pub(super) fn votes_in(self, view: &HoughView) -> f64 {
        let (degrees, rho) = self.in_view(view);
        let mut most = 0;
        for column in 0..view.columns() {
            let there = HoughView::theta_of(column).degrees();
            let apart = (there - degrees).abs();
            // over the seam the same lines have their rho negated
            let rho = if apart > 90.0 { -rho } else { rho };
            if apart.min(180.0 - apart) <= 1.0 {
                let near = (0..view.bins()).filter(|bin| (view.rho_of(*bin) - rho).abs() <= 2.0);
                most = near.map(|bin| view.column(column)[bin]).fold(most, u32::max);
            }
        }
        f64::from(most)
    }

    /// Its piece within a rectangle, in the rectangle's units; nothing when it misses it. `scale` is cells to those units.
    pub(super) fn within(self, panel: &Panel, scale: f64) -> Vec<[f64; 2]> {
        let (sin, cos) = self.theta.sin_cos();
        let foot = [self.rho * cos * scale, self.rho * sin * scale];
        let along = [-sin, cos];
        let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
        for (k, axis) in [&panel.x, &panel.y].into_iter().enumerate() {
            if along[k].abs() < 1e-9 {
                continue;
            }
            let ends = [axis.low, axis.high].map(|end| (end - foot[k]) / along[k]);
            from = from.max(ends[0].min(ends[1]));
            to = to.min(ends[0].max(ends[1]));
        }
        if from >= to {
            return Vec::new();
        }
        [from, to]
            .map(|s| [foot[0] + s * along[0], foot[1] + s * along[1]])
            .to_vec()
    }
}
