//! Rules of requests, read: what they leave out is filled in, and a hypothesis of an earlier merge becomes a pose.

use super::error::{ApiError, ApiResult};
use super::state::AppState;
use crate::api::{
    FieldError, MergeResult, NewFixed, NewGuess, NewMerge, NewRule, PairResult, Pose, ProblemCode, RunnerUp,
};
use crate::model::{
    Constraint, Fixed, Guess, Hypothesis, Invalid, MergeRequest, RobotId, Rule, Session, Steering, VersionSelector,
    beside,
};
use crate::store::{Page, StoreError};

/// A merge that is asked for, with its rules read and checked against the session's constraints.
pub(super) async fn read_merge(state: &AppState, session: &Session, new: NewMerge) -> ApiResult<MergeRequest> {
    check_restore(state, session, &new).await?;
    if new.rules.len() > NewMerge::RULES_MAX {
        let limit = format!("at most {} rules", NewMerge::RULES_MAX);
        return Err(ApiError::invalid("rules", format!("{} rules", new.rules.len()), &limit));
    }
    let mut rules = Vec::with_capacity(new.rules.len());
    for (index, rule) in new.rules.into_iter().enumerate() {
        rules.push(read(state, session, rule, &format!("rules[{index}]")).await?);
    }
    if !rules.is_empty() {
        let all = Page::first(Constraint::COUNT_MAX);
        let standing = state.store.list_constraints(&session.id, &all).await?;
        let (in_force, _) = beside(&rules, standing);
        let together: Vec<&Rule> = rules.iter().chain(in_force.iter().map(|one| &one.rule)).collect();
        Steering::check(&together).map_err(StoreError::from)?;
    }
    Ok(MergeRequest {
        dry_run: new.dry_run,
        robots: new.robots,
        method: new.method,
        anchor: new.anchor,
        rules,
        restore: new.restore,
        author: new.author,
    })
}

async fn check_restore(state: &AppState, session: &Session, new: &NewMerge) -> ApiResult<()> {
    let Some(number) = new.restore else { return Ok(()) };
    let beside = [
        ("robots", new.robots.is_some()),
        ("method", new.method.is_some()),
        ("anchor", new.anchor.is_some()),
        ("rules", !new.rules.is_empty()),
    ];
    if let Some((field, _)) = beside.into_iter().find(|(_, given)| *given) {
        let limit = "absent beside restore, which merges nothing";
        let error = ApiError::new(ProblemCode::InvalidRequest, format!("{field} must be {limit}"));
        return Err(error.field(FieldError::missing(field, limit)));
    }
    match state
        .store
        .get_version(&session.id, VersionSelector::Number(number))
        .await
    {
        Ok(_) => Ok(()),
        Err(StoreError::NotFound(_)) => Err(ApiError::invalid(
            "restore",
            number.to_string(),
            "the number of a version that the session has",
        )),
        Err(error) => Err(error.into()),
    }
}

/// A rule of a request; `field` is where it stands in the body.
pub(super) async fn read(state: &AppState, session: &Session, rule: NewRule, field: &str) -> ApiResult<Rule> {
    let (kind, rule) = match rule {
        NewRule::Guess(NewGuess {
            robot,
            relative_to,
            pose,
            reach_m,
        }) => {
            let relative_to = base(session, relative_to, &format!("{field}.guess"))?;
            let guess = Guess {
                robot,
                relative_to,
                pose,
                reach_m,
            };
            ("guess", Rule::Guess(guess))
        }
        NewRule::Fixed(NewFixed {
            robot,
            relative_to,
            pose,
        }) => {
            let fixed = Fixed {
                robot,
                relative_to: base(session, relative_to, &format!("{field}.fixed"))?,
                pose,
                accepted: None,
            };
            ("fixed", Rule::Fixed(fixed))
        }
        NewRule::Apart(apart) => ("apart", Rule::Apart(apart)),
        NewRule::Accept(hypothesis) => {
            let field = format!("{field}.accept");
            let fixed = Fixed {
                robot: hypothesis.moving.clone(),
                relative_to: hypothesis.fixed.clone(),
                pose: pose_of(&result(state, session, &hypothesis, &field).await?, &hypothesis, &field)?,
                accepted: Some(hypothesis),
            };
            ("accept", Rule::Fixed(fixed))
        }
    };
    rule.checked().map_err(|invalid: Invalid| {
        let name = format!("{field}.{kind}.{}", invalid.field);
        ApiError::invalid(&name, invalid.value, &invalid.limit)
    })
}

