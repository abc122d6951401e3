//! The parameters of `fourier-hough`: unit, range, default and source of each.

use serde::{Deserialize, Serialize};

use crate::registration::methods::ParameterError;
pub use crate::registration::methods::shared::plane::FourierCorrelation;
use crate::registration::methods::shared::verification::{Disagreement, Rule};

/// All tuning constants of `fourier-hough`. "Section 6.2" and "Table 2" are those of Saeedi et al.; "ours" marks what they
/// and their sources leave open. Cells are those of the coarser of the two maps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FourierHoughParams {
    /// Metres of occupied cells that each map needs to be registered at all. Metres, 0 to 1000. Default 3 (ours).
    pub wall_min_m: f64,
    /// The highest frequency along rho that takes part in the rotation. Cycles a cell, 0.005 to 0.5. Default 0.1 (ours:
    /// finer detail of a column is gone half a degree further).
    pub frequency_max: f64,
    /// Maxima of the phase correlation along theta that are followed up, each with its half turn. A number, 1 to 32.
    /// Default 1 (section 6.2: "the relative orientation").
    pub rotation_candidates: u32,
    /// Two of these maxima are at least so far apart. Degrees, 1 to 45. Default 6 (ours).
    pub candidate_separation_degrees: f64,
    /// How the aligned maps are correlated. Default cross (section 6.2: "a 2D convolution using the Fourier transform");
    /// phase is what the title of its reference 7 names.
    pub translation: FourierCorrelation,
    /// Maxima of that correlation that are verified. A number, 1 to 64. Default 1 (section 6.2).
    pub translation_candidates: u32,
    /// Two of these maxima are at least so far apart on an axis. Cells, 1 to 64. Default 10 (ours).
    pub translation_separation_cells: u32,
    /// The longest side of the padded picture of both maps; larger maps are correlated in larger cells. Cells, 64 to
    /// 8192. Default 2048 (ours: 32 MB an array).
    pub side_max_cells: u32,
    /// The verification index that an answer needs (eq. 34). A share, 0 to 1. Default 0.92 (Table 2).
    pub verification_threshold: f64,
    /// The overlap that an answer needs; V of a few cells means nothing. A share, 0 to 1. Default 0.1 (ours, as in
    /// `hough-peaks`).
    pub overlap_min: f64,
    /// Whether the best hypothesis is the answer even when its verification index is below the threshold. Default false.
    pub accept_unverified: bool,
}

impl Default for FourierHoughParams {
    fn default() -> Self {
        Self {
            wall_min_m: 3.0,
            frequency_max: 0.1,
            rotation_candidates: 1,
            candidate_separation_degrees: 6.0,
            translation: FourierCorrelation::default(),
            translation_candidates: 1,
            translation_separation_cells: 10,
            side_max_cells: 2048,
            verification_threshold: 0.92,
            overlap_min: 0.1,
            accept_unverified: false,
        }
    }
}

impl FourierHoughParams {
    /// Whether all lie within their ranges.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that does not, its value and its limits.
    pub fn validate(&self) -> Result<(), ParameterError> {
        use ParameterError as P;
        let count = |field, value: u32, max, unit| P::check(field, f64::from(value), 1.0, max, unit);
        P::check("wall_min_m", self.wall_min_m, 0.0, 1000.0, "m")?;
        P::check("frequency_max", self.frequency_max, 0.005, 0.5, "cycles a cell")?;
        count("rotation_candidates", self.rotation_candidates, 32.0, "candidates")?;
        P::check(
            "candidate_separation_degrees",
            self.candidate_separation_degrees,
            1.0,
            45.0,
            "degrees",
        )?;
        count(
            "translation_candidates",
            self.translation_candidates,
            64.0,
            "candidates",
        )?;
        count(
            "translation_separation_cells",
            self.translation_separation_cells,
            64.0,
            "cells",
        )?;
        P::check("side_max_cells", f64::from(self.side_max_cells), 64.0, 8192.0, "cells")?;
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
