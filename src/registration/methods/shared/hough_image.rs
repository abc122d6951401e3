//! The Hough image of a map: how many occupied cells lie on each line (eq. 1).
//!
//! **Convention.** A line is its normal's direction theta and its signed distance rho: `rho = x cos(theta) + y sin(theta)`.
//! `(theta + 180 deg, -rho)` is the same line, so half a turn of directions holds all lines.
//!
//! **Method.** Every occupied cell votes, in each column theta, for the bin of its rho (eq. 1).
//!
//! **Shapes and units.** Cells and radians. A column a direction, a bin a cell wide; rho is told about the centre of the
//! map's occupied box, so that the image is no larger than the map's diagonal wherever its frame lies. The bins lie
//! symmetrically: bin b of theta is bin `bins - 1 - b` of theta + 180 deg.
//!
//! **Cost.** Columns times occupied cells, in parallel by columns. Votes are whole numbers, so the answer does not depend
//! on the number of threads.
//!
//! **Differences from the paper.** Property 1 as displayed has its signs reversed; with p' = R p + T it reads
//! `H'(theta + psi, rho + n(theta + psi) . T) = H(theta, rho)`, and eq. 2 and 3 say the same. Property 3 in slope and
//! intercept needs the identity above to hold; the tests state it with normals. With a line wider than a cell
//! (`line_width_cells`) the votes of neighbouring bins are added.

use rayon::prelude::*;

use crate::geometry::{Angle, Point};
use crate::grid::CellState;
use crate::registration::overlap::StateMap;

/// Columns of a whole image: one a degree, the paper's "1 degree resolution".
pub(crate) const COLUMNS: usize = 180;

/// The occupied cells of a map, about the centre of their box.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WallPoints {
    /// Centre of the box around all occupied cells: cells in the map's frame.
    pub(crate) center: Point,
    /// Occupied cells relative to the centre, in cells.
    pub(crate) local: Vec<[f32; 2]>,
    /// No cell is farther from the centre, in cells.
    radius: f64,
}

impl WallPoints {
    pub(crate) fn new(map: &StateMap) -> Self {
        let lattice = map.lattice();
        let columns = lattice.width() as usize;
        let resolution = lattice.resolution();
        let points: Vec<Point> = (0_u32..)
            .zip(map.states().chunks(columns))
            .flat_map(|(row, states)| {
                (0_u32..)
                    .zip(states)
                    .filter(|(_, state)| **state == CellState::Occupied)
                    .map(move |(column, _)| lattice.cell_center(column, row).map(|metres| metres / resolution))
            })
            .collect();
        Self::about_center(&points)
    }

    /// `points` in cells in the map's frame.
    pub(crate) fn about_center(points: &[Point]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for [x, y] in points {
            low = [low[0].min(*x), low[1].min(*y)];
            high = [high[0].max(*x), high[1].max(*y)];
        }
        let center = if points.is_empty() {
            [0.0, 0.0]
        } else {
            [f64::midpoint(low[0], high[0]), f64::midpoint(low[1], high[1])]
        };
        Self::about(points, center, 0.0)
    }

    /// `points` in cells in the map's frame, about a given centre; none lies farther from it than `radius` cells.
    pub(crate) fn about(points: &[Point], center: Point, radius: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "to f32: within a map's diagonal that keeps 1/100 of a cell"
        )]
        let local: Vec<[f32; 2]> = points
            .iter()
            .map(|[x, y]| [(x - center[0]) as f32, (y - center[1]) as f32])
            .collect();
        let farthest = local.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f32::max);
        Self {
            center,
            local,
            radius: radius.max(f64::from(farthest)),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.local.len()
    }

    /// No cell is farther from the centre, in cells.
    pub(crate) fn radius(&self) -> f64 {
        self.radius
    }
}

/// The directions of an image's columns: `first + k * step`, in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Directions {
    pub(crate) first: f64,
    pub(crate) step: f64,
    pub(crate) count: usize,
}

impl Directions {
    /// -90 degrees to 89 degrees by one degree, as a map shows them that is rotated by `rotation`: column k then holds
    /// the lines whose direction AFTER the rotation is -90 degrees + k.
    pub(crate) fn half_turn_of_rotated(rotation: Angle) -> Self {
        Self {
            // Departs from the formula below eq. 3, whose signs are reversed: H'(theta, .) is H(theta - psi, .).
            first: -Angle::QUARTER_TURN.radians() - rotation.radians(),
            step: Angle::from_degrees(1.0).radians(),
            count: COLUMNS,
        }
    }

    /// The direction of a column of a whole image of a map that is not rotated.
    pub(crate) fn of_column(column: usize) -> Angle {
        Angle::from_degrees(to_f64(column) - 90.0)
    }
}

/// Votes by direction and distance.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HoughImage {
    bins: usize,
    /// Column after column.
    votes: Vec<u32>,
}

