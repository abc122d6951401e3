//! Merges and the jobs that do them.

use std::time::Duration;

use axum::Json;
use axum::extract::{Extension, State};
use axum::http::{HeaderName, StatusCode, header};
use serde::Deserialize;
use utoipa::IntoParams;

use super::calls::NewId;
use super::error::{ApiError, ApiResult};
use super::extract::{JsonBody, Path, Query, parsed};
use super::list::ListQuery;
use super::refusals::{BadMerge, OfJob, SessionList};
use super::rules;
use super::sessions::SessionPath;
use super::state::AppState;
use super::watch::ended_job;
use crate::api::{Job, NewMerge, Page};
use crate::model::{JobId, TraceParent};
use crate::store::AskedMerge;
use crate::telemetry;

/// The job of a path.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct JobPath {
    /// Id of the job.
    #[serde(deserialize_with = "parsed")]
    pub(super) job: JobId,
}

/// How long to wait for a job.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct WaitQuery {
    /// Seconds to wait for the job to end, at most 60; the answer comes as soon as it has, or with the job as it is.
    #[param(minimum = 0, maximum = 60, example = 20)]
    wait: Option<f64>,
}

/// Longest wait.
const WAIT_MAX_SECONDS: f64 = 60.0;

/// Merge now
///
/// Registers the newest map of each robot and fuses those that can be placed. With `auto_merge` an upload does this by
/// itself. Follow the job at `Location`.
///
/// An operator steers it: previews with `dry_run`, says how maps lie with `rules` (for all merges: make constraints),
/// moves the session frame with `anchor`, rolls back with `restore`.
#[utoipa::path(
    post, path = "/v1/sessions/{session}/merges", tag = "jobs", operation_id = "merge",
    params(SessionPath), request_body = NewMerge,
    responses(
        (status = 202, description = "It is queued", body = Job, headers(
            ("location" = String, description = "Path of the job"),
            ("retry-after" = u32, description = "Seconds after which to look"),
        )),
        BadMerge,
    )
)]
pub(super) async fn merge(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
    NewId(id): NewId,
    Extension(trace): Extension<TraceParent>,
    JsonBody(new): JsonBody<NewMerge>,
) -> ApiResult<(StatusCode, [(HeaderName, String); 2], Json<Job>)> {
    let standing = state.store.get_session(&session).await?;
    let request = rules::read_merge(&state, &standing, new).await?;
    let asked = AskedMerge {
        request,
        trace: Some(trace),
    };
    let job = state
        .store
        .enqueue_merge(&session, JobId::new(id), asked, state.clock.now())
        .await?;
    telemetry::tell_job(&job.id);
    let headers = [
        (header::LOCATION, format!("/v1/jobs/{}", job.id)),
        (header::RETRY_AFTER, "1".to_owned()),
    ];
    Ok((StatusCode::ACCEPTED, headers, Json(job.into())))
}

/// List a session's merges
///
/// The newest first.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/merges", tag = "jobs", operation_id = "list_merges",
    params(SessionPath, ListQuery),
    responses((status = 200, description = "One page", body = Page<Job>), SessionList)
)]
pub(super) async fn list(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
    Query(query): Query<ListQuery>,
) -> ApiResult<Json<Page<Job>>> {
    let jobs = state.store.list_jobs(&session, &query.page()?).await?;
    query.answer(jobs, |job| job.id).map(Json)
}

/// Read a job
///
/// With `wait` the answer comes when the job has ended (a long poll).
#[utoipa::path(
    get, path = "/v1/jobs/{job}", tag = "jobs", operation_id = "get_job",
    params(JobPath, WaitQuery),
    responses((status = 200, description = "The job", body = Job), OfJob)
)]
pub(super) async fn get(
    State(state): State<AppState>,
    Path(JobPath { job }): Path<JobPath>,
    Query(query): Query<WaitQuery>,
) -> ApiResult<Json<Job>> {
    let job = ended_job(&state, job, query.wait()?).await?;
    Ok(Json(job.into()))
}

impl WaitQuery {
    fn wait(&self) -> ApiResult<Duration> {
        let seconds = self.wait.unwrap_or(0.0);
        if (0.0..=WAIT_MAX_SECONDS).contains(&seconds) {
            Ok(Duration::from_secs_f64(seconds))
        } else {
            Err(ApiError::invalid(
                "wait",
                seconds.to_string(),
                "within 0 and 60 seconds",
            ))
        }
    }
}

/// Cancel a job
///
/// A job that waits ends at once; one that runs ends at its next stage; one that has ended stays as it is.
#[utoipa::path(
    post, path = "/v1/jobs/{job}:cancel", tag = "jobs", operation_id = "cancel_job",
    params(JobPath),
    responses((status = 200, description = "The job as it is now", body = Job), OfJob)
)]
pub(super) async fn cancel(
    State(state): State<AppState>,
    Path(JobPath { job }): Path<JobPath>,
) -> ApiResult<Json<Job>> {
    let job = state.store.cancel_job(job, state.clock.now()).await?;
    Ok(Json(job.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_is_bounded() {
        let wait = |seconds| WaitQuery { wait: Some(seconds) }.wait();
        assert_eq!(wait(60.0).expect("a minute"), Duration::from_mins(1));
        for bad in [-1.0, 60.5, f64::NAN, f64::INFINITY] {
            assert!(wait(bad).is_err(), "{bad}");
        }
    }
}
