//! The store: records and the queue, kept. One method of [`Store`] is one transaction and one use case.
//!
//! Imports `geometry`, `grid`, `registration`, `model` and `clock`. Time and ids are handed in, so that every clause of
//! the protocol is tested with explicit times.
//!
//! The protocol of the queue:
//!
//! 1. [`Store::claim_job`] leases a job that is due, or one whose lease has expired, to one worker, and makes a new
//!    token. Jobs of one session run one after the other, so that a later version never has older maps.
//! 2. The worker renews the lease while it computes ([`Store::renew_lease`]) and learns there that it shall stop.
//! 3. Everything that it writes is fenced by the token: when somebody else has claimed the job since, nothing is changed
//!    and the answer is [`StoreError::LeaseLost`]. The result is dropped.
//! 4. [`Store::publish_version`] is one transaction: the version and the end of the job. So a job may run more than once
//!    and takes effect exactly once.

mod blob_list;
mod blobs;
mod calls;
mod error;
mod keys;
mod postgres;
mod rows;
mod s3;
mod sqlite;
mod terms;
mod upkeep;

use std::time::Duration;

pub use blob_list::Kept;
pub use blobs::Blobs;
pub use calls::{Attempt, Begun, Call, CallEnd, CallStore, KeptAnswer, KeptHeader};
pub use error::{Missing, QueueScope, StoreError};
pub use keys::KeyStore;
pub use postgres::PostgresStore;
pub use sqlite::SqliteStore;
pub use terms::{
    AddMap, Added, AskedMerge, Change, Claim, Created, Lease, NewVersion, Page, ProgressReport, QueueDepth,
    QueueLimits, Renewed, Retry,
};
pub use upkeep::{BlobMark, MARK_HOLD, Pruned, Upkeep, keep_blob};

use async_trait::async_trait;
use tokio::sync::broadcast;

use crate::model::{
    Constraint, ConstraintId, Job, JobError, JobId, JobState, LabelFilter, MapId, MapRecord, ResultText, RobotId,
    RobotSummary, Session, SessionId, SessionPatch, SessionSettings, StageSeconds, Timestamp, Version, VersionNumber,
    VersionSelector,
};

/// Where records and the queue are kept. Every back end passes the same contract suite
/// (`tests/service/store_contract.rs`).
#[async_trait]
pub trait Store: KeyStore + CallStore + Upkeep {
    // Sessions

    /// Makes a session. When it is there already with the settings that are asked for, it is answered as it stands.
    ///
    /// # Errors
    /// [`StoreError::SessionExists`] when it is there with other settings.
    async fn create_session(
        &self,
        id: &SessionId,
        settings: &SessionSettings,
        now: Timestamp,
    ) -> Result<Created<Session>, StoreError>;

    /// One session.
    async fn get_session(&self, id: &SessionId) -> Result<Session, StoreError>;

    /// Sessions with these labels, by name.
    async fn list_sessions(&self, labels: &LabelFilter, page: &Page<SessionId>) -> Result<Vec<Session>, StoreError>;

    /// Changes the settings of a session.
    async fn patch_session(&self, id: &SessionId, patch: SessionPatch, now: Timestamp) -> Result<Session, StoreError>;

    /// Deletes a session with everything that belongs to it. A job that runs for it loses its lease.
    async fn delete_session(&self, id: &SessionId) -> Result<(), StoreError>;

    /// The robots that have pushed to a session, by name.
    async fn list_robots(&self, session: &SessionId) -> Result<Vec<RobotSummary>, StoreError>;

    // Maps

    /// Adds a map to its session and, when the session merges by itself, makes sure that a job will take it in: one
    /// that is queued and not begun takes it along, otherwise exactly one is added. The same content from the same
    /// robot again changes nothing and answers the map that is there. The first robot becomes the anchor.
    ///
    /// The blob must be durable before ([`keep_blob`]).
    ///
    /// # Errors
    /// [`StoreError::QueueFull`] when it would need one job more than the queue holds; the map is then not added.
    /// [`StoreError::BlobRemoved`] when its blob must be kept again.
    async fn add_map_and_enqueue(&self, add: AddMap, now: Timestamp) -> Result<Added, StoreError>;

    /// Maps of a session, newest first, of one robot if it is named.
    async fn list_maps(
        &self,
        session: &SessionId,
        robot: Option<&RobotId>,
        page: &Page<MapId>,
    ) -> Result<Vec<MapRecord>, StoreError>;

    /// One map of a session.
    async fn get_map(&self, session: &SessionId, map: MapId) -> Result<MapRecord, StoreError>;

