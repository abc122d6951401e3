//! Server-sent events: jobs and sessions as they change.
//!
//! Events are made by looking at the store, never from the announcements, which only wake us up: so a client that comes
//! back with `Last-Event-ID` misses no version, whichever replica it reaches.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::time::Duration;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream::{self, Stream};
use serde::Serialize;

use super::error::ApiResult;
use super::extract::Path;
use super::jobs::JobPath;
use super::refusals::{InSession, OfJob};
use super::sessions::SessionPath;
use super::state::AppState;
use super::watch::{Watch, Woken};
use crate::api;
use crate::model::{Job, JobId, MapId, SessionId, Timestamp, VersionNumber};
use crate::store::{Change, Page};

/// A line now and then, so that nobody between us and the client takes the connection for dead.
const KEEP_ALIVE: Duration = Duration::from_secs(15);
/// Most versions that are told at one look; further ones are told at the next.
const VERSIONS_AT_ONCE: u32 = 100;

/// One event of a stream.
#[derive(utoipa::ToSchema)]
#[expect(dead_code, reason = "only for the OpenAPI document")]
struct StreamEvent {
    /// What it tells of: `job`, `version` or `session`.
    event: String,
    /// To come back with, as `Last-Event-ID`.
    id: String,
    /// It, as JSON.
    #[schema(content_media_type = "application/json")]
    data: String,
}

/// Follow a job
///
/// An event `job` with the whole job whenever it changes, until it has ended. A client that comes back with the last
/// `Last-Event-ID` after the end is answered 204, which tells an `EventSource` to stop.
#[utoipa::path(
    get, path = "/v1/jobs/{job}/events", tag = "jobs", operation_id = "job_events",
    params(JobPath, ("last-event-id" = Option<String>, Header, description = "Id of the last event that was seen")),
    responses(
        (status = 200, description = "Events `job`, each with a Job", body = StreamEvent,
         content_type = "text/event-stream"),
        (status = 204, description = "The job has ended, and the client has seen it"),
        OfJob,
    )
)]
pub(super) async fn of_job(
    State(state): State<AppState>,
    Path(JobPath { job: id }): Path<JobPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    let watch = Watch::start(&state);
    let job = state.store.get_job(id).await?;
    let seen = last_event_id(&headers);
    if job.state.is_terminal() && seen.as_deref() == Some(&job_tag(&job)) {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    Ok(sse(JobEvents {
        state,
        watch,
        id,
        seen,
        over: false,
    }
    .stream()))
}

struct JobEvents {
    state: AppState,
    watch: Watch,
    id: JobId,
    /// Tag of the last state that was told.
    seen: Option<String>,
    over: bool,
}

impl JobEvents {
    fn stream(self) -> impl Stream<Item = Event> {
        stream::unfold(self, |mut events| async move {
            let event = events.next().await?;
            Some((event, events))
        })
    }

    async fn next(&mut self) -> Option<Event> {
        loop {
            if self.over {
                return None;
            }
            let job = self.state.store.get_job(self.id).await.ok()?; // the client comes again and is told what is wrong
            self.over = job.state.is_terminal();
            let tag = job_tag(&job);
            if self.seen.as_ref() != Some(&tag) {
                self.seen = Some(tag.clone());
                return event("job", &tag, &api::Job::from(job));
            }
            let id = self.id;
            let ours = |change: &Change| matches!(change, Change::Job(_, changed, _) if *changed == id);
            if self.watch.next(ours).await == Woken::Stop {
                return None;
            }
        }
    }
}

/// What a client sees of a job: two looks with one tag show the same.
fn job_tag(job: &Job) -> String {
    let cancel = if job.cancel_requested { "-cancel" } else { "" };
    let stage = job.stage.as_deref().unwrap_or("none");
    let stage: String = stage.chars().filter(char::is_ascii_alphanumeric).collect();
    format!(
        "{}-{}-{stage}-{:.3}{cancel}",
        job.attempt,
        job.state.as_str(),
        job.progress
    )
}

/// Follow a session
///
/// An event `version` with a version in short for each version that is published, an event `job` with the whole job
/// whenever one changes, and an event `session` when its settings or its maps have changed. A client that comes back
/// with `Last-Event-ID` is told every version that it has missed (the newest 100); one that comes without is told the
/// newest.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/events", tag = "sessions", operation_id = "session_events",
    params(
        SessionPath,
        ("last-event-id" = Option<String>, Header, description = "Id of the last event that was seen"),
    ),
    responses(
        (status = 200, description = "Events `version` (VersionSummary), `job` (Job) and `session` (Session)",
         body = StreamEvent, content_type = "text/event-stream"),
        InSession,
    )
)]
pub(super) async fn of_session(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    let watch = Watch::start(&state);
    state.store.get_session(&session).await?;
    let told = last_event_id(&headers).and_then(|id| id.strip_prefix('v')?.parse().ok());
    Ok(sse(SessionEvents {
        state,
        watch,
        session,
        told,
        seen: None,
        jobs: VecDeque::new(),
        ready: VecDeque::new(),
    }
    .stream()))
}

