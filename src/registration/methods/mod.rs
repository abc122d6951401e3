//! The registration methods behind one trait, and their choice by name.
//!
//! Each method is a folder of its own. `hough` is the default; `hough-peaks` is the paper's pipeline.

pub mod hough;
pub mod hough_peaks;
mod parameter;
mod spec;

pub use hough_peaks::{HoughPeaks, HoughPeaksParams};
pub use parameter::ParameterError;
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
}

impl MethodName {
    /// All methods, the default first.
    pub const ALL: [Self; 2] = [Self::Hough, Self::HoughPeaks];

    /// As in `--method`.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Hough => "hough",
            Self::HoughPeaks => "hough-peaks",
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
