//! What operators say about how robots' maps lie: a rule, and the constraint that keeps it until it is removed.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Author, ConstraintId, Invalid, JobId, Note, Pose, RobotId, SessionId, Timestamp, VersionNumber};
use crate::geometry::Pose2;

/// A rule that holds for all merges of a session until it is removed. Immutable.
#[derive(Debug, Clone, PartialEq)]
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

impl Constraint {
    /// The most constraints of one session.
    pub const COUNT_MAX: u32 = 256;
}

/// One thing that an operator says about how the map frames of two robots lie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Rule {
    /// The map lies about there: looked at first, and decides between hypotheses that the maps alone cannot tell apart.
    Guess(Guess),
    /// The map lies there, whatever the maps say.
    Fixed(Fixed),
    /// The two maps must not end up in one fused map, directly or by way of others.
    Apart(Apart),
}

/// Where about a robot's map lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Guess {
    /// The robot whose map is placed.
    pub robot: RobotId,
    /// The robot in whose map frame the pose is told.
    pub relative_to: RobotId,
    /// Pose of `robot`'s map frame in the map frame of `relative_to`.
    pub pose: Pose,
    /// How far off it may be: RMS over the map's walls, in metres.
    #[schema(exclusive_minimum = 0, maximum = 100)]
    pub reach_m: f64,
}

/// Where a robot's map lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Fixed {
    /// The robot whose map is placed.
    pub robot: RobotId,
    /// The robot in whose map frame the pose is told.
    pub relative_to: RobotId,
    /// Pose of `robot`'s map frame in the map frame of `relative_to`.
    pub pose: Pose,
    /// The hypothesis of an earlier merge that an operator has accepted, when the pose came from there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accepted: Option<Hypothesis>,
}

/// Two robots whose maps must not be merged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Apart {
    /// The two robots.
    #[schema(value_type = Vec<RobotId>, min_items = 2, max_items = 2)]
    pub robots: [RobotId; 2],
}

/// A pose that a merge has looked at for a pair of robots.
///
/// Of a pair that was accepted: its pose, or with `runner_up` the rival of it. Of a pair that was not: the candidate of
/// this index, or with `runner_up` the rival of that one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Hypothesis {
    /// The version whose result tells it; this or `job`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub version: Option<VersionNumber>,
    /// The dry run whose result tells it; this or `version`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub job: Option<JobId>,
    /// `fixed` of the pair.
    pub fixed: RobotId,
    /// `moving` of the pair.
    pub moving: RobotId,
    /// Its place among the pair's `candidates`, from 0 on; for pairs that were not accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub candidate: Option<u32>,
    /// The rival of that pose instead of the pose.
    #[serde(default)]
    pub runner_up: bool,
}

impl Rule {
    /// The largest distance of a pose along each axis, in metres.
    pub const DISTANCE_MAX_M: f64 = 1e6;
    /// The largest reach of a guess, in metres.
    pub const REACH_MAX_M: f64 = 100.0;
    /// The reach of a guess of which none is said, in metres.
    pub const REACH_DEFAULT_M: f64 = 2.0;

    /// The two robots that it is about, the one that it is told relative to first.
    #[must_use]
    pub fn robots(&self) -> [&RobotId; 2] {
        match self {
            Self::Guess(guess) => [&guess.relative_to, &guess.robot],
            Self::Fixed(fixed) => [&fixed.relative_to, &fixed.robot],
            Self::Apart(apart) => [&apart.robots[0], &apart.robots[1]],
        }
    }

    /// Whether two rules are about the same two robots.
    #[must_use]
    pub fn is_about_the_robots_of(&self, other: &Self) -> bool {
        let ([a, b], [c, d]) = (self.robots(), other.robots());
        (a, b) == (c, d) || (a, b) == (d, c)
    }

