//! The registration methods behind one trait, and their choice by name.
//!
//! Each method is a folder of its own. `hough` is the default; `hough-peaks` is the paper's pipeline, and the others are
//! those that the paper compares it with (its Table 3). `shared` is what these have in common.

pub mod fourier_hough;
pub mod hough;
pub mod hough_peaks;
pub mod hough_spectrum;
pub mod map_segmentation;
mod parameter;
pub mod random_walk;
pub mod ransac;
pub(crate) mod shared;
mod spec;

pub use fourier_hough::{FourierHough, FourierHoughParams};
pub use hough_peaks::{HoughPeaks, HoughPeaksParams};
pub use hough_spectrum::{HoughSpectrum, HoughSpectrumParams};
pub use map_segmentation::{MapSegmentation, MapSegmentationParams};
pub use parameter::ParameterError;
pub use random_walk::{RandomWalk, RandomWalkParams};
pub use ransac::{Ransac, RansacParams};
pub use spec::{MethodError, MethodSpec};

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{Control, MapFeatures, Registration};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;

/// A way to register two maps. Deterministic: same maps, same answer, to the byte, on any number of threads.
pub trait Method: Send + Sync {
    /// Its name.
    fn name(&self) -> MethodName;

    /// All that it needs of one map alone; computed once a map and parameters.
    fn features(&self, map: &OccupancyGrid) -> MapFeatures;

    /// The pose of the moving map's frame in the fixed map's frame, or why not. Looks at `control` between stages.
    fn register(&self, fixed: &MapFeatures, moving: &MapFeatures, control: &dyn Control) -> Registration;

    /// The least verification index (eq. 34) that a pose of this method must have to be published, however it was chosen
    /// among the candidates; `None` for a method that does not decide by it, and when the caller asked for answers below
    /// the threshold. [`Method::register`] accepts nothing below it.
    fn required_verification(&self) -> Option<f64>;

    /// Whether the maps confirm a pose that is known from elsewhere, and the best pose near it. Accepted: the maps agree
    /// there. Rejected: they do not, and nothing else was looked for. The evidence may lack a runner-up.
    ///
    /// The default is the full search; a method that can look at one place only should do so.
    fn verify_at(
        &self,
        fixed: &MapFeatures,
        moving: &MapFeatures,
        pose_fixed_moving: Pose2,
        control: &dyn Control,
    ) -> Registration {
        let _ = pose_fixed_moving;
        self.register(fixed, moving, control)
    }
}

/// The names of the methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MethodName {
    /// Hough spectrum, signed correlation, point-to-line refinement, decision by distinctness.
    Hough,
    /// The paper's pipeline (Saeedi et al., Algorithms 1 and 2).
    HoughPeaks,
    /// Carpin's Hough spectra: all rotation candidates, projections along x and y correlated.
    HoughSpectrum,
    /// Phase correlation of the Hough images for the rotation, Fourier correlation of the maps for the translation.
    FourierHough,
    /// Birk and Carpin's adaptive random walk over the similarity of the maps.
    RandomWalk,
    /// Thin lines of both maps, segments filtered by histograms and matched by cross-correlation.
    MapSegmentation,
    /// Peaks of the Hough images matched by random sample consensus.
    Ransac,
}

impl MethodName {
    /// All methods, the default first.
    pub const ALL: [Self; 7] = [
        Self::Hough,
        Self::HoughPeaks,
        Self::HoughSpectrum,
        Self::FourierHough,
        Self::RandomWalk,
        Self::MapSegmentation,
        Self::Ransac,
    ];

    /// As in `--method`.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Hough => "hough",
            Self::HoughPeaks => "hough-peaks",
            Self::HoughSpectrum => "hough-spectrum",
            Self::FourierHough => "fourier-hough",
            Self::RandomWalk => "random-walk",
            Self::MapSegmentation => "map-segmentation",
            Self::Ransac => "ransac",
        }
    }
}

impl fmt::Display for MethodName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// There is no method of this name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no method {0:?}; the methods are: {names}", names = MethodName::ALL.map(MethodName::as_str).join(", "))]
pub struct UnknownMethod(pub String);

impl FromStr for MethodName {
    type Err = UnknownMethod;
    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        Self::ALL
            .into_iter()
            .find(|method| method.as_str() == name)
            .ok_or_else(|| UnknownMethod(name.to_owned()))
    }
}
