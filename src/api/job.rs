//! Jobs on the wire. A merge is asked for with a [`NewMerge`](super::NewMerge).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{MergeResult, Verbatim};
use crate::model::{
    JobError, JobId, JobKind, JobState, MergeRequest, SessionId, StageSeconds, Timestamp, VersionNumber,
};

/// Work that is queued, done once, and remembered.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
pub struct Job {
    /// Its id.
    pub id: JobId,
    /// The session that it works on.
    pub session: SessionId,
    /// What kind of work it is.
    pub kind: JobKind,
    /// How far it has come; `succeeded`, `failed` and `cancelled` are final.
    pub state: JobState,
    /// What is being done right now.
    pub stage: Option<String>,
    /// How much of the work is done, in [0, 1].
    #[schema(minimum = 0, maximum = 1)]
    pub progress: f64,
    /// The version that it published.
    pub version: Option<VersionNumber>,
    /// What a dry run found.
    #[schema(value_type = Option<MergeResult>)]
    pub result: Option<Verbatim<MergeResult>>,
    /// Why the last attempt failed, or why it was cancelled.
    pub error: Option<JobError>,
    /// Whether somebody has asked for it to end.
    pub cancel_requested: bool,
    /// How often it was begun.
    pub attempt: u32,
    /// How often it may be begun.
    pub max_attempts: u32,
    /// Not to be begun earlier.
    pub run_after: Timestamp,
    /// What is to be done.
    pub request: MergeRequest,
    /// How long each stage took.
    pub timings: Vec<StageSeconds>,
    /// When it was asked for.
    pub created_at: Timestamp,
    /// When the last attempt was begun.
    pub started_at: Option<Timestamp>,
    /// When it ended.
    pub finished_at: Option<Timestamp>,
}

impl From<crate::model::Job> for Job {
    fn from(job: crate::model::Job) -> Self {
        Self {
            id: job.id,
            session: job.session,
            kind: job.kind,
            state: job.state,
            stage: job.stage,
            progress: job.progress,
            version: job.version,
            result: job.result.map(|result| Verbatim::new(result.raw().to_owned())),
            error: job.error,
            cancel_requested: job.cancel_requested,
            attempt: job.attempt,
            max_attempts: job.max_attempts,
            run_after: job.run_after,
            request: job.request,
            timings: job.timings,
            created_at: job.created_at,
            started_at: job.started_at,
            finished_at: job.finished_at,
        }
    }
}
