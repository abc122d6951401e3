//! The parameters of the paper's pipeline: unit, range, default and source of each.

use serde::{Deserialize, Serialize};

use crate::registration::methods::ParameterError;
use crate::registration::methods::shared::peaks::PeakRule;
pub use crate::registration::methods::shared::spectrum::Spectrum;
pub use crate::registration::methods::shared::verification::Disagreement;
use crate::registration::methods::shared::verification::Rule;

/// All tuning constants of `hough-peaks`. "Table 2" is the paper's table of nominal values; "ours" marks what the paper
/// leaves open. Cells are those of the coarser of the two maps; votes are occupied cells on a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HoughPeaksParams {
    /// Metres of occupied cells that each map needs to be registered at all. Metres, 0 to 1000. Default 3 (ours).
    pub wall_min_m: f64,
    /// Width of the strip around a line whose cells vote for it. Cells, odd, 1 to 15. Default 3 (ours): the cells of one
    /// wall lie within a cell to both sides of its line, so that with 1 the votes of a wall depend on how it lies.
    pub line_width_cells: u32,
    /// Votes of the weakest local peak over those of the strongest (eq. 20). A share, 0.01 to 1. Default 0.1 (ours).
    pub peak_fraction: f64,
    /// A local peak is the greatest within this many degrees to both sides. Degrees, 1 to 45. Default 3 (ours).
    pub peak_separation_degrees: f64,
    /// A local peak is the greatest within this many cells to both sides. Cells, 1 to 1000. Default 5 (ours).
    pub peak_separation_cells: u32,
    /// At most so many of the strongest local peaks are used. A number, 2 to 10000. Default 200 (ours).
    pub peaks_max: u32,
    /// Peaks are associated when their votes differ by less than this (Algorithms 1 and 2). Votes, above 0 to 1e6.
    /// Default 10 (Table 2).
    pub v_gate: f64,
    /// How associated peaks estimate the rotation (Algorithm 1 line 11).
    pub psi_hat: PsiHat,
    /// The order invariant function f of a column of the Hough image (eq. 22).
    pub spectrum: Spectrum,
    /// Maxima of the circular cross-correlation that are kept (eq. 25), each with its half turn. A number, 1 to 16.
    /// Default 4 (ours).
    pub rotation_candidates: u32,
    /// Two maxima of the correlation are at least so far apart. Degrees, 1 to 45. Default 6 (ours).
    pub candidate_separation_degrees: f64,
    /// How one of the rotation hypotheses is chosen (eq. 26).
    pub rotation_choice: RotationChoice,
    /// How the rotation is tuned (eq. 27).
    pub rotation_tuning: RotationTuning,
    /// Half the interval of the rotation tuning, the paper's Lambda. Degrees, 0.1 to 5. Default 1 (Table 2).
    pub lambda_degrees: f64,
    /// Angular resolution of the rotation tuning. Degrees, 0.01 to 1. Default 0.1 (ours; the paper: "higher than 1").
    pub tuning_step_degrees: f64,
    /// Peaks are associated when their distances rho differ by less than this (Algorithm 2). Cells, above 0 to 1e5.
    /// Default 30 (Table 2).
    pub d_gate: f64,
    /// Peaks are associated when their directions differ by at most this, the paper's delta. Degrees, 0 to 10.
    /// Default 1 (section 4.2).
    pub delta_degrees: f64,
    /// Which peaks of one direction are associated (Algorithm 2 line 3).
    pub pairing: Pairing,
    /// How often peaks are matched, each time from the translation found before and with half the `d_gate`. A number, 1
    /// to 6. Default 3 (ours; the paper's section 4.2 takes 1 and mentions more).
    pub matching_rounds: u32,
    /// Metres of associated wall that must hold the translation in the direction in which it is held worst: the rank
    /// test of eq. 30. Metres, 0 to 1000. Default 1 (ours).
    pub support_min_m: f64,
    /// What the exhaustive search for the translation optimises (eq. 32).
    pub translation_tuning: TranslationTuning,
    /// Half the width of that search, the paper's Delta x. Cells, 0 to 64. Default 10 (Table 2).
    pub delta_x: u32,
    /// Half the height of that search, the paper's Delta y. Cells, 0 to 64. Default 10 (Table 2).
    pub delta_y: u32,
    /// Which cells count as disagreement (eq. 33).
    pub disagreement: Disagreement,
    /// The verification index that an answer needs (eq. 34). A share, 0 to 1. Default 0.92 (Table 2).
    pub verification_threshold: f64,
    /// The overlap that an answer needs; V of a few cells means nothing. A share, 0 to 1. Default 0.1 (ours: the least
    /// overlap of the paper's section 6.4).
    pub overlap_min: f64,
    /// Whether the best hypothesis is the answer even when its verification index is below the threshold. Default false:
    /// nothing below the threshold is ever published (eq. 34).
    pub accept_unverified: bool,
}

