//! A coarse look ahead: what a tour would see, at a hundredth of the cost of drawing its map.

use super::numbers::{count, index, real};
use super::{Lidar, Scene, Tour};
use crate::grid::Lattice;

/// Which 0.2 m cells of the world a tour sees, roughly: every other pose, some 120 beams.
pub(super) struct Preview {
    lattice: Lattice,
    seen: Vec<bool>,
    count: usize,
}

impl Preview {
    const RESOLUTION: f64 = 0.2;

    /// The cells of a scene.
    pub(super) fn lattice(scene: &Scene) -> Lattice {
        let fine = scene.lattice();
        let cells = |count: u32| index((f64::from(count) * fine.resolution() / Self::RESOLUTION).ceil());
        Lattice::new(
            cells(fine.width()),
            cells(fine.height()),
            Self::RESOLUTION,
            fine.origin(),
        )
        .expect("invariant: coarser than the scene's own lattice")
    }

    /// What the tour sees.
    pub(super) fn of(scene: &Scene, lattice: Lattice, tour: &Tour, lidar: &Lidar) -> Self {
        let mut seen = vec![false; lattice.cell_count()];
        let every = if tour.poses.len() > 20 { 2 } else { 1 };
        for pose in tour.poses.iter().step_by(every) {
            for beam in (0..lidar.beams()).step_by((lidar.beams() / 120).max(1)) {
                let direction = pose.yaw() + lidar.direction(beam);
                let Some(range) = scene.cast(pose.translation(), direction, lidar.max_range()) else {
                    continue;
                };
                let (sin, cos) = direction.sin_cos();
                for step in 0..=count(range / (0.7 * Self::RESOLUTION)) {
                    let at = 0.7 * Self::RESOLUTION * real(step);
                    if let Some((column, row)) = lattice.cell_at([pose.x() + at * cos, pose.y() + at * sin]) {
                        seen[lattice.index(column, row)] = true;
                    }
                }
            }
        }
        let count = seen.iter().filter(|&&s| s).count();
        Self { lattice, seen, count }
    }

    /// What both see, as a share of what the one that sees less does.
    pub(super) fn overlap(&self, other: &Self) -> f64 {
        let both = self.seen.iter().zip(&other.seen).filter(|(a, b)| **a && **b).count();
        real(both) / real(self.count.min(other.count).max(1))
    }

    /// Whether no cell of one is within three cells of one of the other.
    pub(super) fn is_apart_from(&self, other: &Self) -> bool {
        let (width, height) = (self.lattice.width(), self.lattice.height());
        (0..height).all(|row| {
            (0..width).all(|column| {
                !self.seen[self.lattice.index(column, row)]
                    || (row.saturating_sub(3)..(row + 4).min(height)).all(|j| {
                        (column.saturating_sub(3)..(column + 4).min(width))
                            .all(|i| !other.seen[other.lattice.index(i, j)])
                    })
            })
        })
    }
}
