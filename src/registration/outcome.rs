//! What a registration answers: a pose with its evidence, or a reason with the candidates that were considered.

use std::time::Duration;

use super::Stop;
use crate::geometry::{Angle, Pose2};

/// The answer for one pair of maps. "These maps do not match" is a value, not an error.
#[derive(Debug, Clone, PartialEq)]
pub enum Registration {
    /// The maps are of one place, and this is how they lie.
    Accepted(Acceptance),
    /// Nothing that could be trusted.
    Rejected(Rejection),
}

/// A pose that was accepted, with all that speaks for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Acceptance {
    /// Pose of the moving map's frame in the fixed map's frame.
    pub pose_fixed_moving: Pose2,
    /// How well the pose is known.
    pub covariance: Covariance,
    /// What speaks for it.
    pub evidence: Evidence,
    /// Time of each stage, in the order run.
    pub stages: Vec<StageTime>,
}

/// Why there is no pose, and what came nearest to one.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejection {
    /// Why.
    pub reason: Reason,
    /// The best hypotheses, best first; empty when the search never came so far.
    pub candidates: Vec<Candidate>,
    /// Time of each stage, in the order run.
    pub stages: Vec<StageTime>,
}

/// A hypothesis that was looked at closely.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Pose of the moving map's frame in the fixed map's frame.
    pub pose_fixed_moving: Pose2,
    /// How well the pose would be known, were it right.
    pub covariance: Covariance,
    /// What speaks for it and against it.
    pub evidence: Evidence,
}

/// Why a registration was rejected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    /// A map has too little structure to be recognised.
    NoStructure {
        /// Metres of wall, or what else the method registers by, in the poorer of the two maps.
        structure_m: f64,
        /// Metres that the method needs.
        needed_m: f64,
    },
    /// No hypothesis explains enough of both maps.
    NoOverlap {
        /// Score of the best hypothesis.
        score: f64,
        /// Score that it would have needed.
        needed: f64,
    },
    /// A quite different hypothesis explains the maps nearly as well.
    Ambiguous {
        /// Score of the best hypothesis.
        score: f64,
        /// Score of the runner-up.
        runner_up_score: f64,
    },
    /// The maps may slide along each other.
    UnderConstrained {
        /// Direction in the fixed map's frame in which they slide.
        free_direction: Angle,
        /// Metres of wall that hold the pose in that direction.
        support_m: f64,
        /// Metres that it would have needed.
        needed_m: f64,
    },
    /// The maps contradict each other at the best hypothesis: its verification index is below the threshold.
    VerificationFailed {
        /// The paper's V (eq. 34), in [0, 1].
        verification_index: f64,
        /// What it would have needed.
        threshold: f64,
    },
    /// The caller's deadline passed.
    Deadline,
    /// The caller cancelled.
    Cancelled,
}

impl From<Stop> for Reason {
    fn from(stop: Stop) -> Self {
        match stop {
            Stop::Deadline => Self::Deadline,
            Stop::Cancelled => Self::Cancelled,
        }
    }
}

/// Covariance of a pose's (x, y, yaw) in m^2, m rad and rad^2: of the moving frame in the fixed frame, row by row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Covariance(pub [[f64; 3]; 3]);

impl Covariance {
    /// Independent errors of `sigma_m` metres on each axis and `sigma_rad` radians.
    #[must_use]
    pub fn diagonal(sigma_m: f64, sigma_rad: f64) -> Self {
        let (m, r) = (sigma_m * sigma_m, sigma_rad * sigma_rad);
        Self([[m, 0.0, 0.0], [0.0, m, 0.0], [0.0, 0.0, r]])
    }
}

/// What speaks for and against one hypothesis. Lengths of wall are the mean of both directions (fixed map looked up in
/// the moving one and the other way round).
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// The method's own score, higher is better; comparable only within one method.
    pub score: f64,
    /// How likely the pose is right by the method's own model of what it has found, in [0, 1]; `None` when it has none, or
    /// when the pose was accepted by a rule that does not ask for it.
    pub probability: Option<f64>,
    /// The paper's V (eq. 34) over cells known in both maps, in [0, 1]; `None` when they have none in common.
    pub verification_index: Option<f64>,
    /// Area known in both maps over the smaller known area, in [0, 1].
    pub overlap: f64,
    /// Metres of wall of one map that lie on a wall of the other.
    pub matched_wall_m: f64,
    /// Metres of wall of one map that lie in free space of the other.
    pub violated_wall_m: f64,
    /// Metres of matched wall that hold the pose in the direction in which it is held worst (the smaller eigenvalue of
    /// the sum of n n^T over matched wall with normals n).
    pub weaker_direction_m: f64,
    /// The best hypothesis that is really different from this one, if any was found.
    pub runner_up: Option<RunnerUp>,
}

impl Evidence {
    /// Whether a pose may be published by a method that requires this verification index
    /// ([`super::Method::required_verification`]).
    #[must_use]
    pub fn suffices(&self, required: Option<f64>) -> bool {
        required.is_none_or(|least| self.verification_index.is_some_and(|index| index >= least))
    }
}

/// The rival of a hypothesis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunnerUp {
    /// Pose of the moving map's frame in the fixed map's frame.
    pub pose_fixed_moving: Pose2,
    /// Its score.
    pub score: f64,
    /// RMS distance in metres between the moving map's occupied cells under the two poses.
    pub distance_m: f64,
}

/// How long one stage took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StageTime {
    /// The stage's name, as in the module docs of the method.
    pub stage: &'static str,
    /// Its time by the caller's [`super::Control::now`].
    pub duration: Duration,
}

impl Registration {
    /// The acceptance, if there is one.
    #[must_use]
    pub fn accepted(&self) -> Option<&Acceptance> {
        match self {
            Self::Accepted(acceptance) => Some(acceptance),
            Self::Rejected(_) => None,
        }
    }

    /// The evidence of the accepted pose, or of the best candidate.
    #[must_use]
    pub fn best_evidence(&self) -> Option<&Evidence> {
        match self {
            Self::Accepted(acceptance) => Some(&acceptance.evidence),
            Self::Rejected(rejection) => rejection.candidates.first().map(|candidate| &candidate.evidence),
        }
    }

    /// Time of each stage, in the order run.
    #[must_use]
    pub fn stages(&self) -> &[StageTime] {
        match self {
            Self::Accepted(acceptance) => &acceptance.stages,
            Self::Rejected(rejection) => &rejection.stages,
        }
    }
}
