//! The shapes that worlds are drawn with.

use crate::geometry::{Point, Pose2};

/// A filled shape in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A straight piece of `thickness`, cut square at both ends: walls, boxes, doors.
    Bar {
        /// One end, in the middle of the thickness.
        from: Point,
        /// The other end.
        to: Point,
        /// Across.
        thickness: f64,
    },
    /// A full disc: columns, plants, table legs.
    Disc {
        /// Its middle.
        center: Point,
        /// Its radius.
        radius: f64,
    },
    /// A piece of a circular wall.
    Arc {
        /// Middle of the circle.
        center: Point,
        /// From the centre to the middle of the thickness.
        radius: f64,
        /// Across.
        thickness: f64,
        /// Direction where the piece starts, radians.
        start: f64,
        /// How far it goes counter-clockwise, radians in (0, 2 pi].
        sweep: f64,
    },
}

impl Shape {
    /// A box of `length` along the pose's x axis and `depth` across, the pose in its middle.
    #[must_use]
    pub fn block(pose: Pose2, length: f64, depth: f64) -> Self {
        Self::Bar {
            from: pose.apply([-length / 2.0, 0.0]),
            to: pose.apply([length / 2.0, 0.0]),
            thickness: depth,
        }
    }

    /// Whether the point lies in the shape.
    #[must_use]
    pub fn contains(&self, point: Point) -> bool {
        match *self {
            Self::Bar { from, to, thickness } => {
                let along = sub(to, from);
                let length = norm(along);
                if length <= 0.0 {
                    return false;
                }
                let offset = sub(point, from);
                let forward = dot(offset, along) / length;
                let across = (along[0] * offset[1] - along[1] * offset[0]) / length;
                (0.0..=length).contains(&forward) && across.abs() <= thickness / 2.0
            }
            Self::Disc { center, radius } => norm(sub(point, center)) <= radius,
            Self::Arc {
                center,
                radius,
                thickness,
                start,
                sweep,
            } => {
                let [x, y] = sub(point, center);
                (x.hypot(y) - radius).abs() <= thickness / 2.0
                    && (y.atan2(x) - start).rem_euclid(std::f64::consts::TAU) <= sweep
            }
        }
    }

    /// Lower-left and upper-right corner of rectangles that cover the shape and little else.
    #[must_use]
    pub(super) fn boxes(&self) -> Vec<[Point; 2]> {
        match *self {
            Self::Bar { from, to, thickness } => {
                // a long slanted bar fills little of its own bounding box, so it is covered piece by piece
                let along = sub(to, from);
                let length = norm(along);
                let pieces = super::numbers::count((length / (thickness + 1.0)).ceil()).max(1);
                let half = thickness / 2.0 / length.max(f64::MIN_POSITIVE);
                let across = [-along[1] * half, along[0] * half];
                let ends = |k: usize| {
                    let [x, y] = mix(from, to, super::numbers::real(k) / super::numbers::real(pieces));
                    [[x + across[0], y + across[1]], [x - across[0], y - across[1]]]
                };
                (0..pieces)
                    .map(|k| around(&[ends(k), ends(k + 1)].concat(), 1e-9))
                    .collect()
            }
            Self::Disc { center, radius } => vec![around(&[center], radius)],
            Self::Arc {
                center,
                radius,
                thickness,
                ..
            } => vec![around(&[center], radius + thickness)],
        }
    }

    /// The shape of the inner frame, told in the outer one.
    #[must_use]
    pub fn moved(&self, pose: Pose2) -> Self {
        match *self {
            Self::Bar { from, to, thickness } => Self::Bar {
                from: pose.apply(from),
                to: pose.apply(to),
                thickness,
            },
            Self::Disc { center, radius } => Self::Disc {
                center: pose.apply(center),
                radius,
            },
            Self::Arc {
                center,
                radius,
                thickness,
                start,
                sweep,
            } => Self::Arc {
                center: pose.apply(center),
                radius,
                thickness,
                start: start + pose.yaw().radians(),
                sweep,
            },
        }
    }
}

pub(super) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn norm(a: Point) -> f64 {
    a[0].hypot(a[1])
}

pub(super) fn distance(a: Point, b: Point) -> f64 {
    norm(sub(a, b))
}

/// The point at `share` of the way from a to b.
pub(super) fn mix(a: Point, b: Point, share: f64) -> Point {
    [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share]
}

/// The bounding box of these points, `margin` wider on each side.
pub(super) fn around(points: &[Point], margin: f64) -> [Point; 2] {
    points
        .iter()
        .fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], &[x, y]| {
            [
                [low[0].min(x - margin), low[1].min(y - margin)],
                [high[0].max(x + margin), high[1].max(y + margin)],
            ]
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use proptest::prelude::*;

    fn shape() -> impl Strategy<Value = Shape> {
        let p = || (-5.0..5.0_f64, -5.0..5.0_f64).prop_map(|(x, y)| [x, y]);
        prop_oneof![
            (p(), p(), 0.1..2.0_f64).prop_map(|(from, to, thickness)| Shape::Bar { from, to, thickness }),
            (p(), 0.1..3.0_f64).prop_map(|(center, radius)| Shape::Disc { center, radius }),
            (p(), 0.5..3.0_f64, 0.1..0.4_f64, -4.0..4.0_f64, 0.1..6.2_f64).prop_map(
                |(center, radius, thickness, start, sweep)| Shape::Arc {
                    center,
                    radius,
                    thickness,
                    start,
                    sweep
                }
            ),
        ]
    }

    proptest! {
        #[test]
        fn every_point_of_a_shape_lies_in_one_of_its_boxes(shape in shape(), x in -8.0..8.0_f64, y in -8.0..8.0_f64) {
            let within = |[low, high]: [Point; 2]| (low[0]..=high[0]).contains(&x) && (low[1]..=high[1]).contains(&y);
            prop_assert!(!shape.contains([x, y]) || shape.boxes().into_iter().any(within));
        }

        #[test]
        fn a_moved_shape_contains_the_moved_points(shape in shape(), x in -6.0..6.0_f64, y in -6.0..6.0_f64,
                                                   dx in -9.0..9.0_f64, yaw in -3.0..3.0_f64) {
            let pose = Pose2::new(dx, 1.0, Angle::from_radians(yaw));
            let near_edge = shape.contains([x + 1e-6, y]) != shape.contains([x - 1e-6, y])
                || shape.contains([x, y + 1e-6]) != shape.contains([x, y - 1e-6]);
            prop_assume!(!near_edge);
            prop_assert_eq!(shape.moved(pose).contains(pose.apply([x, y])), shape.contains([x, y]));
        }
    }
}
