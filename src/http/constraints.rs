//! Standing constraints: what operators say about all merges of a session.

use axum::Json;
use axum::extract::{Extension, State};
use axum::http::{HeaderName, StatusCode, header};
use serde::Deserialize;
use utoipa::IntoParams;

use super::auth::Caller;
use super::calls::NewId;
use super::error::ApiResult;
use super::extract::{JsonBody, Path, Query, parsed};
use super::list::ListQuery;
use super::refusals::{BadConstraint, OfConstraint, SessionList};
use super::rules;
use super::sessions::SessionPath;
use super::state::AppState;
use crate::api::{Constraint, NewConstraint, Page};
use crate::model::{ConstraintId, SessionId};

/// The constraint of a path.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct ConstraintPath {
    /// Name of the session.
    session: SessionId,
    /// Id of the constraint.
    #[serde(deserialize_with = "parsed")]
    constraint: ConstraintId,
}

/// Say how maps lie
///
/// The rule holds for all merges that begin from now on, until it is removed: a guess, a fixed pose, "never merge these
/// two", or a hypothesis of an earlier merge that is right after all. Each version tells which constraints it obeyed.
/// Poses are between the robots' map frames, so they hold for newer maps too, unless a robot begins a new frame.
#[utoipa::path(
    post, path = "/v1/sessions/{session}/constraints", tag = "constraints", operation_id = "add_constraint",
    params(SessionPath), request_body = NewConstraint,
    responses(
        (status = 201, description = "It stands", body = Constraint,
         headers(("location" = String, description = "Path of the constraint"))),
        BadConstraint,
    )
)]
pub(super) async fn add(
    State(state): State<AppState>,
    Extension(caller): Extension<Caller>,
    Path(SessionPath { session }): Path<SessionPath>,
    NewId(id): NewId,
    JsonBody(new): JsonBody<NewConstraint>,
) -> ApiResult<(StatusCode, [(HeaderName, String); 1], Json<Constraint>)> {
    let standing = state.store.get_session(&session).await?;
    let constraint = crate::model::Constraint {
        id: ConstraintId::new(id),
        rule: rules::read(&state, &standing, new.rule, "rule").await?,
        session,
        author: new.author.or_else(|| caller.author()),
        note: new.note,
        created_at: state.clock.now(),
    };
    let constraint = state.store.add_constraint(constraint).await?;
    let location = format!("/v1/sessions/{}/constraints/{}", constraint.session, constraint.id);
    Ok((
        StatusCode::CREATED,
        [(header::LOCATION, location)],
        Json(constraint.into()),
    ))
}

/// List a session's constraints
///
/// The oldest first.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/constraints", tag = "constraints", operation_id = "list_constraints",
    params(SessionPath, ListQuery),
    responses((status = 200, description = "One page", body = Page<Constraint>), SessionList)
)]
pub(super) async fn list(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
    Query(query): Query<ListQuery>,
) -> ApiResult<Json<Page<Constraint>>> {
    let constraints = state.store.list_constraints(&session, &query.page()?).await?;
    query.answer(constraints, |constraint| constraint.id).map(Json)
}

/// Read a constraint
#[utoipa::path(
    get, path = "/v1/sessions/{session}/constraints/{constraint}", tag = "constraints",
    operation_id = "get_constraint",
    params(ConstraintPath),
    responses((status = 200, description = "The constraint", body = Constraint), OfConstraint)
)]
pub(super) async fn get(
    State(state): State<AppState>,
    Path(ConstraintPath { session, constraint }): Path<ConstraintPath>,
) -> ApiResult<Json<Constraint>> {
    Ok(Json(state.store.get_constraint(&session, constraint).await?.into()))
}

/// Remove a constraint
///
/// Merges that begin from now on do not obey it. Versions that did keep telling so.
#[utoipa::path(
    delete, path = "/v1/sessions/{session}/constraints/{constraint}", tag = "constraints",
    operation_id = "remove_constraint",
    params(ConstraintPath),
    responses((status = 204, description = "It is gone"), OfConstraint)
)]
pub(super) async fn remove(
    State(state): State<AppState>,
    Path(ConstraintPath { session, constraint }): Path<ConstraintPath>,
) -> ApiResult<StatusCode> {
    state.store.remove_constraint(&session, constraint).await?;
    Ok(StatusCode::NO_CONTENT)
}
