//! `hough-peaks`: the pipeline of Saeedi, Paull, Trentini, Seto and Li, "Map merging for multiple robots using Hough peak
//! matching", stage by stage.
//!
//! May import what the room `registration` may: `geometry`, `grid`, and the room's own types.
//!
//! **Convention.** The answer is `pose_fixed_moving`; map 1 of the paper is the fixed map, map 2 the moving one. The maps'
//! own metric frames are the common coordinates, in cells of the coarser map.
//!
//! **Method.** Of each map alone ([`Method::features`]): the Hough image (`hough_image`, eq. 1), its local peaks (`peaks`,
//! eq. 20) and its spectrum h(theta) (`spectrum`, eq. 22). Of a pair, under these stage names:
//!
//! 1. `rotation candidates`: peak association with `v_gate` and psi-hat (`psi_hat`, Algorithm 1 l. 1-11); circular
//!    cross-correlation of the spectra and the choice among its maxima (`spectrum`, l. 12-15, eq. 22-26);
//! 2. `rotation tuning` within +-Lambda (`rotation_tuning`, l. 16-19, eq. 27);
//! 3. `peak matching`: peaks of the fixed and the rotated moving map within `d_gate` and `v_gate`, and least squares for T
//!    (`translation`, Algorithm 2 l. 1-11, eq. 28-30);
//! 4. `translation tuning`, the paper's entropy tuning (`translation_tuning`, l. 12, eq. 31-32);
//! 5. `verification`: V and its threshold (`verification`, eq. 33-34).
//!
//! **Shapes and units.** Inside the stages lengths are cells, weights are votes (occupied cells on a line), angles radians;
//! in and out go metres.
//!
//! **Cost.** Linear in occupied cells times 180 columns for the Hough images, one of the moving map per candidate rotation;
//! then the exhaustive search of stage 4 per hypothesis, which takes most of the time.
//!
//! **Fails when** the frames of the maps are far apart: `d_gate` of 30 cells presupposes that the translation between them
//! is of that size (the robots started near each other), at any rotation; when walls are seen in different lengths by the
//! two robots, so that no votes agree; and V does not tell a wrong pose from a right one reliably. The default method
//! `hough` has none of these limits.
//!
//! **Differences from the paper**, each told in its stage; the printed reading is kept selectable, and
//! [`HoughPeaksParams::literal`] selects all of them. Their effects are measured by `mapweld experiments readings` and told in
//! `docs/paper.md`:
//!
//! * psi-hat is a circular mean, not a mean of tangents (l. 11);
//! * all candidate rotations and their half turns are followed up, and the verification chooses (l. 15, eq. 26);
//! * the windows of the rotation tuning are at the walls' directions, not at the rotation (l. 16-18);
//! * a line is three cells wide, so that the votes of a wall do not depend on how it lies to the cells;
//! * every peak of a direction is associated, as the text of section 4.2 has it, not one couple a direction;
//! * least squares have a rank test: parallel walls are answered with the free direction;
//! * the translation is tuned by V, not by entropy (eq. 32);
//! * disagreement counts cells known in both maps (eq. 33), and an answer needs a least overlap.

mod features;
mod params;
mod psi_hat;
mod rotation_tuning;
mod search;
mod spectrum;
mod trace;
mod translation;
mod translation_tuning;

pub use params::{
    Disagreement, HoughPeaksParams, Pairing, PsiHat, RotationChoice, RotationTuning, Spectrum, TranslationTuning,
};
pub use trace::{HoughView, Objective, PeakView, RotationTrace, SpectrumTrace, TranslationTrace};

use crate::grid::OccupancyGrid;
use crate::registration::methods::shared::map::{Map, Prepared};
use crate::registration::methods::shared::search::{Order, Question, register};
use crate::registration::methods::{Method, MethodName, ParameterError};
use crate::registration::overlap::StateMap;
use crate::registration::{Control, MapFeatures, Registration};
use features::Features;

/// The paper's pipeline with checked parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct HoughPeaks {
    params: HoughPeaksParams,
}

impl HoughPeaks {
    /// The pipeline with these parameters.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that is out of range, its value and its limits.
    pub fn new(params: HoughPeaksParams) -> Result<Self, ParameterError> {
        params.checked().map(|params| Self { params })
    }

    /// Its parameters.
    #[must_use]
    pub fn params(&self) -> &HoughPeaksParams {
        &self.params
    }
}

impl Method for HoughPeaks {
    fn name(&self) -> MethodName {
        MethodName::HoughPeaks
    }

    fn features(&self, map: &OccupancyGrid) -> MapFeatures {
        MapFeatures::new(Features::of(Map::new(StateMap::new(map)), &self.params))
    }

    fn register(&self, fixed: &MapFeatures, moving: &MapFeatures, control: &dyn Control) -> Registration {
        let question = Question {
            params: &self.params,
            rule: self.params.rule(),
            wall_min_m: self.params.wall_min_m,
            order: Order::AsGiven,
        };
        register(
            fixed.of::<Features>(),
            moving.of(),
            control,
            &question,
            |fixed, moving, stages| search::search(fixed, moving, stages, &self.params),
        )
    }

    fn required_verification(&self) -> Option<f64> {
        self.params.rule().required()
    }
}

#[cfg(test)]
mod tests;