    /// The newest map of each robot, by robot: what a merge takes.
    async fn newest_maps(&self, session: &SessionId) -> Result<Vec<MapRecord>, StoreError>;

    // Jobs, for those who ask

    /// Asks for a merge now. When the job of this id is there already, it is answered as it stands.
    ///
    /// # Errors
    /// [`StoreError::QueueFull`].
    async fn enqueue_merge(
        &self,
        session: &SessionId,
        job: JobId,
        asked: AskedMerge,
        now: Timestamp,
    ) -> Result<Job, StoreError>;

    /// One job.
    async fn get_job(&self, job: JobId) -> Result<Job, StoreError>;

    /// Jobs of a session, newest first.
    async fn list_jobs(&self, session: &SessionId, page: &Page<JobId>) -> Result<Vec<Job>, StoreError>;

    /// Ends a queued job, asks a running one to end, leaves an ended one as it is.
    async fn cancel_job(&self, job: JobId, now: Timestamp) -> Result<Job, StoreError>;

    /// How much work waits and runs.
    async fn queue_depth(&self) -> Result<QueueDepth, StoreError>;

    // Jobs, for those who do them

    /// Leases the job that has been due longest to `owner` until `now + lease`, if there is one to do. Jobs whose lease
    /// has expired count as due; those of them that have no attempt left are parked as failed, those that were to be
    /// cancelled are cancelled.
    async fn claim_job(&self, owner: &str, lease: Duration, now: Timestamp) -> Result<Option<Claim>, StoreError>;

    /// Holds the lease until `now + lease`, tells how far the work is, and asks whether to go on.
    async fn renew_lease(
        &self,
        lease: &Lease,
        hold: Duration,
        report: &ProgressReport,
        now: Timestamp,
    ) -> Result<Renewed, StoreError>;

    /// Publishes what a job found as the next version of its session and ends the job.
    ///
    /// # Errors
    /// [`StoreError::BlobRemoved`] when one of its blobs must be kept again.
    async fn publish_version(&self, lease: &Lease, version: NewVersion, now: Timestamp) -> Result<Version, StoreError>;

    /// Ends a dry run with what it found.
    async fn finish_dry_run(
        &self,
        lease: &Lease,
        result: &ResultText,
        timings: &[StageSeconds],
        now: Timestamp,
    ) -> Result<(), StoreError>;

    /// Ends an attempt that failed: the job goes back to the queue, or is over when `retry` says so or no attempt is
    /// left.
    async fn fail_job(
        &self,
        lease: &Lease,
        error: &JobError,
        retry: Retry,
        now: Timestamp,
    ) -> Result<JobState, StoreError>;

    /// Ends a job that was asked to end.
    async fn finish_cancelled(&self, lease: &Lease, now: Timestamp) -> Result<(), StoreError>;

    /// Gives a job back to the queue as if it had not been begun: for a worker that stops.
    async fn release_job(&self, lease: &Lease, now: Timestamp) -> Result<(), StoreError>;

    // Versions

    /// Versions of a session, newest first.
    async fn list_versions(&self, session: &SessionId, page: &Page<VersionNumber>) -> Result<Vec<Version>, StoreError>;

    /// One version of a session.
    async fn get_version(&self, session: &SessionId, version: VersionSelector) -> Result<Version, StoreError>;

    // Constraints

    /// Keeps a rule for all merges of its session from now on. When the constraint of this id is there already, it is
    /// answered as it stands.
    ///
    /// # Errors
    /// [`StoreError::Clash`] when it cannot hold together with those that stand, [`StoreError::TooManyConstraints`].
    async fn add_constraint(&self, constraint: Constraint) -> Result<Constraint, StoreError>;

    /// Constraints of a session, the oldest first.
    async fn list_constraints(
        &self,
        session: &SessionId,
        page: &Page<ConstraintId>,
    ) -> Result<Vec<Constraint>, StoreError>;

    /// One constraint of a session.
    async fn get_constraint(&self, session: &SessionId, id: ConstraintId) -> Result<Constraint, StoreError>;

    /// Removes a constraint: merges that begin from now on do not obey it.
    async fn remove_constraint(&self, session: &SessionId, id: ConstraintId) -> Result<(), StoreError>;

    // The store itself

    /// Whether records can be written right now.
    async fn check(&self) -> Result<(), StoreError>;

    /// Is told of every change from now on, as soon as it is committed. A reader that lags, or misses one, reads the
    /// store again: changes are a wake-up, not a record.
    fn changes(&self) -> broadcast::Receiver<Change>;

    /// Waits for what is under way and closes. Nothing is lost without it.
    async fn close(&self);
}