struct SessionEvents {
    state: AppState,
    watch: Watch,
    session: SessionId,
    /// The newest version that was told; none before the first look.
    told: Option<u32>,
    /// The session as it was told: when its settings changed, and its newest map.
    seen: Option<(Timestamp, Option<MapId>)>,
    /// Tags of the jobs that were told, the oldest first.
    jobs: VecDeque<(JobId, String)>,
    /// Events that wait to be sent.
    ready: VecDeque<Event>,
}

/// Most jobs of a session whose last state is remembered.
const JOBS_REMEMBERED: usize = 64;

impl SessionEvents {
    fn stream(self) -> impl Stream<Item = Event> {
        stream::unfold((self, true), |(mut events, first)| async move {
            if first {
                events.look().await?;
            }
            let event = events.next().await?;
            Some((event, (events, false)))
        })
    }

    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.ready.pop_front() {
                return Some(event);
            }
            let session = self.session.clone();
            let woken = self.watch.next(|change| *change.session() == session).await;
            if woken == Woken::Stop {
                return None;
            }
            self.look().await?;
        }
    }

    /// Looks at the store and makes events of what is new; `None` when the session is gone.
    async fn look(&mut self) -> Option<()> {
        let store = self.state.store.clone();
        let session = store.get_session(&self.session).await.ok()?;
        let mut jobs = store.list_jobs(&self.session, &Page::first(8)).await.ok()?;
        jobs.reverse();
        for job in jobs {
            let tag = job_tag(&job);
            let known = self.jobs.iter().position(|(id, _)| *id == job.id);
            if known.is_some_and(|at| self.jobs[at].1 == tag) {
                continue;
            }
            if let Some(at) = known {
                self.jobs.remove(at);
            }
            self.jobs.push_back((job.id, tag));
            self.say("job", &api::Job::from(job));
        }
        while self.jobs.len() > JOBS_REMEMBERED {
            self.jobs.pop_front();
        }
        self.new_versions().await?;
        let newest = store.list_maps(&self.session, None, &Page::first(1)).await.ok()?;
        let shown = Some((session.updated_at, newest.first().map(|map| map.id)));
        if self.seen != shown {
            self.seen = shown;
            self.say("session", &api::Session::from(session));
        }
        Some(())
    }

    async fn new_versions(&mut self) -> Option<()> {
        let newest_first = Page::<VersionNumber>::first(if self.told.is_some() { VERSIONS_AT_ONCE } else { 1 });
        let versions = self
            .state
            .store
            .list_versions(&self.session, &newest_first)
            .await
            .ok()?;
        for version in versions.into_iter().rev() {
            if Some(version.number.get()) > self.told {
                self.told = Some(version.number.get());
                self.say("version", &api::VersionSummary::from(version));
            }
        }
        self.told = self.told.or(Some(0));
        Some(())
    }

    fn say(&mut self, name: &str, value: &impl Serialize) {
        let id = format!("v{}", self.told.unwrap_or(0));
        self.ready.extend(event(name, &id, value));
    }
}

fn last_event_id(headers: &HeaderMap) -> Option<String> {
    headers.get("last-event-id")?.to_str().ok().map(str::to_owned)
}

fn event(name: &str, id: &str, value: &impl Serialize) -> Option<Event> {
    Event::default().event(name).id(id).json_data(value).ok()
}

fn sse(events: impl Stream<Item = Event> + Send + 'static) -> Response {
    use futures_util::StreamExt as _;
    let events = events.map(Ok::<Event, Infallible>);
    Sse::new(events)
        .keep_alive(KeepAlive::new().interval(KEEP_ALIVE))
        .into_response()
}
