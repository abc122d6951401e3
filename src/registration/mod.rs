//! Registration: the pose of one map in the frame of another, or why it cannot be known.
//!
//! Imports `geometry`, `grid` and `random`. Pure: no clock, files or logging, and no chance but from a seed among a method's
//! parameters; time and the wish to stop come in through [`Control`].

mod control;
pub mod methods;
mod outcome;
pub mod overlap;

pub use control::{Control, Stop, Unhurried};
pub use methods::{Method, MethodError, MethodName, MethodSpec, UnknownMethod};
pub use outcome::{Acceptance, Candidate, Covariance, Evidence, Reason, Registration, Rejection, RunnerUp, StageTime};

use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// What a method has computed of one map alone, once, to be used in every pair that the map takes part in.
///
/// Cheap to clone. Belongs to the method (and the parameters) that made it.
#[derive(Clone)]
pub struct MapFeatures {
    inner: Arc<dyn Any + Send + Sync>,
}

impl MapFeatures {
    /// Wraps a method's own type.
    pub fn new<T: Any + Send + Sync>(features: T) -> Self {
        Self {
            inner: Arc::new(features),
        }
    }

    /// The method's own type again.
    ///
    /// # Panics
    /// When another method made these features.
    #[must_use]
    pub fn of<T: Any>(&self) -> &T {
        self.inner
            .downcast_ref()
            .expect("invariant: features go back to the method that made them")
    }
}

impl fmt::Debug for MapFeatures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("MapFeatures")
    }
}

/// Registers `moving` to `fixed` with nothing prepared: computes both maps' features, then searches.
///
/// The pose of an accepted registration is `pose_fixed_moving`: `p_fixed = pose_fixed_moving.apply(p_moving)`.
#[must_use]
pub fn register(
    method: &dyn Method,
    fixed: &crate::grid::OccupancyGrid,
    moving: &crate::grid::OccupancyGrid,
    control: &dyn Control,
) -> Registration {
    let (fixed, moving) = rayon::join(|| method.features(fixed), || method.features(moving));
    method.register(&fixed, &moving, control)
}
