//! Property 3: the place and the intensity of a single wall.

use super::line::Line;
use crate::experiments::figure::{Axis, Figure, Mark, PALETTE, Panel, Series};
use crate::experiments::numbers::{real, share};
use crate::experiments::outcome::Table;
use crate::geometry::{Angle, Point};
use crate::registration::methods::hough_peaks::HoughView;
/// Property 3 on single segments.
pub(super) struct Segments {
    /// Direction of the segment in degrees, and intensity over length: points, cells in one bin, cells in three bins.
    pub(super) by_direction: Vec<(f64, [f64; 3])>,
    pub(super) placed: f64,
    pub(super) tried: usize,
    pub(super) points: [f64; 2],
    pub(super) one_bin: [f64; 2],
    pub(super) three_bins: [f64; 2],
}

impl Segments {
    pub(super) fn measure() -> Self {
        let (mut by_direction, mut placed) = (Vec::new(), Vec::new());
        for degrees in (-88..=88_i32).step_by(4) {
            let direction = f64::from(degrees);
            let slope = direction.to_radians().tan();
            let mut sums = [0.0; 3];
            let lengths = [60_u32, 120, 240];
            for (length, intercept) in lengths.into_iter().zip([-37.3, 12.6, 81.2]) {
                let unit = [direction.to_radians().cos(), direction.to_radians().sin()];
                let at = |s: f64| [s * unit[0], intercept + s * unit[1]];
                let points: Vec<Point> = (0..length).map(|s| at(f64::from(s))).collect();
                let mut cells: Vec<Point> = (0..length * 20)
                    .map(|s| at(f64::from(s) / 20.0).map(|v| v.floor() + 0.5))
                    .collect();
                cells.dedup();
                let view = |points: &[Point], width| HoughView::of_points(points, [0.0, 0.0], 0.0, width);
                let images = [view(&points, 3), view(&cells, 1), view(&cells, 3)];
                // eq. 4 and 5 as printed
                let theta = slope.atan() - std::f64::consts::FRAC_PI_2;
                let line = Line {
                    theta: Angle::from_radians(theta),
                    rho: intercept * theta.sin(),
                };
                let strongest = |view: &HoughView| {
                    let all = (0..view.columns()).flat_map(|column| view.column(column)).copied();
                    f64::from(all.max().unwrap_or(0))
                };
                placed.push(line.votes_in(&images[0]) >= 0.99 * strongest(&images[0]));
                for (sum, image) in sums.iter_mut().zip(&images) {
                    *sum += line.votes_in(image) / f64::from(length) / real(lengths.len());
                }
            }
            by_direction.push((direction, sums));
        }
        let ends = |k: usize| {
            let values = by_direction.iter().map(|(_, of)| of[k]);
            values.fold([f64::INFINITY, 0.0_f64], |[low, high], v| [low.min(v), high.max(v)])
        };
        Self {
            placed: share(&placed, |so| *so),
            tried: placed.len(),
            points: ends(0),
            one_bin: ends(1),
            three_bins: ends(2),
            by_direction,
        }
    }

    pub(super) fn table(&self) -> Table {
        let mut table = Table::new(
            "property-3",
            "Intensity of a straight wall over its length, by its direction: mean of segments of 60, 120 and 240 cells.",
            &[
                "direction [deg]",
                "points a cell apart",
                "cells crossed, one bin",
                "cells crossed, strip of 3",
            ],
        );
        for (direction, [points, one, three]) in &self.by_direction {
            table.push(vec![
                (*direction).into(),
                (*points).into(),
                (*one).into(),
                (*three).into(),
            ]);
        }
        table
    }

    pub(super) fn figure(&self) -> Figure {
        let labels = [
            "points a cell apart",
            "cells crossed, one bin",
            "cells crossed, strip of 3 bins",
        ];
        let mut panel = Panel::new(
            "Intensity of a wall of length L (eq. 6)",
            Axis::new("direction of the wall [deg]", -90.0, 90.0),
            Axis::new("intensity / L", 0.0, 2.0),
        );
        for (k, label) in labels.into_iter().enumerate() {
            let points = self
                .by_direction
                .iter()
                .map(|(direction, of)| [*direction, of[k]])
                .collect();
            panel = panel.with(Series::new(label, PALETTE[k], Mark::LineAndDots, points));
        }
        let caption = "Property 3: the intensity of a wall is its length only as long as it is made of points; drawn on \
                       cells it depends on the direction.";
        Figure::new("property-3", caption, 1, vec![panel])
    }
}
