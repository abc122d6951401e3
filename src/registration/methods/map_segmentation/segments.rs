//! The segments of a map: discs of its thin lines, each with the histogram that it is filtered by.
//!
//! **Method.** Discs on a grid over the lines; those of most line are kept. The histogram of a disc is its Hough image, the
//! two-dimensional histogram of its lines' directions and distances. Its Fourier magnitudes along both axes are what no motion
//! changes (`shared::magnitudes`): two segments are compared by them.
//!
//! **Cost.** 180 columns times the line cells of all segments, and 180 short transforms a segment.

use rayon::prelude::*;

use super::params::MapSegmentationParams;
use crate::geometry::{Angle, Point};
use crate::registration::methods::shared::hough_image::{Directions, HoughImage, WallPoints, to_f64};
use crate::registration::methods::shared::magnitudes::Magnitudes;

/// Harmonics along theta that are compared: more would tell noise from noise.
const HARMONICS: usize = 16;

/// A disc of a map's lines.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    /// Its line cells about their middle, and that middle, in cells.
    pub(super) points: WallPoints,
    /// For the rotation.
    pub(super) magnitudes: Magnitudes,
    /// For the filter.
    histogram: Vec<f32>,
}

impl Segment {
    /// How alike the histograms of two segments are, in [0, 1]: their correlation times the smaller over the larger length of line.
    pub(super) fn similarity(&self, other: &Self) -> f64 {
        let product: f32 = self.histogram.iter().zip(&other.histogram).map(|(a, b)| a * b).sum();
        let frequencies = to_f64(self.histogram.len().min(other.histogram.len()) / HARMONICS);
        if frequencies <= 0.0 {
            return 0.0;
        }
        let (one, two) = (to_f64(self.points.len()), to_f64(other.points.len()));
        f64::from(product) / frequencies * one.min(two) / one.max(two)
    }
}

/// The segments of a map whose lines are these points, in cells; `cell` metres.
pub(super) fn segments(lines: &[Point], cell: f64, params: &MapSegmentationParams) -> Vec<Segment> {
    let (radius, spacing) = (
        params.segment_radius_m / cell,
        (params.segment_spacing_m / cell).max(1.0),
    );
    let buckets = Buckets::new(lines, spacing);
    let mut discs: Vec<Vec<Point>> = buckets
        .middles()
        .into_par_iter()
        .map(|middle| buckets.within(middle, radius))
        .filter(|points| !points.is_empty() && to_f64(points.len()) * cell >= params.segment_lines_min_m)
        .collect();
    discs.sort_by_key(|points| std::cmp::Reverse(points.len())); // stable: of equal ones the lower, then the left
    discs.truncate(params.segments_max as usize);
    let length = power_of_two(2.0 * radius);
    discs
        .into_par_iter()
        .map(|points| {
            let points = WallPoints::about_center(&points);
            let image = HoughImage::new(&points, Directions::half_turn_of_rotated(Angle::ZERO), 1);
            let magnitudes = Magnitudes::of_length(
                &image,
                params.frequency_max,
                length.max(image.bins().next_power_of_two()),
            );
            Segment {
                histogram: magnitudes.invariants(HARMONICS),
                magnitudes,
                points,
            }
        })
        .collect()
}

/// The power of two at or above a disc's width, with room for the bins at its rim.
fn power_of_two(cells: f64) -> usize {
    const RIM: f64 = 8.0;
    let mut length = 1;
    while to_f64(length) < cells + RIM {
        length *= 2;
    }
    length
}

/// Points by the square of a grid that they lie in.
struct Buckets {
    side: f64,
    low: Point,
    columns: usize,
    rows: usize,
    points: Vec<Vec<Point>>,
}

