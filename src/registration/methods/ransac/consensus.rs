//! The consensus of random samples: the transformation that most of the putative correspondences agree on.
//!
//! **Convention.** A transformation lays the moving map on the fixed one, both told in cells about the centres of their occupied
//! boxes: `p_fixed = R(psi) p_moving + T`.
//!
//! **Method.** For each sample of four correspondences
//!
//! 1. psi is half the circular mean of the doubled `theta_fixed - theta_moving` (eq. 2), and the half turn more;
//! 2. T solves `n(theta_fixed) . T = rho_fixed - rho_moving'` by least squares (eq. 3), rho' told for the fixed wall's normal;
//! 3. the error is `sum over all correspondences of min(D / limit, 1)`, D the distance of the fixed segment and the moved one
//!    (eq. 35 to 39), the limit that of an inlier.
//!
//! The lowest errors are kept; each is computed again from its inliers, the modified correspondences, and stays so when that
//! lowers its error.
//!
//! **Shapes and units.** Cells and radians. The limit of an inlier is `2 * inlier_cells` for the sum of two end point distances, and
//! that times the sum of both lengths for the product of eq. 39, whose larger factor is about so long when the segments nearly
//! coincide.
//!
//! **Cost.** Samples times two times correspondences.
//!
//! **Differences from the paper.** Its symmetric transfer error adds the error of both directions; a rigid motion changes no distance
//! of end points, so both are equal and one is computed. Its error grows without bound with each outlier; a bounded one is what
//! consensus means. A line's direction has period 180 degrees: both rotations are looked at.

use super::params::{RansacParams, SegmentDistance};
use super::wall::{Segment, Wall};
use crate::geometry::{Angle, Point, Pose2};
use crate::random::Random;
use crate::registration::Reason;
use crate::registration::methods::shared::verification::smaller_eigenvalue;

/// Correspondences of a sample (section 6.2).
const SAMPLE: usize = 4;
/// Normals of a sample hold T in its weaker direction by at least this sum of squares.
const HELD: f64 = 0.1;
/// The search looks whether to go on so often.
const SAMPLES_BETWEEN_LOOKS: u32 = 64;
/// Transformations that differ by less than both are alike.
const ALIKE_CELLS: f64 = 10.0;
const ALIKE_DEGREES: f64 = 5.0;

/// A wall of the fixed map and one of the moving map that may be one.
pub(super) type Correspondence<'a> = (&'a Wall, &'a Wall);

/// A transformation and its error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hypothesis {
    /// Rotation, and T in cells.
    pub(super) motion: Pose2,
    pub(super) error: f64,
}

/// The transformations of the lowest errors, the lowest first, no two alike.
pub(super) fn consensus(
    pairs: &[Correspondence<'_>],
    params: &RansacParams,
    go_on: impl Fn() -> Result<(), Reason>,
) -> Result<Vec<Hypothesis>, Reason> {
    let mut kept: Vec<Hypothesis> = Vec::new();
    if pairs.len() < SAMPLE {
        return Ok(kept);
    }
    let mut random = Random::new(params.seed, &[]);
    let mut without_progress = 0;
    for iteration in 0..params.iterations {
        if iteration % SAMPLES_BETWEEN_LOOKS == 0 {
            go_on()?;
        }
        let sample = sample(pairs, &mut random);
        let lowest = kept.first().map_or(f64::INFINITY, |best| best.error);
        for motion in motions(&sample) {
            let error = error(motion, pairs, params);
            keep(&mut kept, Hypothesis { motion, error }, params.hypotheses as usize);
        }
        if kept.first().is_some_and(|best| best.error < lowest) {
            without_progress = 0;
        } else {
            without_progress += 1;
        }
        if without_progress >= params.patience {
            break;
        }
    }
    let mut refined: Vec<Hypothesis> = kept
        .into_iter()
        .map(|found| from_inliers(found, pairs, params))
        .collect();
    refined.sort_by(|a, b| a.error.total_cmp(&b.error)); // stable
    Ok(refined)
}

/// Four different correspondences.
fn sample<'a>(pairs: &[Correspondence<'a>], random: &mut Random) -> Vec<Correspondence<'a>> {
    let mut chosen: Vec<usize> = Vec::with_capacity(SAMPLE);
    while chosen.len() < SAMPLE {
        let index = random.below(pairs.len());
        if !chosen.contains(&index) {
            chosen.push(index);
        }
    }
    chosen.into_iter().map(|index| pairs[index]).collect()
}

