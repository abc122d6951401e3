//! One registration, judged by its truth.

use std::time::Duration;

use crate::fusion::Moments;
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::registration::overlap::{StateMap, compare};
use crate::registration::{Control, Method, Reason, Registration, Stop, register};

/// An answer is right up to this RMS error over the moving map's occupied cells, in metres.
pub(super) const RIGHT_WITHIN_M: f64 = 0.5;

/// What a method said of a pair, and how right it was.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Answer {
    /// Whether it would merge the maps.
    pub(super) merged: bool,
    /// The best pose that it found, merged or not.
    pub(super) pose: Option<Pose2>,
    /// RMS error of that pose in metres, where the truth is known.
    pub(super) error_m: Option<f64>,
    /// V (eq. 34) at that pose, over cells known in both.
    pub(super) verification_index: Option<f64>,
    /// Why it did not merge; empty when it did.
    pub(super) reason: &'static str,
    /// Time of features and search together.
    pub(super) seconds: f64,
}

impl Answer {
    /// Whether the best pose is right, merged or not.
    pub(super) fn pose_is_right(&self) -> bool {
        self.error_m.is_some_and(|error| error <= RIGHT_WITHIN_M)
    }

    /// Merged, and right.
    pub(super) fn is_correct(&self) -> bool {
        self.merged && self.pose_is_right()
    }

    /// Merged, and wrong: the harm that a method can do.
    pub(super) fn is_wrong(&self) -> bool {
        self.merged && !self.pose_is_right()
    }

    /// Merged where right, refused where there is nothing in common.
    pub(super) fn decides_well(&self, belong_together: bool) -> bool {
        if belong_together {
            self.is_correct()
        } else {
            !self.merged
        }
    }
}

/// Registers a pair and compares with its truth (the pose of the moving map's frame in the fixed map's).
pub(super) fn answer(
    method: &dyn Method,
    fixed: &OccupancyGrid,
    moving: &OccupancyGrid,
    truth: Option<Pose2>,
    control: &dyn Control,
) -> Answer {
    let since = control.now();
    let registration = register(method, fixed, moving, control);
    let seconds = control.now().saturating_sub(since).as_secs_f64();
    let (pose, reason) = match &registration {
        Registration::Accepted(acceptance) => (Some(acceptance.pose_fixed_moving), ""),
        Registration::Rejected(rejection) => {
            let best = rejection.candidates.first();
            (
                best.map(|candidate| candidate.pose_fixed_moving),
                named(&rejection.reason),
            )
        }
    };
    let error_m = pose
        .zip(truth)
        .map(|(pose, truth)| Moments::of(moving).distance(pose, truth));
    let verification_index =
        pose.and_then(|pose| compare(&StateMap::new(fixed), &StateMap::new(moving), pose).verification_index());
    Answer {
        merged: registration.accepted().is_some(),
        pose,
        error_m,
        verification_index,
        reason,
        seconds,
    }
}

fn named(reason: &Reason) -> &'static str {
    match reason {
        Reason::NoStructure { .. } => "no structure",
        Reason::NoOverlap { .. } => "no overlap",
        Reason::Ambiguous { .. } => "ambiguous",
        Reason::UnderConstrained { .. } => "under-constrained",
        Reason::VerificationFailed { .. } => "verification failed",
        Reason::Deadline => "deadline",
        Reason::Cancelled => "cancelled",
    }
}

/// A control that also stops when a while has passed: no single registration may take the time of all others.
pub(super) struct WithDeadline<'a> {
    inner: &'a dyn Control,
    until: Duration,
}

impl<'a> WithDeadline<'a> {
    pub(super) fn new(inner: &'a dyn Control, seconds: f64) -> Self {
        Self {
            inner,
            until: inner.now() + Duration::from_secs_f64(seconds),
        }
    }
}

impl Control for WithDeadline<'_> {
    fn now(&self) -> Duration {
        self.inner.now()
    }

    fn should_stop(&self) -> Option<Stop> {
        self.inner
            .should_stop()
            .or_else(|| (self.inner.now() > self.until).then_some(Stop::Deadline))
    }
}
