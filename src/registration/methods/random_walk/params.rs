//! The parameters of `random-walk`: unit, range, default and source of each.

use serde::{Deserialize, Serialize};

use crate::registration::methods::ParameterError;
use crate::registration::methods::shared::verification::{Disagreement, Rule};

/// All tuning constants of `random-walk`. "Birk and Carpin" is their "Merging occupancy grid maps from multiple robots"
/// (2006); "Table 2" and "section 6.2" are those of Saeedi et al.; "ours" marks what all of them leave open. Cells are those of
/// the coarser of the two maps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RandomWalkParams {
    /// Metres of occupied cells that each map needs to be registered at all. Metres, 0 to 1000. Default 3 (ours).
    pub wall_min_m: f64,
    /// Seed of all draws: the same seed gives the same answer. 0 to 2^64 - 1. Default 1 (ours).
    pub seed: u64,
    /// Rotations of the set that is tried first, spread over the full turn. A number, 1 to 720. Default 72 (ours;
    /// section 6.2: "a set of known rotations and translations").
    pub start_rotations: u32,
    /// Translations of that set on each axis, spread so that the moving map's middle lies everywhere on the fixed map. A
    /// number, 1 to 200. Default 32 (ours).
    pub start_translations: u32,
    /// Cells of each state of each map that the set is tried with. Cells, 10 to 100000. Default 64 (ours).
    pub start_samples: u32,
    /// Walks, each from the best start that is not another's. A number, 1 to 64. Default 8 (ours; section 6.2 takes the best
    /// start alone).
    pub walks: u32,
    /// Steps of each walk. A number, 1 to 1000000. Default 1500 (ours).
    pub steps: u32,
    /// Cells of each state of each map that a walk looks at. Cells, 10 to 1000000. Default 400 (ours; Birk and Carpin look at
    /// all).
    pub samples: u32,
    /// Distances above this count as this: so far from any cell of its state a cell says nothing more. Cells, 1 to 255.
    /// Default 20 (ours; Birk and Carpin have no bound, and then prefer much over much to a partial overlap).
    pub distance_max_cells: u32,
    /// Weight of the lock, the share of disagreeing less that of agreeing cells, in cells of mean distance. Cells, 0 to
    /// 10000. Default 80 (ours; Birk and Carpin weigh the numbers of cells by a constant).
    pub lock_cells: f64,
    /// Probability that a step to a worse place is taken, the random selector. A share, 0 to 1. Default 0.01 (ours; Birk and
    /// Carpin leave it open).
    pub worse_probability: f64,
    /// Standard deviation of the first steps on each axis. Metres, 0.001 to 100. Default 1 (ours).
    pub sigma_translation_m: f64,
    /// Standard deviation of the first steps' rotation. Degrees, 0.01 to 180. Default 5 (ours).
    pub sigma_rotation_degrees: f64,
    /// Weight of the newest step in the mean and the variance that the walk adapts. A share, 0.001 to 1. Default 0.05
    /// (ours).
    pub adaptation: f64,
    /// The verification index that an answer needs (eq. 34). A share, 0 to 1. Default 0.92 (Table 2).
    pub verification_threshold: f64,
    /// The overlap that an answer needs; V of a few cells means nothing. A share, 0 to 1. Default 0.1 (ours, as in
    /// `hough-peaks`).
    pub overlap_min: f64,
    /// Whether the best hypothesis is the answer even when its verification index is below the threshold. Default false.
    pub accept_unverified: bool,
}

impl Default for RandomWalkParams {
    fn default() -> Self {
        Self {
            wall_min_m: 3.0,
            seed: 1,
            start_rotations: 72,
            start_translations: 32,
            start_samples: 64,
            walks: 8,
            steps: 1500,
            samples: 400,
            distance_max_cells: 20,
            lock_cells: 80.0,
            worse_probability: 0.01,
            sigma_translation_m: 1.0,
            sigma_rotation_degrees: 5.0,
            adaptation: 0.05,
            verification_threshold: 0.92,
            overlap_min: 0.1,
            accept_unverified: false,
        }
    }
}

impl RandomWalkParams {
    /// Whether all lie within their ranges.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that does not, its value and its limits.
    pub fn validate(&self) -> Result<(), ParameterError> {
        use ParameterError as P;
        let count = |field, value: u32, min, max, unit| P::check(field, f64::from(value), min, max, unit);
        P::check("wall_min_m", self.wall_min_m, 0.0, 1000.0, "m")?;
        count("start_rotations", self.start_rotations, 1.0, 720.0, "rotations")?;
        count(
            "start_translations",
            self.start_translations,
            1.0,
            200.0,
            "translations",
        )?;
        count("start_samples", self.start_samples, 10.0, 1e5, "cells")?;
        count("walks", self.walks, 1.0, 64.0, "walks")?;
        count("steps", self.steps, 1.0, 1e6, "steps")?;
        count("samples", self.samples, 10.0, 1e6, "cells")?;
        count("distance_max_cells", self.distance_max_cells, 1.0, 255.0, "cells")?;
        P::check("lock_cells", self.lock_cells, 0.0, 1e4, "cells")?;
        P::check("worse_probability", self.worse_probability, 0.0, 1.0, "(a probability)")?;
        P::check("sigma_translation_m", self.sigma_translation_m, 0.001, 100.0, "m")?;
        P::check(
            "sigma_rotation_degrees",
            self.sigma_rotation_degrees,
            0.01,
            180.0,
            "degrees",
        )?;
        P::check("adaptation", self.adaptation, 0.001, 1.0, "(a share)")?;
        self.rule().check()
    }

    /// When a hypothesis is accepted.
    pub(super) fn rule(&self) -> Rule {
        Rule {
            disagreement: Disagreement::KnownInBoth,
            threshold: self.verification_threshold,
            overlap_min: self.overlap_min,
            accept_unverified: self.accept_unverified,
        }
    }
}
