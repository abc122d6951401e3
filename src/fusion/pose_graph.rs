//! The pose graph: one pose for each map that explains all accepted registrations best.
//!
//! **Convention.** Nodes are maps, an edge says `pose_a_b` with its covariance (of x, y and yaw in frame a). Some nodes
//! are held where they are: the anchor, and what an operator has fixed.
//!
//! **Method.** Gauss-Newton over SE(2). For an edge with measurement z:
//!
//! 1. residual `e = (R_a^T (t_b - t_a) - t_z, yaw_b - yaw_a - yaw_z)`;
//! 2. step: `(sum J^T W J) d = -sum J^T W e`, with W the inverse covariance;
//! 3. covariance of each pose: its block of `(sum J^T W J)^-1`.
//!
//! Frames are moved to the middle of each map's walls first, because a map's own origin may be far from its content and
//! then x, y and yaw cannot be told apart. Start: the spanning tree of the heaviest edges.
//!
//! **Shapes and units.** Dense, 3 unknowns a node; metres and radians. Each edge's covariance is raised by a floor of
//! [`FLOOR_M`] and [`FLOOR_RAD`]: a lattice does not hold more, and an over-confident pair must not bend all others.
//!
//! **Cost.** `O((3 n)^3)` a step, at most 20 steps; 32 maps take about a millisecond.
//!
//! **Fails when** edges contradict each other: that is settled before (see `consistency`).

use nalgebra::{DMatrix, DVector, Matrix3};

use super::Moments;
use crate::geometry::{Angle, Point, Pose2};
use crate::registration::Covariance;

/// What one pair of maps says of how they lie.
#[derive(Debug, Clone, PartialEq)]
pub struct Edge {
    /// The map in whose frame the pose is told.
    pub a: usize,
    /// The map whose pose is told.
    pub b: usize,
    /// Pose of b's frame in a's frame.
    pub pose_a_b: Pose2,
    /// How well it is known.
    pub covariance: Covariance,
    /// How much speaks for it: the score of its registration.
    pub weight: f64,
    /// Never doubted: an operator's word.
    pub certain: bool,
}

/// Where a map lies by the whole graph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Pose of the map's frame in the frame that the held poses are told in.
    pub pose: Pose2,
    /// How well it is known, relative to the held nodes.
    pub covariance: Covariance,
}

/// No pair of maps is known better than this, in metres.
const FLOOR_M: f64 = 0.005;
/// No pair of maps is known better than this, in radians.
const FLOOR_RAD: f64 = 2e-4;
const STEPS_MAX: usize = 20;

/// The best poses of all nodes that edges connect to a held one; `None` for the others.
#[must_use]
pub fn optimise(moments: &[Moments], edges: &[Edge], held: &[(usize, Pose2)]) -> Vec<Option<Estimate>> {
    let middles: Vec<Pose2> = moments
        .iter()
        .map(|m| Pose2::new(m.mean()[0], m.mean()[1], Angle::ZERO))
        .collect();
    let mut poses: Vec<Option<Pose2>> = spanning_poses(moments.len(), edges, held)
        .into_iter()
        .zip(&middles)
        .map(|(pose, &middle)| pose.map(|pose| pose * middle))
        .collect();
    // where each free node's unknowns begin
    let mut unknowns = 0;
    let columns: Vec<Option<usize>> = (0..moments.len())
        .map(|node| {
            let free = poses[node].is_some() && !held.iter().any(|&(held, _)| held == node);
            free.then(|| {
                unknowns += 3;
                unknowns - 3
            })
        })
        .collect();
    let terms: Vec<Term> = edges
        .iter()
        .filter(|edge| poses[edge.a].is_some() && poses[edge.b].is_some())
        .map(|edge| Term::new(edge, &middles))
        .collect();
    let mut normal = DMatrix::zeros(unknowns, unknowns);
    for _ in 0..STEPS_MAX {
        let mut gradient = DVector::zeros(unknowns);
        normal.fill(0.0);
        for term in &terms {
            term.add_to(&mut normal, &mut gradient, &poses, &columns);
        }
        let Some(factor) = normal.clone().cholesky() else { break };
        let step = factor.solve(&-gradient);
        for (pose, column) in poses.iter_mut().zip(&columns) {
            if let (Some(pose), &Some(column)) = (pose.as_mut(), column) {
                *pose = Pose2::new(
                    pose.x() + step[column],
                    pose.y() + step[column + 1],
                    Angle::from_radians(pose.yaw().radians() + step[column + 2]),
                );
            }
        }
        if step.amax() < 1e-10 {
            break;
        }
    }
    let inverse = normal.cholesky().map(|factor| factor.inverse());
    poses
        .iter()
        .enumerate()
        .zip(&columns)
        .zip(&middles)
        .map(|(((node, pose), column), &middle)| {
            // what is held is told as it was given, not as it comes back from the middle
            let given = held.iter().rfind(|&&(held, _)| held == node);
            let pose = given.map_or((*pose)? * middle.inverse(), |&(_, pose)| pose);
            let covariance = match (column, &inverse) {
                (Some(column), Some(inverse)) => {
                    let block: Matrix3<f64> = inverse.fixed_view::<3, 3>(*column, *column).into_owned();
                    covariance_of(along_lever(pose, middle.inverse().translation(), block))
                }
                _ => Covariance([[0.0; 3]; 3]),
            };
            Some(Estimate { pose, covariance })
        })
        .collect()
}