impl Buckets {
    fn new(points: &[Point], side: f64) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            for k in 0..2 {
                low[k] = low[k].min(point[k]);
                high[k] = high[k].max(point[k]);
            }
        }
        if points.is_empty() {
            (low, high) = ([0.0; 2], [0.0; 2]);
        }
        let [columns, rows] = [0, 1].map(|k| index((high[k] - low[k]) / side) + 1);
        let mut buckets = vec![Vec::new(); columns * rows];
        for point in points {
            let [i, j] = [0, 1].map(|k| index((point[k] - low[k]) / side));
            buckets[j * columns + i].push(*point);
        }
        Self {
            side,
            low,
            columns,
            rows,
            points: buckets,
        }
    }

    /// The middles of all squares, row by row.
    fn middles(&self) -> Vec<Point> {
        let at = |low: f64, square: usize| low + (to_f64(square) + 0.5) * self.side;
        let squares = (0..self.rows).flat_map(|j| (0..self.columns).map(move |i| (i, j)));
        squares.map(|(i, j)| [at(self.low[0], i), at(self.low[1], j)]).collect()
    }

    /// The points within a disc.
    fn within(&self, middle: Point, radius: f64) -> Vec<Point> {
        let span = |k: usize, squares: usize| {
            let from = index(((middle[k] - radius - self.low[k]) / self.side).max(0.0));
            let to = index(((middle[k] + radius - self.low[k]) / self.side).max(0.0));
            from..(to + 1).min(squares)
        };
        let mut found = Vec::new();
        for j in span(1, self.rows) {
            for i in span(0, self.columns) {
                let near = |p: &&Point| (p[0] - middle[0]).hypot(p[1] - middle[1]) <= radius;
                found.extend(self.points[j * self.columns + i].iter().filter(near));
            }
        }
        found
    }
}

/// The points of a map's lines within a disc.
pub(super) fn within(lines: &[Point], middle: Point, radius: f64) -> Vec<Point> {
    let near = |p: &&Point| (p[0] - middle[0]).hypot(p[1] - middle[1]) <= radius;
    lines.iter().filter(near).copied().collect()
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "not negative, and at most a map's diagonal in cells"
)]
fn index(value: f64) -> usize {
    value as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose2;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_disc_of_the_buckets_is_that_of_all_points(points in prop::collection::vec((-90.0..90.0_f64, -40.0..60.0_f64), 1..80),
                                                         x in -120.0..120.0_f64, y in -80.0..90.0_f64, radius in 1.0..70.0_f64) {
            let points: Vec<Point> = points.into_iter().map(|(x, y)| [x, y]).collect();
            let mut fast = Buckets::new(&points, 17.0).within([x, y], radius);
            let mut slow = within(&points, [x, y], radius);
            let order = |a: &Point, b: &Point| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]));
            fast.sort_by(order);
            slow.sort_by(order);
            prop_assert_eq!(fast, slow);
        }
    }

    /// Lines of a place that looks different everywhere.
    fn place() -> Vec<Point> {
        let mut points = Vec::new();
        for i in 0..400_u32 {
            let s = f64::from(i);
            points.push([s, 0.5]);
            if i < 300 {
                points.push([0.5, s]);
                points.push([s, 130.5]);
            }
            if i < 130 {
                points.push([170.5, s]);
                points.push([230.0 + 0.6 * s, 130.0 + 0.8 * s]);
                points.push([300.5 + 0.2 * s, s]);
            }
        }
        points
    }

    #[test]
    fn the_most_similar_segments_of_a_rotated_map_often_show_the_same_place() {
        let params = MapSegmentationParams::default();
        let here = segments(&place(), 0.05, &params);
        assert!(here.len() > 10);
        let pose = Pose2::new(70.0, -30.0, Angle::from_degrees(37.0));
        let moved: Vec<Point> = place().iter().map(|p| pose.apply(*p)).collect();
        let there = segments(&moved, 0.05, &params);
        let mut pairs: Vec<(f64, Point, Point)> = here
            .iter()
            .flat_map(|a| {
                there
                    .iter()
                    .map(|b| (a.similarity(b), pose.apply(a.points.center), b.points.center))
            })
            .collect();
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        let near = pairs[..10]
            .iter()
            .filter(|(_, a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) < 60.0)
            .count();
        // by chance it were one
        assert!(near >= 4, "{near} of 10");
        assert!(
            pairs
                .iter()
                .all(|(similarity, ..)| (0.0..=1.0 + 1e-6).contains(similarity))
        );
    }

    #[test]
    fn no_lines_have_no_segments() {
        assert!(segments(&[], 0.05, &MapSegmentationParams::default()).is_empty());
    }
}
