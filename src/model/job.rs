//! A job: work that is queued, done once, and remembered.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Author, JobId, MethodSpec, ResultText, RobotId, Rule, SessionId, Timestamp, TraceParent, VersionNumber};

/// A job as everybody may see it. Who holds its lease is the store's business.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// Its id.
    pub id: JobId,
    /// The session that it works on.
    pub session: SessionId,
    /// What kind of work it is.
    pub kind: JobKind,
    /// What is to be done.
    pub request: MergeRequest,
    /// How far it has come.
    pub state: JobState,
    /// How often it was begun.
    pub attempt: u32,
    /// How often it may be begun.
    pub max_attempts: u32,
    /// Not to be begun earlier.
    pub run_after: Timestamp,
    /// What is being done right now.
    pub stage: Option<String>,
    /// How much of the work is done, in [0, 1].
    pub progress: f64,
    /// Whether somebody has asked for it to end.
    pub cancel_requested: bool,
    /// Why the last attempt failed, or why it was cancelled.
    pub error: Option<JobError>,
    /// The version that it published.
    pub version: Option<VersionNumber>,
    /// What a dry run found.
    pub result: Option<ResultText>,
    /// How long each stage took.
    pub timings: Vec<StageSeconds>,
    /// When it was asked for.
    pub created_at: Timestamp,
    /// When the last attempt was begun.
    pub started_at: Option<Timestamp>,
    /// When it ended.
    pub finished_at: Option<Timestamp>,
    /// The span of the request that asked for it, if that is known.
    pub trace: Option<TraceParent>,
}

/// What a job can do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    /// Welds the newest map of each robot into one.
    Merge,
}

/// The states of a job and the ways between them:
///
/// ```text
///            claim                publish or dry run done
/// queued --------------> running ------------------------> succeeded
///    ^                    |  |  |
///    |  fail with attempts|  |  | fail for good, or out of attempts
///    +--left, or release--+  |  +--------------------------> failed
///    |                       |
///    +------ cancel ---------+-----------------------------> cancelled
/// ```
///
/// A running job whose lease has expired is claimed as a queued one is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waits for a worker.
    Queued,
    /// A worker has leased it.
    Running,
    /// Done.
    Succeeded,
    /// Will not be tried again.
    Failed,
    /// Somebody ended it.
    Cancelled,
}

impl JobState {
    /// All states.
    pub const ALL: [Self; 5] = [
        Self::Queued,
        Self::Running,
        Self::Succeeded,
        Self::Failed,
        Self::Cancelled,
    ];

    /// As on the wire.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Whether nothing will change any more.
    #[must_use]
    pub fn is_terminal(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// What to merge, and how; what is absent is as the session says.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MergeRequest {
    /// Only find the answer: publish no version.
    pub dry_run: bool,
    /// Merge the maps of these robots only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robots: Option<Vec<RobotId>>,
    /// Another method than the session's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<MethodSpec>,
    /// Another anchor: the session's from the version on that this merge publishes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anchor: Option<RobotId>,
    /// Rules for this merge alone, besides the session's standing constraints.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rules: Vec<Rule>,
    /// Merge nothing: publish the content of this version again, as the newest one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub restore: Option<VersionNumber>,
    /// Who asks, as far as that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub author: Option<Author>,
}

/// Why a job, or an attempt at it, failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct JobError {
    /// Stable, for programs, in `snake_case`.
    pub code: String,
    /// For people.
    pub message: String,
}

impl JobError {
    /// An error of this code and message.
    pub fn new(code: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            code: code.into(),
            message: message.into(),
        }
    }
}

/// How long one stage of a job took.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StageSeconds {
    /// The stage.
    pub stage: String,
    /// Its seconds.
    pub seconds: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_written_in_one_way() {
        for state in JobState::ALL {
            let json = serde_json::to_string(&state).expect("serialises");
            assert_eq!(json, format!("\"{}\"", state.as_str()));
        }
    }

    #[test]
    fn a_merge_request_may_be_empty_and_refuses_what_it_does_not_know() {
        assert_eq!(
            serde_json::from_str::<MergeRequest>("{}").expect("parses"),
            MergeRequest::default()
        );
        assert!(serde_json::from_str::<MergeRequest>(r#"{"dryrun":true}"#).is_err());
    }
}
