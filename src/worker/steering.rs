//! What operators say, brought to a merge: standing constraints and the rules of its request.

use std::collections::BTreeMap;

use super::work::Failure;
use crate::api::ConstraintEffect;
use crate::fusion::{FixedPair, Prior, WeldInput, WeldOptions};
use crate::geometry::Pose2;
use crate::model::{Constraint, Effect, Job, RobotId, Rule, Steering, beside};

/// What operators say about the maps of one merge.
#[derive(Debug, Default)]
pub(super) struct Steered {
    steering: Steering,
    /// Every rule, and what became of it, to be told with the result.
    pub(super) told: Vec<ConstraintEffect>,
}

impl Steered {
    /// The rules of the job's request and the session's constraints. A rule of the request stands in for constraints
    /// about the same two robots.
    pub(super) fn new(
        job: &Job,
        standing: Vec<Constraint>,
        anchor: &RobotId,
        robots: &[RobotId],
        earlier: &BTreeMap<RobotId, Pose2>,
    ) -> Result<Self, Failure> {
        let request = &job.request;
        let (standing, replaced) = beside(&request.rules, standing);
        let rules: Vec<&Rule> = (request.rules.iter())
            .chain(standing.iter().map(|constraint| &constraint.rule))
            .collect();
        let steering = Steering::of(&rules, anchor, robots, earlier)
            .map_err(|clash| Failure::for_good("constraints_clash", clash.to_string()))?;
        let of_request = request.rules.iter().map(|rule| ConstraintEffect {
            id: None,
            rule: rule.clone(),
            author: request.author.clone(),
            note: None,
            at: job.created_at,
            applied: true,
            why_not: None,
        });
        let mut told: Vec<ConstraintEffect> = of_request.chain(standing.iter().map(told_of)).collect();
        for (told, effect) in told.iter_mut().zip(&steering.effects) {
            if let Effect::NotApplied(why) = effect {
                told.applied = false;
                told.why_not = Some(why.clone());
            }
        }
        told.extend(replaced.iter().map(|constraint| ConstraintEffect {
            applied: false,
            why_not: Some("a rule of this merge stands in for it".to_owned()),
            ..told_of(constraint)
        }));
        Ok(Self { steering, told })
    }

    /// Puts what is said about poses on the maps. What an operator says goes before what an earlier version found.
    pub(super) fn put_priors(&self, robots: &[RobotId], inputs: &mut [WeldInput]) {
        for (robot, input) in robots.iter().zip(inputs) {
            if let Some(pose) = self.steering.fixed.get(robot) {
                input.prior = Some(Prior::Fixed(*pose));
            } else if let Some(&(pose_anchor_map, reach_m)) = self.steering.guesses.get(robot) {
                input.prior = Some(Prior::Guess {
                    pose_anchor_map,
                    reach_m,
                });
            }
        }
    }

    /// Puts what is said about pairs into the options.
    pub(super) fn put_pairs(&self, robots: &[RobotId], options: &mut WeldOptions) {
        let index = |robot: &RobotId| {
            let at = robots.iter().position(|other| other == robot);
            at.expect("invariant: rules about absent robots do not apply")
        };
        options.forbidden = (self.steering.apart.iter())
            .map(|pair| [index(&pair[0]), index(&pair[1])])
            .collect();
        options.fixed_pairs = (self.steering.ties.iter())
            .map(|tie| FixedPair {
                fixed: index(&tie.fixed),
                moving: index(&tie.moving),
                pose_fixed_moving: tie.pose_fixed_moving,
            })
            .collect();
    }
}

fn told_of(constraint: &Constraint) -> ConstraintEffect {
    ConstraintEffect {
        id: Some(constraint.id),
        rule: constraint.rule.clone(),
        author: constraint.author.clone(),
        note: constraint.note.clone(),
        at: constraint.created_at,
        applied: true,
        why_not: None,
    }
}