    /// The rule, if its numbers are allowed and it is about two robots.
    ///
    /// # Errors
    /// [`Invalid`] names the field, below the rule's kind, and the limit.
    pub fn checked(self) -> Result<Self, Invalid> {
        let [a, b] = self.robots();
        if a == b {
            let (field, limit) = match self {
                Self::Apart(_) => ("robots", "two different robots"),
                _ => ("robot", "another robot than relative_to"),
            };
            return Err(Invalid::new(field, a.as_str(), limit));
        }
        match &self {
            Self::Guess(guess) => {
                Self::pose(guess.pose)?;
                let reach = guess.reach_m;
                if !(reach > 0.0 && reach <= Self::REACH_MAX_M) {
                    let limit = format!("above 0 and at most {} metres", Self::REACH_MAX_M);
                    return Err(Invalid::new("reach_m", &reach.to_string(), limit));
                }
            }
            Self::Fixed(fixed) => {
                Self::pose(fixed.pose)?;
            }
            Self::Apart(_) => {}
        }
        Ok(self)
    }

    /// A pose of a rule, to compute with.
    ///
    /// # Errors
    /// [`Invalid`] names the number that is out of range.
    ///
    /// # Panics
    /// Never: numbers within the limits are finite.
    pub fn pose(pose: Pose) -> Result<Pose2, Invalid> {
        let max = Self::DISTANCE_MAX_M;
        for (field, metres) in [("pose.x", pose.x), ("pose.y", pose.y)] {
            if !(-max..=max).contains(&metres) {
                let limit = format!("within {} and {max} metres", -max);
                return Err(Invalid::new(field, &metres.to_string(), limit));
            }
        }
        // degrees by mistake would be taken for some other angle
        let turn = std::f64::consts::TAU;
        if !(-turn..=turn).contains(&pose.yaw) {
            let limit = "radians within -2 pi and 2 pi";
            return Err(Invalid::new("pose.yaw", &pose.yaw.to_string(), limit));
        }
        Ok(pose.to_pose2().expect("invariant: numbers within limits are finite"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(text: &str) -> Result<Rule, Invalid> {
        serde_json::from_str::<Rule>(text).expect("a rule's shape").checked()
    }

    #[test]
    fn a_rule_survives_json() {
        for text in [
            r#"{"guess":{"robot":"b","relative_to":"a","pose":{"x":1.5,"y":0.0,"yaw":-1.0},"reach_m":2.0}}"#,
            r#"{"fixed":{"robot":"b","relative_to":"a","pose":{"x":1.5,"y":0.0,"yaw":-1.0}}}"#,
            r#"{"apart":{"robots":["a","b"]}}"#,
        ] {
            let rule = rule(text).expect("allowed");
            assert_eq!(serde_json::to_string(&rule).expect("serialises"), text);
        }
        assert!(serde_json::from_str::<Rule>(r#"{"together":{"robots":["a","b"]}}"#).is_err());
    }

    #[test]
    fn numbers_out_of_range_are_refused_with_their_field_and_limit() {
        let fixed = |pose: &str| {
            rule(&format!(
                r#"{{"fixed":{{"robot":"b","relative_to":"a","pose":{pose}}}}}"#
            ))
        };
        assert!(fixed(r#"{"x":1e6,"y":-1e6,"yaw":6.28}"#).is_ok());
        let error = fixed(r#"{"x":0,"y":1e7,"yaw":0}"#).expect_err("too far");
        assert_eq!((error.field, error.limit.contains("1000000")), ("pose.y", true));
        assert_eq!(
            fixed(r#"{"x":0,"y":0,"yaw":90}"#).expect_err("degrees").field,
            "pose.yaw"
        );
        for reach in ["0", "-1", "100.5"] {
            let text = format!(
                r#"{{"guess":{{"robot":"b","relative_to":"a","pose":{{"x":0,"y":0,"yaw":0}},"reach_m":{reach}}}}}"#
            );
            assert_eq!(rule(&text).expect_err("no such reach").field, "reach_m");
        }
    }

    #[test]
    fn a_rule_is_about_two_different_robots_in_either_order() {
        assert!(rule(r#"{"apart":{"robots":["a","a"]}}"#).is_err());
        let of = |a: &str, b: &str| rule(&format!(r#"{{"apart":{{"robots":["{a}","{b}"]}}}}"#)).expect("allowed");
        assert!(of("a", "b").is_about_the_robots_of(&of("b", "a")));
        assert!(!of("a", "b").is_about_the_robots_of(&of("a", "c")));
    }
}