fn base(session: &Session, relative_to: Option<RobotId>, field: &str) -> ApiResult<RobotId> {
    relative_to.or_else(|| session.settings.anchor.clone()).ok_or_else(|| {
        let name = format!("{field}.relative_to");
        let limit = "the name of a robot: the session has no anchor yet";
        ApiError::new(
            ProblemCode::InvalidRequest,
            format!("{name} is missing; it must be {limit}"),
        )
        .field(FieldError::missing(name, limit))
    })
}

/// The result that a hypothesis stands in.
async fn result(state: &AppState, session: &Session, hypothesis: &Hypothesis, field: &str) -> ApiResult<MergeResult> {
    let text = match (hypothesis.version, hypothesis.job) {
        (Some(number), None) => {
            let found = state
                .store
                .get_version(&session.id, VersionSelector::Number(number))
                .await;
            match found {
                Ok(version) => Some(version.result),
                Err(StoreError::NotFound(_)) => {
                    let limit = "the number of a version that the session has";
                    return Err(ApiError::invalid(
                        &format!("{field}.version"),
                        number.to_string(),
                        limit,
                    ));
                }
                Err(error) => return Err(error.into()),
            }
        }
        (None, Some(job)) => match state.store.get_job(job).await {
            Ok(job) if job.session == session.id => job.result,
            Ok(_) | Err(StoreError::NotFound(_)) => None,
            Err(error) => return Err(error.into()),
        },
        _ => {
            let limit = "given, or job, and not both";
            let error = ApiError::new(ProblemCode::InvalidRequest, format!("{field}.version must be {limit}"));
            return Err(error.field(FieldError::missing(format!("{field}.version"), limit)));
        }
    };
    let Some(text) = text else {
        let job = hypothesis.job.map(|job| job.to_string()).unwrap_or_default();
        let limit = "a dry run of this session that has succeeded";
        return Err(ApiError::invalid(&format!("{field}.job"), job, limit));
    };
    serde_json::from_str(text.as_str()).map_err(ApiError::internal)
}

/// The pose that a hypothesis means.
fn pose_of(result: &MergeResult, hypothesis: &Hypothesis, field: &str) -> ApiResult<Pose> {
    let (fixed, moving) = (hypothesis.fixed.as_str(), hypothesis.moving.as_str());
    let pair = result
        .pairs
        .iter()
        .find(|pair| pair.fixed == fixed && pair.moving == moving);
    let pair = pair.ok_or_else(|| {
        let limit = "fixed and moving of one of the result's pairs, in this order";
        ApiError::invalid(&format!("{field}.fixed"), format!("{fixed}, moving is {moving}"), limit)
    })?;
    let (pose, rival) = told(pair, hypothesis, field)?;
    if !hypothesis.runner_up {
        return Ok(pose);
    }
    rival.map(|rival| rival.pose).ok_or_else(|| {
        let limit = "false: no pose really different from this one was found";
        ApiError::invalid(&format!("{field}.runner_up"), "true", limit)
    })
}

fn told<'a>(pair: &'a PairResult, hypothesis: &Hypothesis, field: &str) -> ApiResult<(Pose, Option<&'a RunnerUp>)> {
    let name = format!("{field}.candidate");
    match (pair.pose, hypothesis.candidate) {
        (Some(pose), None) => {
            let rival = pair.evidence.as_ref().and_then(|evidence| evidence.runner_up.as_ref());
            Ok((pose, rival))
        }
        (Some(_), Some(candidate)) => {
            let limit = "absent: the pair was accepted";
            Err(ApiError::invalid(&name, candidate.to_string(), limit))
        }
        (None, candidate) => {
            let count = pair.candidates.len();
            let chosen = candidate.and_then(|candidate| pair.candidates.get(usize::try_from(candidate).ok()?));
            let chosen = chosen.ok_or_else(|| {
                let limit = match count {
                    0 => "one of the pair's candidates, but it has none".to_owned(),
                    _ => format!("a place among the pair's candidates: 0 to {}", count - 1),
                };
                match candidate {
                    Some(candidate) => ApiError::invalid(&name, candidate.to_string(), &limit),
                    None => ApiError::new(
                        ProblemCode::InvalidRequest,
                        format!("{name} is missing; it must be {limit}"),
                    )
                    .field(FieldError::missing(&name, limit)),
                }
            })?;
            Ok((chosen.pose, chosen.evidence.runner_up.as_ref()))
        }
    }
}
