//! A wall of a map: a peak of its Hough image with its line segment and the picture of its neighbourhood.
//!
//! **Convention.** Points are in cells about the centre of the map's occupied box; a line is `n . p = rho` with the unit normal n
//! of its direction theta.

use super::params::{RansacParams, SegmentDistance};
use crate::geometry::Point;
use crate::registration::methods::shared::hough_image::{COLUMNS, Directions, HoughImage, WallPoints, to_f64};
use crate::registration::methods::shared::peaks::Peak;

/// A wall.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wall {
    /// Direction of its normal in radians, in [-pi/2, pi/2).
    pub(super) theta: f64,
    pub(super) rho: f64,
    /// Votes of its peak.
    pub(super) votes: f64,
    pub(super) segment: Segment,
    /// The votes around its peak, of mean 0 and length 1, column by column; empty when they are all alike.
    neighbourhood: Vec<f32>,
    /// Values of a column of the neighbourhood.
    rows: usize,
}

/// A line segment by its end points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Segment {
    pub(super) a: Point,
    pub(super) b: Point,
}

impl Segment {
    pub(super) fn length(&self) -> f64 {
        between(self.a, self.b)
    }

    /// The distance to another segment (eq. 35 to 39). Two segments that are one have 0, whichever end is called a.
    pub(super) fn distance(&self, other: &Self, metric: SegmentDistance) -> f64 {
        let (d1, d2) = (between(self.a, other.a), between(self.a, other.b)); // eq. 35, 36
        let (d3, d4) = (between(self.b, other.a), between(self.b, other.b)); // eq. 37, 38
        match metric {
            SegmentDistance::Product => (d1 + d4) * (d2 + d3), // eq. 39
            SegmentDistance::SmallerSum => (d1 + d4).min(d2 + d3),
        }
    }
}

fn between(p: Point, q: Point) -> f64 {
    (p[0] - q[0]).hypot(p[1] - q[1])
}

impl Wall {
    pub(super) fn new(peak: &Peak, image: &HoughImage, points: &WallPoints, params: &RansacParams) -> Self {
        let theta = Directions::of_column(peak.column).radians();
        let (reach_columns, reach_bins) = (
            params.neighbourhood_degrees as usize,
            params.neighbourhood_cells as usize,
        );
        Self {
            theta,
            rho: peak.rho,
            votes: peak.votes,
            segment: segment(theta, peak.rho, points, params),
            neighbourhood: neighbourhood(image, peak, reach_columns, reach_bins),
            rows: 2 * reach_bins + 1,
        }
    }

    /// A wall without a neighbourhood.
    #[cfg(test)]
    pub(super) fn of_line(theta: f64, rho: f64, segment: Segment) -> Self {
        Self {
            theta,
            rho,
            votes: segment.length(),
            segment,
            neighbourhood: Vec::new(),
            rows: 1,
        }
    }

    /// How alike two walls are, in [0, 1]: the correlation of their neighbourhoods times the smaller over the larger number of
    /// votes. `mirrored`: the other wall goes by the other of its two names, `(theta + 180 degrees, -rho)`.
    pub(super) fn similarity(&self, other: &Self, mirrored: bool) -> f64 {
        if self.neighbourhood.is_empty() || other.neighbourhood.is_empty() {
            return 0.0;
        }
        let columns = self
            .neighbourhood
            .chunks(self.rows)
            .zip(other.neighbourhood.chunks(self.rows));
        let product = |(one, other): (&[f32], &[f32])| -> f32 {
            if mirrored {
                one.iter().zip(other.iter().rev()).map(|(a, b)| a * b).sum()
            } else {
                one.iter().zip(other).map(|(a, b)| a * b).sum()
            }
        };
        let correlation = f64::from(columns.map(product).sum::<f32>());
        correlation.max(0.0) * self.votes.min(other.votes) / self.votes.max(other.votes)
    }
}

/// The longest run of a line's cells without a gap, as a segment of the line.
fn segment(theta: f64, rho: f64, points: &WallPoints, params: &RansacParams) -> Segment {
    let (sin, cos) = theta.sin_cos();
    let half_width = f64::from(params.line_width_cells) / 2.0;
    let mut along: Vec<f64> = (points.local.iter())
        .map(|point| point.map(f64::from))
        .filter(|[x, y]| (x * cos + y * sin - rho).abs() <= half_width)
        .map(|[x, y]| y * cos - x * sin)
        .collect();
    along.sort_by(f64::total_cmp);
    let (mut longest, mut start) = ((0.0, 0.0), along.first().copied().unwrap_or(0.0));
    for (index, here) in along.iter().enumerate() {
        let ends = along.get(index + 1).is_none_or(|next| next - here > params.gap_cells);
        if ends {
            if here - start > longest.1 - longest.0 {
                longest = (start, *here);
            }
            start = along.get(index + 1).copied().unwrap_or(*here);
        }
    }
    let at = |s: f64| [rho * cos - s * sin, rho * sin + s * cos];
    Segment {
        a: at(longest.0),
        b: at(longest.1),
    }
}