/// The transformations that these correspondences say: two rotations, half a turn apart, each with its T, when T is held.
fn motions(pairs: &[Correspondence<'_>]) -> Vec<Pose2> {
    let (sin, cos) = pairs.iter().fold((0.0, 0.0), |(sin, cos), (fixed, moving)| {
        let doubled = 2.0 * (fixed.theta - moving.theta);
        (sin + doubled.sin(), cos + doubled.cos())
    });
    let psi = Angle::from_radians(sin.atan2(cos) / 2.0);
    [psi, psi + Angle::HALF_TURN]
        .into_iter()
        .filter_map(|psi| translation(pairs, psi).map(|[x, y]| Pose2::new(x, y, psi)))
        .collect()
}

/// T by least squares (eq. 3).
fn translation(pairs: &[Correspondence<'_>], psi: Angle) -> Option<Point> {
    let (mut matrix, mut right) = ([0.0; 3], [0.0; 2]);
    for (fixed, moving) in pairs {
        let (ny, nx) = fixed.theta.sin_cos();
        // the moved wall's own normal may be the other one of its line
        let sign = if (fixed.theta - moving.theta - psi.radians()).cos() >= 0.0 {
            1.0
        } else {
            -1.0
        };
        let offset = fixed.rho - sign * moving.rho;
        for (sum, product) in matrix.iter_mut().zip([nx * nx, nx * ny, ny * ny]) {
            *sum += product;
        }
        right[0] += nx * offset;
        right[1] += ny * offset;
    }
    let determinant = matrix[0] * matrix[2] - matrix[1] * matrix[1];
    (smaller_eigenvalue(matrix) >= HELD).then(|| {
        [
            (matrix[2] * right[0] - matrix[1] * right[1]) / determinant,
            (matrix[0] * right[1] - matrix[1] * right[0]) / determinant,
        ]
    })
}

/// The distance of a correspondence under a transformation over the limit of an inlier: an inlier has less than 1.
fn relative_distance(motion: Pose2, (fixed, moving): Correspondence<'_>, params: &RansacParams) -> f64 {
    let moved = Segment {
        a: motion.apply(moving.segment.a),
        b: motion.apply(moving.segment.b),
    };
    let limit = match params.metric {
        SegmentDistance::SmallerSum => 2.0 * params.inlier_cells,
        SegmentDistance::Product => {
            2.0 * params.inlier_cells * (fixed.segment.length() + moving.segment.length()).max(1.0)
        }
    };
    fixed.segment.distance(&moved, params.metric) / limit
}

fn error(motion: Pose2, pairs: &[Correspondence<'_>], params: &RansacParams) -> f64 {
    pairs
        .iter()
        .map(|pair| relative_distance(motion, *pair, params).min(1.0))
        .sum()
}

/// Puts a transformation into its place among those that are kept; of two that are alike the better one stays.
fn keep(kept: &mut Vec<Hypothesis>, new: Hypothesis, most: usize) {
    let alike = |other: &Hypothesis| {
        let turn = (new.motion.yaw() - other.motion.yaw()).magnitude();
        let apart = (new.motion.x() - other.motion.x()).hypot(new.motion.y() - other.motion.y());
        apart < ALIKE_CELLS && turn < ALIKE_DEGREES.to_radians()
    };
    if kept.iter().any(|other| alike(other) && other.error <= new.error) {
        return;
    }
    kept.retain(|other| !alike(other));
    let place = kept.partition_point(|other| other.error <= new.error);
    kept.insert(place, new);
    kept.truncate(most);
}

/// The transformation of its inliers, when that has a lower error.
fn from_inliers(found: Hypothesis, pairs: &[Correspondence<'_>], params: &RansacParams) -> Hypothesis {
    let inliers: Vec<Correspondence<'_>> = (pairs.iter().copied())
        .filter(|pair| relative_distance(found.motion, *pair, params) < 1.0)
        .collect();
    if inliers.len() < 2 {
        return found;
    }
    motions(&inliers)
        .into_iter()
        .map(|motion| Hypothesis {
            motion,
            error: error(motion, pairs, params),
        })
        .fold(found, |best, other| if other.error < best.error { other } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall of a map from end to end.
    fn wall(a: Point, b: Point) -> Wall {
        let theta = (b[0] - a[0]).atan2(-(b[1] - a[1]));
        // the name in [-90, 90) degrees
        let theta =
            (theta + std::f64::consts::FRAC_PI_2).rem_euclid(std::f64::consts::PI) - std::f64::consts::FRAC_PI_2;
        Wall::of_line(theta, a[0] * theta.cos() + a[1] * theta.sin(), Segment { a, b })
    }

    fn ends() -> Vec<[Point; 2]> {
        (0..14_u32)
            .map(|i| {
                let s = f64::from(i);
                let a = [40.0 * (1.3 * s).sin(), 60.0 * (0.7 * s).cos()];
                [a, [a[0] + 50.0 * (2.1 * s).cos(), a[1] + 50.0 * (2.1 * s).sin()]]
            })
            .collect()
    }

    fn found(truth: Pose2, outliers: usize, params: &RansacParams) -> Hypothesis {
        let moving: Vec<Wall> = ends().iter().map(|[a, b]| wall(*a, *b)).collect();
        let mut fixed: Vec<Wall> = ends()
            .iter()
            .map(|[a, b]| wall(truth.apply(*a), truth.apply(*b)))
            .collect();
        fixed[..outliers].rotate_left(1); // correspondences that are wrong
        let pairs: Vec<Correspondence<'_>> = fixed.iter().zip(&moving).collect();
        consensus(&pairs, params, || Ok(())).expect("nobody stops it")[0]
    }

    #[test]
    fn the_transformation_of_the_inliers_is_found_among_outliers_by_both_metrics() {
        for metric in [SegmentDistance::Product, SegmentDistance::SmallerSum] {
            let params = RansacParams {
                metric,
                ..RansacParams::default()
            };
            for (x, y, degrees) in [
                (3.0, -2.0, 2.0),
                (70.0, 41.0, 88.0),
                (-30.0, 5.0, -170.0),
                (0.0, 0.0, 180.0),
            ] {
                let truth = Pose2::new(x, y, Angle::from_degrees(degrees));
                let best = found(truth, 6, &params);
                let off = truth.inverse() * best.motion;
                assert!(
                    off.x().hypot(off.y()) < 0.01 && off.yaw().magnitude() < 1e-4,
                    "{metric:?}: {off:?}"
                );
                assert!(best.error < 6.0 + 1e-6, "{}", best.error);
            }
        }
    }

    #[test]
    fn three_correspondences_are_too_few_and_parallel_walls_hold_no_translation() {
        let walls: Vec<Wall> = ends().iter().map(|[a, b]| wall(*a, *b)).collect();
        let three: Vec<Correspondence<'_>> = walls.iter().zip(&walls).take(3).collect();
        assert_eq!(consensus(&three, &RansacParams::default(), || Ok(())), Ok(Vec::new()));
        let parallel: Vec<Wall> = (0..6_u32)
            .map(|i| wall([0.0, 10.0 * f64::from(i)], [80.0, 10.0 * f64::from(i)]))
            .collect();
        let pairs: Vec<Correspondence<'_>> = parallel.iter().zip(&parallel).collect();
        assert_eq!(consensus(&pairs, &RansacParams::default(), || Ok(())), Ok(Vec::new()));
        let stopped = consensus(&pairs, &RansacParams::default(), || Err(Reason::Deadline));
        assert_eq!(stopped, Err(Reason::Deadline));
    }
}
