//! Sessions and their robots.

use axum::Json;
use axum::extract::{FromRequestParts, State};
use axum::http::request::Parts;
use axum::http::{HeaderName, StatusCode, header};
use serde::Deserialize;
use utoipa::IntoParams;

use super::calls::NewId;
use super::error::{ApiError, ApiResult};
use super::extract::{JsonBody, Path, Query, parse_query, take_repeated};
use super::list::ListQuery;
use super::refusals::{BadBody, BadList, BadPatch, InSession, SessionClash, SessionList};
use super::state::AppState;
use crate::api::{Page, Robot, Session};
use crate::model::{LabelFilter, RobotId, SessionId, SessionPatch, SessionSettings};
use crate::store::{Created, StoreError};

/// The session of a path.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct SessionPath {
    /// Name of the session.
    pub(super) session: SessionId,
}

/// A session that is there now, and where.
type Made = (StatusCode, [(HeaderName, String); 1], Json<Session>);

/// Make a session
///
/// The service chooses its name. Every setting has a default, so the body may be empty.
#[utoipa::path(
    post, path = "/v1/sessions", tag = "sessions", operation_id = "create_session",
    request_body = SessionSettings,
    responses(
        (status = 201, description = "It is made", body = Session,
         headers(("location" = String, description = "Path of the session"))),
        BadBody,
    )
)]
pub(super) async fn create(
    State(state): State<AppState>,
    NewId(id): NewId,
    JsonBody(settings): JsonBody<SessionSettings>,
) -> ApiResult<Made> {
    let id = SessionId::parse(&id.to_string())?;
    let value = match state.store.create_session(&id, &settings, state.clock.now()).await {
        // an earlier attempt of this request has made it, and somebody has changed it since
        Err(StoreError::SessionExists(_)) => state.store.get_session(&id).await?,
        made => made?.value,
    };
    Ok(made(Created { value, created: true }))
}

/// Make a session of this name
///
/// Idempotent: asking again with the same settings answers the session as it stands.
#[utoipa::path(
    put, path = "/v1/sessions/{session}", tag = "sessions", operation_id = "put_session",
    params(SessionPath), request_body = SessionSettings,
    responses(
        (status = 201, description = "It is made", body = Session,
         headers(("location" = String, description = "Path of the session"))),
        (status = 200, description = "It is there with these settings", body = Session),
        SessionClash,
    )
)]
pub(super) async fn put(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
    JsonBody(settings): JsonBody<SessionSettings>,
) -> ApiResult<Made> {
    let created = state
        .store
        .create_session(&session, &settings, state.clock.now())
        .await?;
    Ok(made(created))
}

fn made(session: Created<crate::model::Session>) -> Made {
    let status = if session.created {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let location = format!("/v1/sessions/{}", session.value.id);
    (status, [(header::LOCATION, location)], Json(session.value.into()))
}

/// Which sessions of the list.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct SessionListQuery {
    /// `NAME=VALUE`, split at the first `=`: only sessions with this label; `NAME`: with a label of this name. Several:
    /// sessions with all of them.
    #[param(value_type = Vec<String>, style = Form, explode, required = false, example = json!(["floor=2"]))]
    label: LabelFilter,
    /// Most items of the page.
    #[param(value_type = Option<u32>, default = 50, minimum = 1, maximum = 200)]
    #[expect(dead_code, reason = "for the document; read as a part of `list`")]
    page_size: (),
    /// `next_page_token` of the page before.
    #[param(value_type = Option<String>)]
    #[expect(dead_code, reason = "for the document; read as a part of `list`")]
    page_token: (),
    #[param(ignore)]
    list: ListQuery,
}

impl FromRequestParts<AppState> for SessionListQuery {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &AppState) -> ApiResult<Self> {
        let (labels, rest) = take_repeated(parts.uri.query().unwrap_or_default(), "label");
        Ok(Self {
            label: LabelFilter::parse(labels.iter().map(String::as_str))?,
            page_size: (),
            page_token: (),
            list: parse_query(&rest)?,
        })
    }
}

/// List sessions
///
/// In the order of their names; all, or those with some labels.
#[utoipa::path(
    get, path = "/v1/sessions", tag = "sessions", operation_id = "list_sessions",
    params(SessionListQuery),
    responses((status = 200, description = "One page", body = Page<Session>), BadList)
)]
pub(super) async fn list(
    State(state): State<AppState>,
    SessionListQuery { label, list, .. }: SessionListQuery,
) -> ApiResult<Json<Page<Session>>> {
    let sessions = state.store.list_sessions(&label, &list.page()?).await?;
    list.answer(sessions, |session| session.id.clone()).map(Json)
}

/// Read a session
#[utoipa::path(
    get, path = "/v1/sessions/{session}", tag = "sessions", operation_id = "get_session",
    params(SessionPath),
    responses((status = 200, description = "The session", body = Session), InSession)
)]
pub(super) async fn get(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
) -> ApiResult<Json<Session>> {
    Ok(Json(state.store.get_session(&session).await?.into()))
}

/// Change a session's settings
///
/// What is absent stays; `null` takes back what may be absent. A new anchor moves the session frame: versions from now
/// on are told in that robot's map frame.
#[utoipa::path(
    patch, path = "/v1/sessions/{session}", tag = "sessions", operation_id = "patch_session",
    params(SessionPath), request_body = SessionPatch,
    responses((status = 200, description = "The session as it is now", body = Session), BadPatch)
)]
pub(super) async fn patch(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
    JsonBody(patch): JsonBody<SessionPatch>,
) -> ApiResult<Json<Session>> {
    let session = state.store.patch_session(&session, patch, state.clock.now()).await?;
    Ok(Json(session.into()))
}

/// Delete a session
///
/// With its maps, jobs and versions, for good.
#[utoipa::path(
    delete, path = "/v1/sessions/{session}", tag = "sessions", operation_id = "delete_session",
    params(SessionPath),
    responses((status = 204, description = "It is gone"), InSession)
)]
pub(super) async fn delete(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
) -> ApiResult<StatusCode> {
    state.store.delete_session(&session).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// List a session's robots
///
/// Those that have pushed a map, in the order of their names.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/robots", tag = "sessions", operation_id = "list_robots",
    params(SessionPath, ListQuery),
    responses((status = 200, description = "One page", body = Page<Robot>), SessionList)
)]
pub(super) async fn robots(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
    Query(query): Query<ListQuery>,
) -> ApiResult<Json<Page<Robot>>> {
    let crate::store::Page { after, size } = query.page::<RobotId>()?;
    let mut robots = state.store.list_robots(&session).await?;
    // a session has few robots: the page is cut out here
    robots.retain(|robot| after.as_ref().is_none_or(|after| robot.robot > *after));
    robots.truncate(size as usize);
    query.answer(robots, |robot| robot.robot.clone()).map(Json)
}