/// Poses by the spanning tree of the heaviest edges, grown from the held nodes.
#[must_use]
pub fn spanning_poses(nodes: usize, edges: &[Edge], held: &[(usize, Pose2)]) -> Vec<Option<Pose2>> {
    let mut poses = vec![None; nodes];
    for &(node, pose) in held {
        poses[node] = Some(pose);
    }
    loop {
        let heaviest = edges
            .iter()
            .enumerate()
            .filter(|(_, edge)| poses[edge.a].is_some() != poses[edge.b].is_some())
            .max_by(|(i, a), (j, b)| {
                (a.certain.cmp(&b.certain))
                    .then(a.weight.total_cmp(&b.weight))
                    .then(j.cmp(i))
            });
        let Some((_, edge)) = heaviest else { return poses };
        match (poses[edge.a], poses[edge.b]) {
            (Some(pose_a), _) => poses[edge.b] = Some(pose_a * edge.pose_a_b),
            (_, Some(pose_b)) => poses[edge.a] = Some(pose_b * edge.pose_a_b.inverse()),
            _ => return poses,
        }
    }
}

/// An edge between the middles of two maps.
struct Term {
    a: usize,
    b: usize,
    measured: Pose2,
    information: Matrix3<f64>,
}

impl Term {
    fn new(edge: &Edge, middles: &[Pose2]) -> Self {
        let (middle_a, middle_b) = (middles[edge.a], middles[edge.b]);
        let measured = middle_a.inverse() * edge.pose_a_b * middle_b;
        let covariance = Matrix3::from_fn(|row, column| edge.covariance.0[row][column]);
        let mut covariance = along_lever(edge.pose_a_b, middle_b.translation(), covariance);
        for (axis, floor) in [FLOOR_M, FLOOR_M, FLOOR_RAD].into_iter().enumerate() {
            covariance[(axis, axis)] += floor * floor;
        }
        let information = covariance.cholesky().map_or_else(
            || Matrix3::from_diagonal(&[1e2, 1e2, 1e4].into()),
            |factor| factor.inverse(),
        );
        Self {
            a: edge.a,
            b: edge.b,
            measured,
            information,
        }
    }

    /// Equations 1 and 2.
    fn add_to(
        &self,
        normal: &mut DMatrix<f64>,
        gradient: &mut DVector<f64>,
        poses: &[Option<Pose2>],
        columns: &[Option<usize>],
    ) {
        let (Some(a), Some(b)) = (poses[self.a], poses[self.b]) else {
            return;
        };
        let (sin, cos) = a.yaw().sin_cos();
        let (dx, dy) = (b.x() - a.x(), b.y() - a.y());
        let residual = nalgebra::Vector3::new(
            cos * dx + sin * dy - self.measured.x(),
            cos * dy - sin * dx - self.measured.y(),
            (b.yaw() - a.yaw() - self.measured.yaw()).radians(),
        );
        #[rustfmt::skip]
        let jacobian_a = Matrix3::new(
            -cos, -sin, cos * dy - sin * dx,
            sin, -cos, -cos * dx - sin * dy,
            0.0, 0.0, -1.0,
        );
        #[rustfmt::skip]
        let jacobian_b = Matrix3::new(
            cos, sin, 0.0,
            -sin, cos, 0.0,
            0.0, 0.0, 1.0,
        );
        let sides = [(columns[self.a], jacobian_a), (columns[self.b], jacobian_b)];
        for (row, left) in &sides {
            let &Some(row) = row else { continue };
            let weighted = left.transpose() * self.information;
            let mut part = gradient.fixed_rows_mut::<3>(row);
            part += weighted * residual;
            for (column, right) in &sides {
                let &Some(column) = column else { continue };
                let mut block = normal.fixed_view_mut::<3, 3>(row, column);
                block += weighted * right;
            }
        }
    }
}

