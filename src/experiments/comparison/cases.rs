//! The pairs that the methods are compared on.

use std::sync::Arc;

use crate::experiments::ExperimentError;
use crate::experiments::frames::far;
use crate::experiments::worlds::{self, Mapped};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::simulation::{Random, compare};
/// Maps that have less in common need not be merged.
pub(super) const FAINT: f64 = 0.1;

/// A pair of table 3.
pub(super) struct Case {
    /// 0 to 3 for the paper's experiments, 4 for maps of two of them.
    pub(super) experiment: usize,
    /// Whether the frames lie within 20 cells of each other.
    pub(super) near: bool,
    pub(super) fixed: Arc<OccupancyGrid>,
    pub(super) moving: Arc<OccupancyGrid>,
    /// `None` when the maps are of two places.
    pub(super) truth: Option<Pose2>,
    /// They have so little in common that refusing is as good as merging.
    pub(super) faint: bool,
}

pub(super) const EXPERIMENTS: [&str; 5] = [
    "1 two maps",
    "2 four robots",
    "3 two robots",
    "4 three robots",
    "maps of two places",
];

/// The pairs of all four experiments in both kinds of frames, and some of maps of two places.
pub(super) fn cases_of(seed: u64, quick: bool) -> Result<Vec<Case>, ExperimentError> {
    let teams: Vec<Vec<Mapped>> = if quick {
        vec![
            Vec::new(),
            Vec::new(),
            worlds::two_robots(seed)?,
            worlds::three_robots(seed)?,
        ]
    } else {
        vec![
            worlds::two_maps(seed)?,
            worlds::four_robots(seed)?,
            worlds::two_robots(seed)?,
            worlds::three_robots(seed)?,
        ]
    };
    let mut random = Random::new(seed, &[3]);
    let mut cases = Vec::new();
    for (experiment, team) in teams.iter().enumerate() {
        for (a, fixed) in team.iter().enumerate() {
            for moving in &team[a + 1..] {
                let truth = fixed.pose_of(moving);
                let faint = compare(&fixed.map, &moving.map, truth).overlap < FAINT;
                let stays = Arc::new(fixed.map.clone());
                let (elsewhere, far_truth) = far(&moving.map, truth, &mut random);
                for (near, moving, truth) in [(true, moving.map.clone(), truth), (false, elsewhere, far_truth)] {
                    cases.push(Case {
                        experiment,
                        near,
                        fixed: Arc::clone(&stays),
                        moving: Arc::new(moving),
                        truth: Some(truth),
                        faint,
                    });
                }
            }
        }
    }
    let mut apart = |a: &[Mapped], b: &[Mapped]| {
        if let (Some(fixed), Some(moving)) = (a.first(), b.last()) {
            cases.push(Case {
                experiment: 4,
                near: true,
                fixed: Arc::new(fixed.map.clone()),
                moving: Arc::new(moving.map.clone()),
                truth: None,
                faint: false,
            });
        }
    };
    for (a, b) in [(0, 3), (1, 2), (2, 3), (3, 1), (0, 1), (2, 0)] {
        apart(&teams[a], &teams[b]);
    }
    Ok(cases)
}
