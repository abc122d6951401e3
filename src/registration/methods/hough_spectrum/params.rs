//! The parameters of `hough-spectrum`: unit, range, default and source of each.

use serde::{Deserialize, Serialize};

use crate::registration::methods::ParameterError;
use crate::registration::methods::shared::verification::{Disagreement, Rule};

/// All tuning constants of `hough-spectrum`. "Carpin" is S. Carpin: Fast and accurate map merging for multi-robot systems
/// (2008) and the library that goes with it; "Table 2" is that of Saeedi et al.; "ours" marks what both leave open.
/// Cells are those of the coarser of the two maps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HoughSpectrumParams {
    /// Metres of occupied cells that each map needs to be registered at all. Metres, 0 to 1000. Default 3 (ours).
    pub wall_min_m: f64,
    /// Maxima of the circular cross-correlation that are followed up, each with its half turn. A number, 1 to 32.
    /// Default 4 (Carpin).
    pub rotation_candidates: u32,
    /// Two maxima of the correlation are at least so far apart. Degrees, 1 to 45. Default 6 (ours).
    pub candidate_separation_degrees: f64,
    /// Rotations that are tried on each side of each candidate. A number, 0 to 8. Default 1 (Carpin's robust version).
    pub rotations_around: u32,
    /// Step between those. Degrees, 0.05 to 5. Default 0.5 (ours: the candidates lie between the columns; Carpin: 1).
    pub rotation_step_degrees: f64,
    /// The verification index that an answer needs (eq. 34). A share, 0 to 1. Default 0.92 (Table 2).
    pub verification_threshold: f64,
    /// The overlap that an answer needs; V of a few cells means nothing. A share, 0 to 1. Default 0.1 (ours, as in
    /// `hough-peaks`).
    pub overlap_min: f64,
    /// Whether the best hypothesis is the answer even when its verification index is below the threshold. Default false.
    pub accept_unverified: bool,
}

impl Default for HoughSpectrumParams {
    fn default() -> Self {
        Self {
            wall_min_m: 3.0,
            rotation_candidates: 4,
            candidate_separation_degrees: 6.0,
            rotations_around: 1,
            rotation_step_degrees: 0.5,
            verification_threshold: 0.92,
            overlap_min: 0.1,
            accept_unverified: false,
        }
    }
}

impl HoughSpectrumParams {
    /// Whether all lie within their ranges.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that does not, its value and its limits.
    pub fn validate(&self) -> Result<(), ParameterError> {
        use ParameterError as P;
        P::check("wall_min_m", self.wall_min_m, 0.0, 1000.0, "m")?;
        P::check(
            "rotation_candidates",
            f64::from(self.rotation_candidates),
            1.0,
            32.0,
            "candidates",
        )?;
        P::check(
            "candidate_separation_degrees",
            self.candidate_separation_degrees,
            1.0,
            45.0,
            "degrees",
        )?;
        P::check(
            "rotations_around",
            f64::from(self.rotations_around),
            0.0,
            8.0,
            "rotations",
        )?;
        P::check(
            "rotation_step_degrees",
            self.rotation_step_degrees,
            0.05,
            5.0,
            "degrees",
        )?;
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