/// How associated peaks estimate the rotation (Algorithm 1 line 11).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PsiHat {
    /// Half the circular mean of the doubled differences of direction: a line has no sign, so its direction has period
    /// 180 degrees.
    #[default]
    CircularMean,
    /// The paper's formula, read as radians: the mean difference of the tangents. Not an angle, and unbounded.
    MeanOfTangents,
}

/// How one of the rotation hypotheses is chosen (eq. 26).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RotationChoice {
    /// All of them go through all stages, and the verification decides.
    #[default]
    BestVerified,
    /// The paper's eq. 26: the one nearest to psi-hat, before anything else is known.
    NearestToPsiHat,
}

/// How the rotation is tuned (eq. 27).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RotationTuning {
    /// In windows of +-Lambda around the strongest wall directions common to both maps.
    #[default]
    WallDirections,
    /// The paper's window: +-Lambda around the rotation itself, where there need be no wall.
    PaperWindow,
    /// Not at all.
    Off,
}

/// Which peaks of one direction are associated (Algorithm 2 line 3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Pairing {
    /// Each peak of the fixed map with its nearest of the moving one, as the paper's text has it.
    #[default]
    EveryPeak,
    /// Of all peaks of one direction the one nearest couple, as the paper's Algorithm 2 has it.
    BestPerAngle,
}

/// What the exhaustive search for the translation optimises (eq. 32).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TranslationTuning {
    /// The greatest verification index.
    #[default]
    VerificationIndex,
    /// The paper's: the smallest entropy of the fused map.
    Entropy,
    /// Not at all.
    Off,
}

impl Default for HoughPeaksParams {
    fn default() -> Self {
        Self {
            wall_min_m: 3.0,
            line_width_cells: 3,
            peak_fraction: 0.1,
            peak_separation_degrees: 3.0,
            peak_separation_cells: 5,
            peaks_max: 200,
            v_gate: 10.0,
            psi_hat: PsiHat::default(),
            spectrum: Spectrum::default(),
            rotation_candidates: 4,
            candidate_separation_degrees: 6.0,
            rotation_choice: RotationChoice::default(),
            rotation_tuning: RotationTuning::default(),
            lambda_degrees: 1.0,
            tuning_step_degrees: 0.1,
            d_gate: 30.0,
            delta_degrees: 1.0,
            pairing: Pairing::default(),
            matching_rounds: 3,
            support_min_m: 1.0,
            translation_tuning: TranslationTuning::default(),
            delta_x: 10,
            delta_y: 10,
            disagreement: Disagreement::default(),
            verification_threshold: 0.92,
            overlap_min: 0.1,
            accept_unverified: false,
        }
    }
}

impl HoughPeaksParams {
    /// Every line of the paper as it is printed, also where it is unsound: what the paper's own method does.
    #[must_use]
    pub fn literal() -> Self {
        Self {
            line_width_cells: 1,
            psi_hat: PsiHat::MeanOfTangents,
            rotation_choice: RotationChoice::NearestToPsiHat,
            rotation_tuning: RotationTuning::PaperWindow,
            pairing: Pairing::BestPerAngle,
            matching_rounds: 1,
            translation_tuning: TranslationTuning::Entropy,
            disagreement: Disagreement::KnownInOne,
            overlap_min: 0.0,
            ..Self::default()
        }
    }

