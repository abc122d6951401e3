//! What operators say, on the wire: rules as they are asked for, and constraints as they stand.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::Pose;
use crate::model::{
    Apart, Author, ConstraintId, Hypothesis, MethodSpec, Note, RobotId, Rule, SessionId, Timestamp, VersionNumber,
};

/// A merge that is asked for; what is absent is as the session says.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NewMerge {
    /// Only find the answer: publish no version.
    pub dry_run: bool,
    /// Merge the maps of these robots only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robots: Option<Vec<RobotId>>,
    /// Another method than the session's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<MethodSpec>,
    /// Moves the session frame: from the version on that this merge publishes, this robot is the session's anchor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anchor: Option<RobotId>,
    /// Rules for this merge alone. One stands in for the session's constraints about the same two robots.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 64)]
    pub rules: Vec<NewRule>,
    /// Rolls back: merges nothing, but publishes the content of this version as the newest one. The session's anchor
    /// becomes that version's. Only `dry_run` and `author` may stand beside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub restore: Option<VersionNumber>,
    /// Who asks; told with the result.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub author: Option<Author>,
}

impl NewMerge {
    /// The most rules of one merge.
    pub const RULES_MAX: usize = 64;
}

/// A rule about how the maps of two robots lie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum NewRule {
    /// The map lies about there: looked at first, and decides between hypotheses that the maps alone cannot tell apart.
    Guess(NewGuess),
    /// The map lies there, whatever the maps say.
    Fixed(NewFixed),
    /// The two maps must not end up in one fused map, directly or by way of others.
    Apart(Apart),
    /// A pose that an earlier merge has looked at is right: it stands as a fixed pose.
    Accept(Hypothesis),
}

/// Where about a robot's map lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewGuess {
    /// The robot whose map is placed.
    pub robot: RobotId,
    /// The robot in whose map frame the pose is told. Default: the session's anchor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub relative_to: Option<RobotId>,
    /// Pose of `robot`'s map frame in the map frame of `relative_to`; at most 1000000 m away, yaw within -2 pi and 2 pi.
    pub pose: Pose,
    /// How far off it may be: RMS over the map's walls, in metres.
    #[serde(default = "reach_default")]
    #[schema(exclusive_minimum = 0, maximum = 100, default = 2.0)]
    pub reach_m: f64,
}

fn reach_default() -> f64 {
    Rule::REACH_DEFAULT_M
}

/// Where a robot's map lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewFixed {
    /// The robot whose map is placed.
    pub robot: RobotId,
    /// The robot in whose map frame the pose is told. Default: the session's anchor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub relative_to: Option<RobotId>,
    /// Pose of `robot`'s map frame in the map frame of `relative_to`; at most 1000000 m away, yaw within -2 pi and 2 pi.
    pub pose: Pose,
}

/// A rule that shall hold for all merges of a session until it is removed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewConstraint {
    /// What it says.
    pub rule: NewRule,
    /// Who says it; told with the result of each merge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub author: Option<Author>,
    /// Why.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub note: Option<Note>,
}

/// A rule that holds for all merges of a session until it is removed. Immutable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Constraint {
    /// Its id.
    pub id: ConstraintId,
    /// The session.
    pub session: SessionId,
    /// What it says.
    pub rule: Rule,
    /// Who said it, as far as that is known.
    pub author: Option<Author>,
    /// Why.
    pub note: Option<Note>,
    /// When.
    pub created_at: Timestamp,
}

impl From<crate::model::Constraint> for Constraint {
    fn from(constraint: crate::model::Constraint) -> Self {
        Self {
            id: constraint.id,
            session: constraint.session,
            rule: constraint.rule,
            author: constraint.author,
            note: constraint.note,
            created_at: constraint.created_at,
        }
    }
}

/// A rule that was said about a merge, and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ConstraintEffect {
    /// The standing constraint; absent for a rule of this merge alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<ConstraintId>,
    /// What it says.
    pub rule: Rule,
    /// Who said it, as far as that is known.
    pub author: Option<Author>,
    /// Why.
    pub note: Option<Note>,
    /// When it was said.
    pub at: Timestamp,
    /// Whether the merge obeyed it.
    pub applied: bool,
    /// Why it did not matter to this merge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why_not: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_merge_that_is_asked_for_may_be_empty_and_refuses_what_it_does_not_know() {
        assert_eq!(
            serde_json::from_str::<NewMerge>("{}").expect("parses"),
            NewMerge::default()
        );
        assert!(serde_json::from_str::<NewMerge>(r#"{"dryrun":true}"#).is_err());
    }

    #[test]
    fn a_guess_has_a_reach_when_none_is_said() {
        let rule = r#"{"guess":{"robot":"b","pose":{"x":1,"y":2,"yaw":0.5}}}"#;
        let NewRule::Guess(guess) = serde_json::from_str(rule).expect("a guess") else {
            panic!("{rule} is a guess");
        };
        assert!((guess.reach_m - 2.0).abs() < 1e-12 && guess.relative_to.is_none());
    }
}
