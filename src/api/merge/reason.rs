//! Why a map is not placed, or a pair not accepted.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::fusion::NotPlacedReason;
use crate::registration;

/// Why a map is not placed, or a pair not accepted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(example = json!({
    "code": "verification_failed",
    "message": "the maps contradict each other at the best pose: V is 0.61, needed is 0.70",
    "value": 0.61,
    "needed": 0.7
}))]
pub struct Reason {
    /// Stable, for programs.
    pub code: ReasonCode,
    /// For people.
    pub message: String,
    /// The number that was found, in the unit that the message tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// The number that it would have needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub needed: Option<f64>,
}

/// The kinds of [`Reason`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReasonCode {
    /// A map has too little structure to be recognised.
    NoStructure,
    /// No hypothesis explains enough of both maps.
    NoOverlap,
    /// A quite different hypothesis explains the maps nearly as well.
    Ambiguous,
    /// The maps may slide along each other.
    UnderConstrained,
    /// The maps contradict each other at the best hypothesis.
    VerificationFailed,
    /// It was registered, but to maps that contradict each other about it.
    Contradicted,
    /// It was registered, but not surely enough for a set of many maps, and nothing else confirms it.
    Unconfirmed,
    /// It is joined to other maps, but none of them to the anchor.
    OtherGroup,
    /// It would have joined maps that must not be merged.
    Forbidden,
    /// It was never looked at together with another map.
    NotCompared,
    /// The time allowed was over.
    Deadline,
    /// The work was cancelled.
    Cancelled,
}

impl ReasonCode {
    /// It as it stands in JSON.
    #[must_use]
    pub fn as_str(self) -> String {
        let text = serde_json::to_string(&self).expect("invariant: a code serialises");
        text.trim_matches('"').to_owned()
    }
}

impl Reason {
    fn plain(code: ReasonCode, message: impl Into<String>) -> Self {
        Self {
            code,
            message: message.into(),
            value: None,
            needed: None,
        }
    }

    fn measured(code: ReasonCode, value: f64, needed: f64, message: String) -> Self {
        Self {
            code,
            message,
            value: Some(value),
            needed: Some(needed),
        }
    }

    /// Why a map is left out; `names_of_group` are the maps that it is joined to.
    pub(super) fn of_map(reason: NotPlacedReason, names_of_group: impl Fn(usize) -> String) -> Self {
        match reason {
            NotPlacedReason::Pairs(reason) => reason.into(),
            NotPlacedReason::Contradicted => Self::plain(
                ReasonCode::Contradicted,
                "it was registered, but to maps that contradict each other about it",
            ),
            NotPlacedReason::Unconfirmed => Self::plain(
                ReasonCode::Unconfirmed,
                "it was registered, but not surely enough for a set of many maps, and nothing else confirms it",
            ),
            NotPlacedReason::OtherGroup(group) => Self::plain(
                ReasonCode::OtherGroup,
                format!(
                    "it lies in one frame with {}, but nothing joins them to the anchor",
                    names_of_group(group)
                ),
            ),
            NotPlacedReason::Forbidden => Self::plain(
                ReasonCode::Forbidden,
                "it would have joined maps that must not be merged",
            ),
            NotPlacedReason::NotCompared => Self::plain(
                ReasonCode::NotCompared,
                "it was never looked at together with another map",
            ),
        }
    }
}

impl From<registration::Reason> for Reason {
    fn from(reason: registration::Reason) -> Self {
        match reason {
            registration::Reason::NoStructure { structure_m, needed_m } => Self::measured(
                ReasonCode::NoStructure,
                structure_m,
                needed_m,
                format!(
                    "a map has too little structure to be recognised: {structure_m:.1} m of wall, needed are {needed_m:.1} m"
                ),
            ),
            registration::Reason::NoOverlap { score, needed } => Self::measured(
                ReasonCode::NoOverlap,
                score,
                needed,
                format!("no pose explains enough of both maps: the best scores {score:.3}, needed is {needed:.3}"),
            ),
            registration::Reason::Ambiguous { score, runner_up_score } => Self::measured(
                ReasonCode::Ambiguous,
                runner_up_score,
                score,
                format!(
                    "a quite different pose explains the maps nearly as well: it scores {runner_up_score:.3}, the best \
                     one {score:.3}"
                ),
            ),
            registration::Reason::UnderConstrained {
                free_direction,
                support_m,
                needed_m,
            } => Self::measured(
                ReasonCode::UnderConstrained,
                support_m,
                needed_m,
                format!(
                    "the maps may slide along each other at {:.0} degrees: {support_m:.1} m of wall hold them there, \
                     needed are {needed_m:.1} m",
                    free_direction.degrees()
                ),
            ),
            registration::Reason::VerificationFailed {
                verification_index,
                threshold,
            } => Self::measured(
                ReasonCode::VerificationFailed,
                verification_index,
                threshold,
                format!(
                    "the maps contradict each other at the best pose: V is {verification_index:.2}, needed is \
                     {threshold:.2}"
                ),
            ),
            registration::Reason::Deadline => Self::plain(ReasonCode::Deadline, "the time allowed was over"),
            registration::Reason::Cancelled => Self::plain(ReasonCode::Cancelled, "the work was cancelled"),
        }
    }
}