    /// The same parameters, when all lie within their ranges.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that does not, its value and its limits.
    pub fn checked(self) -> Result<Self, ParameterError> {
        use ParameterError as P;
        P::check("wall_min_m", self.wall_min_m, 0.0, 1000.0, "m")?;
        P::check("line_width_cells", f64::from(self.line_width_cells), 1.0, 15.0, "cells")?;
        if self.line_width_cells.is_multiple_of(2) {
            return Err(P::Even {
                field: "line_width_cells",
                value: self.line_width_cells,
            });
        }
        P::check("peak_fraction", self.peak_fraction, 0.01, 1.0, "of the strongest peak")?;
        P::check(
            "peak_separation_degrees",
            self.peak_separation_degrees,
            1.0,
            45.0,
            "degrees",
        )?;
        P::check(
            "peak_separation_cells",
            f64::from(self.peak_separation_cells),
            1.0,
            1000.0,
            "cells",
        )?;
        P::check("peaks_max", f64::from(self.peaks_max), 2.0, 10_000.0, "peaks")?;
        P::check("v_gate", self.v_gate, f64::MIN_POSITIVE, 1e6, "votes")?;
        P::check(
            "rotation_candidates",
            f64::from(self.rotation_candidates),
            1.0,
            16.0,
            "candidates",
        )?;
        P::check(
            "candidate_separation_degrees",
            self.candidate_separation_degrees,
            1.0,
            45.0,
            "degrees",
        )?;
        P::check("lambda_degrees", self.lambda_degrees, 0.1, 5.0, "degrees")?;
        P::check("tuning_step_degrees", self.tuning_step_degrees, 0.01, 1.0, "degrees")?;
        P::check("d_gate", self.d_gate, f64::MIN_POSITIVE, 1e5, "cells")?;
        P::check("delta_degrees", self.delta_degrees, 0.0, 10.0, "degrees")?;
        P::check("matching_rounds", f64::from(self.matching_rounds), 1.0, 6.0, "rounds")?;
        P::check("support_min_m", self.support_min_m, 0.0, 1000.0, "m")?;
        P::check("delta_x", f64::from(self.delta_x), 0.0, 64.0, "cells")?;
        P::check("delta_y", f64::from(self.delta_y), 0.0, 64.0, "cells")?;
        self.rule().check()?;
        Ok(self)
    }

    /// When a hypothesis is accepted.
    pub(super) fn rule(&self) -> Rule {
        Rule {
            disagreement: self.disagreement,
            threshold: self.verification_threshold,
            overlap_min: self.overlap_min,
            accept_unverified: self.accept_unverified,
        }
    }

    /// What a local peak is.
    pub(super) fn peak_rule(&self) -> PeakRule {
        PeakRule {
            fraction: self.peak_fraction,
            separation_degrees: self.peak_separation_degrees,
            separation_cells: self.peak_separation_cells,
            most: self.peaks_max,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_the_nominal_values_of_table_2() {
        let params = HoughPeaksParams::default();
        assert_eq!(params.clone().checked(), Ok(params.clone()));
        let nominal = [
            params.v_gate,
            params.lambda_degrees,
            params.d_gate,
            params.verification_threshold,
        ];
        assert_eq!(nominal, [10.0, 1.0, 30.0, 0.92]);
        assert_eq!((params.delta_x, params.delta_y), (10, 10));
        let literal = HoughPeaksParams::literal();
        assert_eq!(literal.clone().checked(), Ok(literal));
    }

    #[test]
    fn a_value_out_of_range_is_refused_by_name_value_and_limit() {
        let bad = HoughPeaksParams {
            verification_threshold: 92.0,
            ..HoughPeaksParams::default()
        };
        let message = bad.checked().expect_err("92 is no share").to_string();
        assert!(message.contains("verification_threshold") && message.contains("92") && message.contains('1'));
        let even = HoughPeaksParams {
            line_width_cells: 4,
            ..HoughPeaksParams::default()
        };
        assert!(
            even.checked()
                .expect_err("even")
                .to_string()
                .contains("line_width_cells")
        );
        let nan = HoughPeaksParams {
            v_gate: f64::NAN,
            ..HoughPeaksParams::default()
        };
        assert!(nan.checked().is_err());
    }
}