/// The votes around a peak, of mean 0 and length 1. The image closes on itself: beyond +90 degrees the lines of -90 degrees
/// follow with rho negated.
fn neighbourhood(image: &HoughImage, peak: &Peak, reach_columns: usize, reach_bins: usize) -> Vec<f32> {
    let middle = bin_of(image, peak.rho);
    let mut values = Vec::with_capacity((2 * reach_columns + 1) * (2 * reach_bins + 1));
    for step in 0..=2 * reach_columns {
        let unwrapped = peak.column + COLUMNS + step - reach_columns;
        let column = image.column(unwrapped % COLUMNS);
        let mirrored = unwrapped / COLUMNS != 1;
        for offset in 0..=2 * reach_bins {
            let bin = (middle + offset)
                .checked_sub(reach_bins)
                .filter(|bin| *bin < image.bins());
            let bin = bin.map(|bin| if mirrored { image.bins() - 1 - bin } else { bin });
            values.push(bin.map_or(0, |bin| column[bin]));
        }
    }
    let votes: Vec<f64> = values.into_iter().map(f64::from).collect();
    let mean = votes.iter().sum::<f64>() / to_f64(votes.len());
    let length = votes.iter().map(|value| (value - mean).powi(2)).sum::<f64>().sqrt();
    if length <= 0.0 {
        return Vec::new();
    }
    votes.into_iter().map(|value| narrow((value - mean) / length)).collect()
}

fn bin_of(image: &HoughImage, rho: f64) -> usize {
    // the inverse of `rho_of`, whose values lie amid the bins
    (0..image.bins())
        .find(|bin| (image.rho_of(*bin) - rho).abs() < 0.5)
        .unwrap_or(0)
}

#[expect(clippy::cast_possible_truncation, reason = "within [-1, 1]")]
fn narrow(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Angle, Pose2};
    use crate::registration::methods::shared::peaks::local_peaks;
    use proptest::prelude::*;

    fn between_points(a: Point, b: Point) -> Segment {
        Segment { a, b }
    }

    #[test]
    fn the_distance_is_zero_for_one_segment_and_tells_apart_what_share_an_end() {
        let one = between_points([0.0, 0.0], [10.0, 0.0]);
        let reversed = between_points([10.0, 0.0], [0.0, 0.0]);
        // figure 15: the paper's example of two segments that share an end
        let across = between_points([0.0, 0.0], [0.0, 10.0]);
        for metric in [SegmentDistance::Product, SegmentDistance::SmallerSum] {
            assert!(one.distance(&one, metric).abs() < 1e-12);
            assert!(one.distance(&reversed, metric).abs() < 1e-12);
            assert!(one.distance(&across, metric) > 10.0);
            assert!((one.distance(&across, metric) - across.distance(&one, metric)).abs() < 1e-12);
        }
        // by hand: d1 = 0, d2 = d3 = 10, d4 = 10 sqrt 2
        let root = 200.0_f64.sqrt();
        assert!((one.distance(&across, SegmentDistance::Product) - root * 20.0).abs() < 1e-9);
        assert!((one.distance(&across, SegmentDistance::SmallerSum) - root).abs() < 1e-9);
    }

    fn walls_of(points: &[Point]) -> Vec<Wall> {
        let params = RansacParams::default();
        let points = WallPoints::about_center(points);
        let image = HoughImage::new(&points, Directions::half_turn_of_rotated(Angle::ZERO), 3);
        let peaks = local_peaks(&image, &params.peak_rule());
        peaks
            .iter()
            .map(|peak| Wall::new(peak, &image, &points, &params))
            .collect()
    }

    fn rooms() -> Vec<Point> {
        let mut points = Vec::new();
        for i in 0..200_u32 {
            let s = f64::from(i);
            points.push([s, 0.3]);
            if i < 120 {
                points.push([0.3, s]);
            }
            if !(60..110).contains(&i) && i < 170 {
                points.push([s, 120.3]); // 60 cells, a gap of 50, and 60 cells
            }
            if i < 90 {
                points.push([90.0 + 0.6 * s, 20.0 + 0.8 * s]);
            }
        }
        points
    }

    #[test]
    fn the_segment_of_a_peak_is_its_longest_run_without_a_gap() {
        let walls = walls_of(&rooms());
        let lengths: Vec<f64> = walls[..4].iter().map(|wall| wall.segment.length()).collect();
        for (expected, tolerance) in [(199.0, 2.0), (119.0, 2.0), (59.0, 3.0), (89.0, 3.0)] {
            assert!(
                lengths.iter().any(|length| (length - expected).abs() < tolerance),
                "{expected}: {lengths:?}"
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn a_wall_is_most_like_itself_in_the_rotated_map(turn in -180_i32..180) {
            let pose = Pose2::new(30.0, -12.0, Angle::from_degrees(f64::from(turn)));
            let moved: Vec<Point> = rooms().iter().map(|p| pose.apply(*p)).collect();
            let (here, there) = (walls_of(&rooms()), walls_of(&moved));
            // the strongest wall is unique in this map
            let best = |wall: &Wall| {
                let score = |other: &Wall| wall.similarity(other, false).max(wall.similarity(other, true));
                (0..there.len()).max_by(|a, b| score(&there[*a]).total_cmp(&score(&there[*b])))
            };
            let found = &there[best(&here[0]).expect("walls")];
            let turned = here[0].theta + f64::from(turn).to_radians();
            prop_assert!((found.theta - turned).sin().abs() < 2.5_f64.to_radians());
        }
    }
}