/// A covariance of (x, y, yaw) moved along a lever of the turning frame: the lever swings with the yaw.
fn along_lever(pose: Pose2, lever: Point, covariance: Matrix3<f64>) -> Matrix3<f64> {
    let [x, y] = pose.motion().rotate(lever);
    #[rustfmt::skip]
    let jacobian = Matrix3::new(
        1.0, 0.0, -y,
        0.0, 1.0, x,
        0.0, 0.0, 1.0,
    );
    jacobian * covariance * jacobian.transpose()
}

fn covariance_of(matrix: Matrix3<f64>) -> Covariance {
    Covariance(std::array::from_fn(|row| {
        std::array::from_fn(|column| matrix[(row, column)])
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pose(x: f64, y: f64, degrees: f64) -> Pose2 {
        Pose2::new(x, y, Angle::from_degrees(degrees))
    }

    fn edge(a: usize, b: usize, pose_a_b: Pose2, sigma_m: f64) -> Edge {
        Edge {
            a,
            b,
            pose_a_b,
            covariance: Covariance::diagonal(sigma_m, sigma_m / 10.0),
            weight: 1.0 / sigma_m,
            certain: false,
        }
    }

    #[test]
    fn a_loop_spreads_its_error_by_the_covariances() {
        // 0 -> 1 -> 2 says x = 2, the worse-known shortcut says 2.3
        let moments = [Moments::new([0.0, 0.0], 1.0); 3];
        let edges = [
            edge(0, 1, pose(1.0, 0.0, 0.0), 0.1),
            edge(1, 2, pose(1.0, 0.0, 0.0), 0.1),
            edge(0, 2, pose(2.3, 0.0, 0.0), 0.2),
        ];
        let estimates = optimise(&moments, &edges, &[(0, Pose2::IDENTITY)]);
        let x = estimates[2].expect("connected").pose.x();
        // weighted mean of 2.0 (variance 0.02) and 2.3 (variance 0.04)
        assert!((x - 2.1).abs() < 2e-3, "{x}");
        let variance = estimates[2].expect("connected").covariance.0[0][0];
        assert!((variance - 0.02 * 0.04 / 0.06).abs() < 2e-3, "{variance}");
        assert_eq!(estimates[0].expect("held").covariance, Covariance([[0.0; 3]; 3]));
    }

    #[test]
    fn nodes_that_no_edge_connects_to_a_held_one_have_no_pose() {
        let moments = [Moments::new([3.0, 0.0], 1.0); 4];
        let edges = [
            edge(0, 1, pose(1.0, 0.0, 90.0), 0.1),
            edge(2, 3, pose(1.0, 0.0, 0.0), 0.1),
        ];
        let estimates = optimise(&moments, &edges, &[(0, pose(5.0, 5.0, 90.0))]);
        let placed = estimates[1].expect("connected").pose;
        assert!((placed.x() - 5.0).abs() < 1e-9 && (placed.y() - 6.0).abs() < 1e-9);
        assert!(estimates[2].is_none() && estimates[3].is_none());
    }

    proptest! {
        #[test]
        fn exact_edges_give_exact_poses_wherever_the_maps_lie_in_their_frames(
            truth in proptest::collection::vec((-50.0..50.0_f64, -50.0..50.0_f64, -180.0..180.0_f64), 5),
            means in proptest::collection::vec((-90.0..90.0_f64, -90.0..90.0_f64), 5),
        ) {
            let truth: Vec<Pose2> = truth.into_iter().map(|(x, y, yaw)| pose(x, y, yaw)).collect();
            let moments: Vec<Moments> = means.into_iter().map(|(x, y)| Moments::new([x, y], 8.0)).collect();
            let edges: Vec<Edge> = [(0, 1), (2, 1), (2, 3), (3, 4), (4, 0), (1, 4)]
                .into_iter()
                .map(|(a, b)| edge(a, b, truth[a].inverse() * truth[b], 0.05))
                .collect();
            let estimates = optimise(&moments, &edges, &[(0, truth[0])]);
            for node in 0..5 {
                let estimate = estimates[node].expect("connected");
                prop_assert!(moments[node].distance(estimate.pose, truth[node]) < 1e-6);
            }
            prop_assert_eq!(estimates[0].expect("held").pose, truth[0], "held is as given, to the last bit");
        }
    }
}