impl HoughImage {
    /// The image of these points; `line_width` is the odd number of bins that are added to one.
    pub(crate) fn new(points: &WallPoints, directions: Directions, line_width: usize) -> Self {
        let half = half_bins(points.radius, line_width);
        let bins = 2 * half;
        let mut votes = vec![0_u32; bins * directions.count];
        votes.par_chunks_mut(bins).enumerate().for_each(|(column, votes)| {
            // Departs from property 3 (eq. 4, 5), slope and intercept: a line is its normal, which no direction escapes.
            let (sin, cos) = (directions.first + to_f64(column) * directions.step).sin_cos();
            vote(points, [cos, sin], half, votes);
            widen(votes, line_width);
        });
        Self { bins, votes }
    }

    pub(crate) fn bins(&self) -> usize {
        self.bins
    }

    /// The columns in the order of their directions.
    pub(crate) fn columns(&self) -> impl Iterator<Item = &[u32]> {
        self.votes.chunks(self.bins)
    }

    pub(crate) fn column(&self, column: usize) -> &[u32] {
        &self.votes[column * self.bins..][..self.bins]
    }

    /// rho of a bin's middle about the points' centre, in cells.
    pub(crate) fn rho_of(&self, bin: usize) -> f64 {
        to_f64(bin) + 0.5 - to_f64(self.bins / 2)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a radius is not negative and at most a map's diagonal"
)]
fn half_bins(radius: f64, line_width: usize) -> usize {
    // one bin more than the radius on each side takes up the rounding to f32
    radius.ceil() as usize + 1 + line_width / 2
}

fn vote(points: &WallPoints, normal: Point, half: usize, votes: &mut [u32]) {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "to f32 on purpose, as the points are"
    )]
    let (cos, sin, half) = (normal[0] as f32, normal[1] as f32, half as f32);
    for [x, y] in &points.local {
        // rho + half is above 0, so that dropping its fraction is the floor: no bin is wider than another
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the floor of a number in [0, bins), see above"
        )]
        let bin = (x * cos + y * sin + half) as usize;
        votes[bin] += 1;
    }
}

/// Adds to each bin those within `line_width / 2` on both sides.
fn widen(votes: &mut [u32], line_width: usize) {
    if line_width <= 1 {
        return;
    }
    let single = votes.to_vec();
    let reach = line_width / 2;
    for (bin, sum) in votes.iter_mut().enumerate() {
        let (low, high) = (bin.saturating_sub(reach), (bin + reach + 1).min(single.len()));
        *sum = single[low..high].iter().sum();
    }
}

