//! Pairs of segments that may show one place, and how they lie on each other.
//!
//! **Convention.** As in the method: the moving map's segment is laid on the fixed map's.
//!
//! **Method.**
//!
//! 1. The histogram filter: the pairs of segments with the most similar histograms, no segment in too many of them.
//! 2. The rotations of a pair are those of the segments' Hough images (`shared::magnitudes`), each replaced by one of the whole
//!    maps' within `snap_degrees`, which is sharper; and the half turns.
//! 3. Cross-correlation matching: the rotated segment is correlated with the fixed map's lines around the other segment, which
//!    are three matching cells wide; the greatest value over the segment's cells is the share of matching line.
//!
//! **Cost.** Pairs of segments times a histogram's length; two transforms for each rotation of each pair that is matched.

use super::params::MapSegmentationParams;
use super::segments::{Segment, within};
use crate::geometry::{Angle, Point, Pose2};
use crate::registration::methods::hough::fft::Planner;
use crate::registration::methods::shared::hough_image::to_f64;
use crate::registration::methods::shared::magnitudes::rotations;
use crate::registration::methods::shared::plane::{FourierCorrelation, Plane, best_shifts};

/// Rotations of a pair of segments differ by at least this, degrees.
const APART_DEGREES: f64 = 10.0;
/// A segment is looked for this much beyond the other segment's rim.
const AROUND: f64 = 1.5;

/// How a segment may lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Match {
    /// `p_fixed = R p_moving + T` between the maps' frames in cells.
    pub(super) motion: Pose2,
    /// Share of the segment's line that lies on line of the fixed map, in [0, 1].
    pub(super) share: f64,
}

/// The histogram filter: the pairs that are matched, by index, the most similar first.
pub(super) fn similar_pairs(
    fixed: &[Segment],
    moving: &[Segment],
    params: &MapSegmentationParams,
) -> Vec<(usize, usize)> {
    let mut all: Vec<(f64, usize, usize)> = Vec::with_capacity(fixed.len() * moving.len());
    for (i, one) in fixed.iter().enumerate() {
        all.extend(
            moving
                .iter()
                .enumerate()
                .map(|(j, other)| (one.similarity(other), i, j)),
        );
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0)); // stable: of equal ones the first
    let (mut uses_fixed, mut uses_moving) = (vec![0; fixed.len()], vec![0; moving.len()]);
    let mut kept = Vec::new();
    for (_, i, j) in all {
        if kept.len() == params.pairs_max as usize {
            break;
        }
        if uses_fixed[i] < params.pairs_per_segment && uses_moving[j] < params.pairs_per_segment {
            uses_fixed[i] += 1;
            uses_moving[j] += 1;
            kept.push((i, j));
        }
    }
    kept
}

/// How a moving segment may lie on the fixed one. `lines` are those of the fixed map, `whole` the rotations of the whole maps.
pub(super) fn matches(
    planner: &Planner,
    (fixed, lines): (&Segment, &[Point]),
    moving: &Segment,
    whole: &[Angle],
    radius: f64,
    params: &MapSegmentationParams,
) -> Vec<Match> {
    let scale = f64::from(params.matching_cells);
    let middle = fixed.points.center;
    let around: Vec<Point> = within(lines, middle, AROUND * radius)
        .into_iter()
        .flat_map(|[x, y]| {
            let place = [(x - middle[0]) / scale, (y - middle[1]) / scale];
            (-1_i32..=1)
                .flat_map(move |dy| (-1_i32..=1).map(move |dx| [place[0] + f64::from(dx), place[1] + f64::from(dy)]))
        })
        .collect();
    let around = Plane::of_points(&around);
    let most = params.rotations as usize;
    rotations(&fixed.magnitudes, &moving.magnitudes, APART_DEGREES, most)
        .into_iter()
        .map(|rotation| snapped(rotation, whole, params.snap_degrees))
        .flat_map(|rotation| [rotation, rotation + Angle::HALF_TURN])
        .filter_map(|rotation| {
            let motion = Pose2::new(0.0, 0.0, rotation).motion();
            let turned: Vec<Point> = (moving.points.local.iter())
                .map(|point| motion.rotate(point.map(f64::from)).map(|cells| cells / scale))
                .collect();
            let segment = Plane::of_points(&turned);
            let cells = segment.values.iter().filter(|value| **value > 0.0).count();
            let shift = *best_shifts(planner, &around, &segment, FourierCorrelation::Cross, (1, 1)).first()?;
            let [mx, my] = motion.rotate(moving.points.center);
            let [x, y] = [0, 1].map(|k| middle[k] + shift.by[k] * scale);
            Some(Match {
                motion: Pose2::new(x - mx, y - my, rotation),
                share: shift.value / to_f64(cells),
            })
        })
        .collect()
}

/// The rotation of the whole maps that is nearest, modulo a half turn, when it is near enough.
fn snapped(rotation: Angle, whole: &[Angle], within_degrees: f64) -> Angle {
    // the angle between two rotations of lines, in [0, 90] degrees
    let apart = |other: &Angle| {
        let (sin, cos) = (rotation - *other).sin_cos();
        sin.abs().atan2(cos.abs())
    };
    let nearest = whole.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
    match nearest {
        Some(other) if apart(other) <= within_degrees.to_radians() => *other,
        _ => rotation,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_is_snapped_to_the_nearest_of_the_whole_maps_modulo_a_half_turn() {
        let whole = [30.4, -59.7, 88.9].map(Angle::from_degrees);
        let of = |degrees| snapped(Angle::from_degrees(degrees), &whole, 5.0).degrees();
        for (rotation, expected) in [(32.0, 30.4), (-62.0, -59.7), (-89.0, 88.9), (10.0, 10.0), (210.0, 30.4)] {
            assert!((of(rotation) - expected).abs() < 1e-9, "{rotation}: {}", of(rotation));
        }
        assert!((snapped(Angle::from_degrees(7.0), &[], 5.0).degrees() - 7.0).abs() < 1e-9);
    }
}
