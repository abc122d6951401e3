//! What is a robot's own.

use axum::extract::{FromRequestParts, RawPathParams};
use axum::http::request::Parts;

use super::access::Access;
use crate::api::{FieldError, ProblemCode};
use crate::http::error::{ApiError, ApiResult};
use crate::http::state::AppState;
use crate::model::{JobId, MapId, RobotId, Scope, SessionId};
use crate::store::{Missing, StoreError};

/// Refuses what is not the robot's own. Sessions and robots are refused by their names, whether they exist or not; maps
/// and jobs of others are answered like those that do not exist. So a robot learns nothing of what is not its own.
pub(super) async fn check(state: &AppState, access: Access, scope: &Scope, parts: &mut Parts) -> ApiResult<()> {
    let Scope::Robot { session, robot } = scope else {
        return Err(ApiError::internal("only a robot's key is asked what is its own"));
    };
    let path = PathNames::of(state, parts).await?;
    match access {
        Access::InSession => path.is("session", session.as_str()),
        Access::Push => {
            path.is("session", session.as_str())?;
            path.is("robot", robot.as_str())
        }
        Access::OwnMaps => {
            path.is("session", session.as_str())?;
            asks_only_for(robot, parts.uri.query().unwrap_or_default())
        }
        Access::OwnMap => {
            path.is("session", session.as_str())?;
            map_is_of(state, session, robot, path.get("map")).await
        }
        Access::OwnJob => job_is_of(state, session, path.get("job")).await,
        Access::Open | Access::AnyKey | Access::Look | Access::Operate | Access::Administer => {
            Err(ApiError::internal("the table of answers has no own for this"))
        }
    }
}

/// The names in the path of a request.
struct PathNames(Vec<(String, String)>);

impl PathNames {
    async fn of(state: &AppState, parts: &mut Parts) -> ApiResult<Self> {
        let names = RawPathParams::from_request_parts(parts, state)
            .await
            .map_err(|error| ApiError::new(ProblemCode::InvalidPath, error.body_text()))?;
        let owned = |(key, value): (&str, &str)| (key.to_owned(), value.to_owned());
        Ok(Self(names.iter().map(owned).collect()))
    }

    fn get(&self, name: &str) -> &str {
        let found = self.0.iter().find(|(key, _)| key == name);
        found.map_or("", |(_, value)| value)
    }

    fn is(&self, name: &'static str, own: &str) -> ApiResult<()> {
        let sent = self.get(name);
        if sent == own {
            return Ok(());
        }
        Err(not_own(name, sent, own))
    }
}

fn not_own(field: &str, sent: &str, own: &str) -> ApiError {
    ApiError::new(
        ProblemCode::Forbidden,
        format!("the key is not good for this {field}; it is good for {own}"),
    )
    .field(FieldError::new(
        field,
        sent,
        format!("{own}: the key is good for no other"),
    ))
}

/// Every `robot` of the query is the robot itself, and there is one.
fn asks_only_for(robot: &RobotId, query: &str) -> ApiResult<()> {
    let mut asked = form_urlencoded::parse(query.as_bytes())
        .filter(|(name, _)| name == "robot")
        .map(|(_, value)| value)
        .peekable();
    if asked.peek().is_none() {
        return Err(not_own("robot", "", robot.as_str()));
    }
    match asked.find(|value| value != robot.as_str()) {
        Some(other) => Err(not_own("robot", &other, robot.as_str())),
        None => Ok(()),
    }
}

async fn map_is_of(state: &AppState, session: &SessionId, robot: &RobotId, map: &str) -> ApiResult<()> {
    // what is no id is refused by the handler, which reads it in the same way
    let Ok(map) = map.parse::<MapId>() else { return Ok(()) };
    if state.store.get_map(session, map).await?.robot == *robot {
        return Ok(());
    }
    Err(StoreError::NotFound(Missing::Map(session.clone(), map)).into())
}

async fn job_is_of(state: &AppState, session: &SessionId, job: &str) -> ApiResult<()> {
    let Ok(job) = job.parse::<JobId>() else { return Ok(()) };
    if state.store.get_job(job).await?.session == *session {
        return Ok(());
    }
    Err(StoreError::NotFound(Missing::Job(job)).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_maps_is_a_robots_own_when_every_robot_of_the_query_is_itself() {
        let robot = RobotId::parse("r1").expect("a name");
        for own in ["robot=r1", "page_size=2&robot=r1", "robot=%721"] {
            assert!(asks_only_for(&robot, own).is_ok(), "{own}");
        }
        for other in ["", "robot=", "robot=r2", "robot=r1&robot=r2", "robots=r1"] {
            assert!(asks_only_for(&robot, other).is_err(), "{other}");
        }
    }
}