#[expect(
    clippy::cast_precision_loss,
    reason = "counts of columns, bins and cells stay far below 2^52"
)]
pub(crate) fn to_f64(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose2;
    use proptest::prelude::*;

    fn image(points: &[Point]) -> (WallPoints, HoughImage) {
        let points = WallPoints::about_center(points);
        let image = HoughImage::new(&points, Directions::half_turn_of_rotated(Angle::ZERO), 1);
        (points, image)
    }

    /// Votes of the line (theta, rho) of the map's frame, looked up in the image about its centre.
    fn votes_at(points: &WallPoints, image: &HoughImage, column: usize, rho: f64) -> u32 {
        let (sin, cos) = Directions::of_column(column).sin_cos();
        let local = rho - (points.center[0] * cos + points.center[1] * sin);
        let bin = (local + to_f64(image.bins() / 2)).floor();
        (0..image.bins())
            .find(|b| (to_f64(*b) - bin).abs() < 0.5)
            .map_or(0, |b| image.column(column)[b])
    }

    fn cloud() -> impl Strategy<Value = Vec<Point>> {
        prop::collection::vec((-80.0..80.0_f64, -60.0..60.0_f64).prop_map(|(x, y)| [x, y]), 1..60)
    }

    proptest! {
        /// Property 1, eq. 2 and 3: a line of the map is the line (theta + psi, rho + n(theta + psi) . T) of the moved map.
        #[test]
        fn property_1_a_moved_map_has_a_shifted_hough_image(points in cloud(), turn in -180_i32..180,
                                                            x in -50.0..50.0_f64, y in -50.0..50.0_f64) {
            let pose = Pose2::new(x, y, Angle::from_degrees(f64::from(turn)));
            let moved: Vec<Point> = points.iter().map(|p| pose.apply(*p)).collect();
            let (_, image) = image(&points);
            let moved_points = WallPoints::about_center(&moved);
            let moved_image = HoughImage::new(&moved_points, Directions::half_turn_of_rotated(Angle::ZERO), 1);
            let center = WallPoints::about_center(&points).center;
            // a strip three bins wide holds what one bin of the other image holds, wherever the bins begin
            for column in (0..COLUMNS).step_by(13) {
                let theta = Directions::of_column(column);
                let turned = theta + Angle::from_degrees(f64::from(turn));
                let (sin, cos) = turned.sin_cos();
                let (sin_0, cos_0) = theta.sin_cos();
                for bin in 0..image.bins() {
                    let votes = image.column(column)[bin];
                    if votes == 0 { continue; }
                    let rho = image.rho_of(bin) + center[0] * cos_0 + center[1] * sin_0;
                    let mut expected = rho + x * cos + y * sin;
                    // the same line under the name that the half turn of columns knows
                    let mut degrees = turned.degrees().round();
                    if degrees >= 90.0 { degrees -= 180.0; expected = -expected; }
                    if degrees < -90.0 { degrees += 180.0; expected = -expected; }
                    let there = (0..COLUMNS).find(|c| (Directions::of_column(*c).degrees() - degrees).abs() < 0.5);
                    let there = there.expect("a column a degree");
                    let seen: u32 = [-1.0, 0.0, 1.0].iter().map(|d| votes_at(&moved_points, &moved_image, there, expected + d)).sum();
                    prop_assert!(seen >= votes, "{} votes at theta {} rho {} became {}", votes, theta.degrees(), rho, seen);
                }
            }
        }

        /// Property 2: the image of two maps together is the sum of their images.
        #[test]
        fn property_2_hough_images_superpose(a in cloud(), b in cloud()) {
            let both: Vec<Point> = a.iter().chain(&b).copied().collect();
            let whole = WallPoints::about_center(&both);
            // the parts about the centre of the whole, so that their bins are the same
            let part = |points: &[Point]| WallPoints {
                center: whole.center,
                local: WallPoints { ..whole.clone() }.local.iter().zip(&both)
                    .filter(|(_, p)| points.contains(p)).map(|(l, _)| *l).collect(),
                radius: whole.radius,
            };
            let directions = Directions::half_turn_of_rotated(Angle::ZERO);
            let of = |points: &WallPoints| HoughImage::new(points, directions, 1);
            let (sum, first, second) = (of(&whole), of(&part(&a)), of(&part(&b)));
            prop_assume!(!a.iter().any(|p| b.contains(p)));
            for column in 0..COLUMNS {
                let added: Vec<u32> = first.column(column).iter().zip(second.column(column)).map(|(x, y)| x + y).collect();
                prop_assert_eq!(sum.column(column), &added[..]);
            }
        }

        /// Property 3, by normals: L cells on the line n . p = rho give a peak of L at (theta, rho).
        #[test]
        fn property_3_a_segment_of_l_cells_is_a_peak_of_l_votes(column in 0..COLUMNS, rho in -100.0..100.0_f64,
                                                                length in 20_usize..150, start in -80.0..80.0_f64) {
            let (sin, cos) = Directions::of_column(column).sin_cos();
            let points: Vec<Point> = (0..length).map(|i| to_f64(i) + start)
                .map(|s| [rho * cos - s * sin, rho * sin + s * cos]).collect();
            let points = WallPoints::about_center(&points);
            let image = HoughImage::new(&points, Directions::half_turn_of_rotated(Angle::ZERO), 3);
            let strongest = image.columns().flatten().copied().max();
            prop_assert_eq!(strongest.map(|v| v as usize), Some(length));
            prop_assert_eq!(votes_at(&points, &image, column, rho) as usize, length);
        }

        #[test]
        fn a_rotated_map_has_the_image_of_its_rotated_points(points in cloud(), turn in -3.1..3.1_f64) {
            let rotation = Angle::from_radians(turn);
            let points = WallPoints::about_center(&points);
            let image = HoughImage::new(&points, Directions::half_turn_of_rotated(rotation), 1);
            let motion = Pose2::new(0.0, 0.0, rotation).motion();
            for column in (0..COLUMNS).step_by(17) {
                let (sin, cos) = Directions::of_column(column).sin_cos();
                let mut slow = vec![0_u32; image.bins()];
                for [x, y] in &points.local {
                    let [x, y] = motion.rotate([f64::from(*x), f64::from(*y)]);
                    let rho = x * cos + y * sin;
                    prop_assume!((rho - rho.round()).abs() > 1e-3); // on a bin's border f32 may choose either
                    let bin = (0..image.bins()).find(|b| (image.rho_of(*b) - rho).abs() <= 0.5);
                    slow[bin.expect("within the image")] += 1;
                }
                prop_assert_eq!(image.column(column), &slow[..]);
            }
        }
    }

    #[test]
    fn the_same_line_named_by_both_normals_is_the_mirrored_bin() {
        let points = WallPoints::about_center(&[[3.3, 7.1], [-12.2, 5.4], [40.7, -3.9]]);
        let image = HoughImage::new(&points, Directions::half_turn_of_rotated(Angle::ZERO), 1);
        let turned = HoughImage::new(&points, Directions::half_turn_of_rotated(Angle::HALF_TURN), 1);
        for column in 0..COLUMNS {
            let mirrored: Vec<u32> = turned.column(column).iter().rev().copied().collect();
            assert_eq!(image.column(column), &mirrored[..]);
        }
    }

    #[test]
    fn a_map_without_walls_has_an_empty_image() {
        let (points, image) = image(&[]);
        assert_eq!(points.len(), 0);
        assert!(image.columns().flatten().all(|votes| *votes == 0));
    }
}
