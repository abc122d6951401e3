//! The terms of the contract: what a store is asked with, and what it answers and tells.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::model::{
    BlobKey, Digest, Job, JobId, JobState, MapId, MapRecord, MergeRequest, NewMap, ResultText, RobotId, SessionId,
    SessionSettings, StageSeconds, TraceParent, VersionInput, VersionNumber,
};

/// What was asked for and whether it was made just now.
#[derive(Debug, Clone, PartialEq)]
pub struct Created<T> {
    /// What stands now.
    pub value: T,
    /// Whether this call made it.
    pub created: bool,
}

/// A part of a list: at most `size` entries that come after the key `after` in the list's order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page<K> {
    /// The last key of the page before; none for the first page.
    pub after: Option<K>,
    /// The most entries.
    pub size: u32,
}

impl<K> Page<K> {
    /// The first `size` entries.
    #[must_use]
    pub fn first(size: u32) -> Self {
        Self { after: None, size }
    }
}

/// A merge that somebody asks for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AskedMerge {
    /// What is to be done.
    pub request: MergeRequest,
    /// The span of the request that asks for it.
    pub trace: Option<TraceParent>,
}

impl From<MergeRequest> for AskedMerge {
    fn from(request: MergeRequest) -> Self {
        Self { request, trace: None }
    }
}

/// A map to be added.
#[derive(Debug, Clone, PartialEq)]
pub struct AddMap {
    /// The session.
    pub session: SessionId,
    /// Makes the session with these settings when it is not there; otherwise that is an error.
    pub create_session: Option<SessionSettings>,
    /// The robot.
    pub robot: RobotId,
    /// The map's id, if it is new.
    pub id: MapId,
    /// The job's id, if one is needed.
    pub job: JobId,
    /// The map.
    pub map: NewMap,
    /// The span of the request that adds it: the job that it causes belongs to the same trace.
    pub trace: Option<TraceParent>,
}

/// What became of a map that was to be added.
#[derive(Debug, Clone, PartialEq)]
pub struct Added {
    /// The map that stands now.
    pub map: MapRecord,
    /// Whether it is new.
    pub created: bool,
}

/// A job in the hands of one worker.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// What every later write of the worker shows.
    pub lease: Lease,
    /// The job as it was claimed.
    pub job: Job,
}

/// The right to write about a job, as long as nobody else has claimed it since.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lease {
    /// The job.
    pub job: JobId,
    /// Grows with every claim of the job.
    pub token: u64,
}

/// How far a job is.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProgressReport {
    /// What is being done.
    pub stage: Option<String>,
    /// How much is done, in [0, 1].
    pub progress: f64,
}

/// The answer to a worker that holds on to its lease.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Renewed {
    /// Whether somebody has asked for the job to end.
    pub cancel_requested: bool,
}

/// What happens to a job whose attempt failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Retry {
    /// Try again after this long, if an attempt is left.
    After(Duration),
    /// It would fail again.
    Never,
}

/// What a job found, to be published.
#[derive(Debug, Clone, PartialEq)]
pub struct NewVersion {
    /// The robot whose map frame it is told in.
    pub anchor: RobotId,
    /// The maps that went in, one a robot, ordered by robot.
    pub inputs: Vec<VersionInput>,
    /// What is placed where and why.
    pub result: ResultText,
    /// The cells of the fused map.
    pub grid: BlobKey,
    /// The fused map as a picture for map servers.
    pub png: BlobKey,
    /// Each robot in its own colour.
    pub overlay: BlobKey,
    /// The content of the fused map.
    pub digest: Digest,
    /// The version whose content this one repeats.
    pub restored_from: Option<VersionNumber>,
    /// Whether its anchor becomes the session's.
    pub reanchors: bool,
    /// How long each stage took.
    pub timings: Vec<StageSeconds>,
}

impl NewVersion {
    /// The blobs that it names.
    #[must_use]
    pub fn blobs(&self) -> [BlobKey; 3] {
        [self.grid, self.png, self.overlay]
    }
}

/// How much work there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct QueueDepth {
    /// Jobs that wait.
    pub queued: u32,
    /// Jobs that are leased.
    pub running: u32,
}

/// How many jobs may wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueLimits {
    /// For one session.
    pub per_session: u32,
    /// In all.
    pub total: u32,
    /// How often a job is begun before it is parked as failed.
    pub max_attempts: u32,
}

impl Default for QueueLimits {
    fn default() -> Self {
        Self {
            per_session: 32,
            total: 1024,
            max_attempts: 3,
        }
    }
}

/// Something that has changed in the store.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// A session was made, changed or deleted.
    Session(SessionId),
    /// A map was added.
    Map(SessionId, MapId),
    /// A job has a new state, stage or progress.
    Job(SessionId, JobId, JobState),
    /// A version was published.
    Version(SessionId, VersionNumber),
}

impl Change {
    /// The session that it is about.
    #[must_use]
    pub fn session(&self) -> &SessionId {
        match self {
            Self::Session(session) | Self::Map(session, _) | Self::Job(session, ..) | Self::Version(session, _) => {
                session
            }
        }
    }
}
