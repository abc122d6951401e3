//! Why the store did not do what it was asked.

use crate::meters;
use crate::model::{BlobKey, Clash, ConstraintId, JobId, KeyId, MapId, SessionId, VersionSelector};

/// Why the store did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// There is no such record.
    #[error("{0} does not exist")]
    NotFound(Missing),
    /// The session is there, with other settings than asked for.
    #[error("session {0} exists with other settings; change them with PATCH")]
    SessionExists(SessionId),
    /// The queue holds no further job.
    #[error("the queue of {scope} is full: {queued} jobs wait, the limit is {limit}; try again later")]
    QueueFull {
        /// Whose queue.
        scope: QueueScope,
        /// Jobs that wait.
        queued: u32,
        /// The most that may wait.
        limit: u32,
    },
    /// The constraint cannot hold together with those that stand.
    #[error(transparent)]
    Clash(#[from] Clash),
    /// The session has as many constraints as it may have.
    #[error("session {session} has {limit} constraints, the limit; remove one first")]
    TooManyConstraints {
        /// The session.
        session: SessionId,
        /// The most that it may have.
        limit: u32,
    },
    /// The bytes of this blob are being removed right now.
    #[error("the bytes of blob {0} are being removed right now; try again")]
    BlobBusy(BlobKey),
    /// The bytes of this blob were removed since they were kept.
    #[error("the bytes of blob {0} were removed meanwhile; keep them again")]
    BlobRemoved(BlobKey),
    /// Somebody else has the job now, or it is over.
    #[error("the lease of job {0} is lost: it was claimed again, ended, or deleted with its session")]
    LeaseLost(JobId),
    /// Another process has the files open.
    #[error("{path} is in use by another process; SQLite serves one process at a time")]
    InUse {
        /// The lock file.
        path: String,
    },
    /// The store is out of reach or out of room right now: worth trying again.
    #[error("the store cannot be reached right now: {0}")]
    Unavailable(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// What was read is not what was written.
    #[error("the store is damaged: {0}")]
    Damaged(String),
}

/// A part of the store: makes its failures, and counts them.
#[derive(Debug, Clone, Copy)]
pub(super) enum Part {
    /// The database.
    Records,
    /// The blobs.
    Blobs,
}

impl Part {
    pub(super) fn unavailable(self, error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> StoreError {
        meters::store_error(self.as_str(), "unavailable");
        StoreError::Unavailable(error.into())
    }

    pub(super) fn damaged(self, what: impl Into<String>) -> StoreError {
        meters::store_error(self.as_str(), "damaged");
        StoreError::Damaged(what.into())
    }

    fn as_str(self) -> &'static str {
        match self {
            Self::Records => "records",
            Self::Blobs => "blobs",
        }
    }
}

/// A record that is not there.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Missing {
    /// No such session.
    #[error("session {0}")]
    Session(SessionId),
    /// No such map in the session.
    #[error("map {1} of session {0}")]
    Map(SessionId, MapId),
    /// No such job.
    #[error("job {0}")]
    Job(JobId),
    /// No such version of the session.
    #[error("version {1} of session {0}")]
    Version(SessionId, VersionSelector),
    /// No such constraint of the session.
    #[error("constraint {1} of session {0}")]
    Constraint(SessionId, ConstraintId),
    /// No such blob.
    #[error("blob {0}")]
    Blob(BlobKey),
    /// No such key.
    #[error("key {0}")]
    Key(KeyId),
}

/// Which bound of the queue was met.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum QueueScope {
    /// That of one session.
    #[error("session {0}")]
    Session(SessionId),
    /// That of all sessions together.
    #[error("the service")]
    Total,
}
