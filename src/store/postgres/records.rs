//! What a store does, each in its transaction: the SQL is in the files beside this one.

use std::time::Duration;

use async_trait::async_trait;
use sqlx::PgConnection;
use tokio::sync::broadcast;
use tokio::time::timeout;

use super::queue::Tried;
use super::{
    Failed as _, PostgresStore, changed, commit, constraints, job_change, jobs, maps, queue, rows, sessions,
    unavailable, upkeep, versions,
};
use crate::failpoint::{self, Point};
use crate::meters;
use crate::model::{
    Constraint, ConstraintId, Job, JobError, JobId, JobState, LabelFilter, MapId, MapRecord, ResultText, RobotId,
    RobotSummary, Session, SessionId, SessionPatch, SessionSettings, StageSeconds, Timestamp, Version, VersionNumber,
    VersionSelector,
};
use crate::store::{
    AddMap, Added, AskedMerge, Change, Claim, Created, Lease, NewVersion, Page, ProgressReport, QueueDepth, Renewed,
    Retry, Store, StoreError,
};

/// How often a claim looks again because another worker was faster, before it is left to the next poll.
const CLAIM_TRIES: u32 = 16;
/// Longest time to say goodbye to the database.
const GOODBYE: Duration = Duration::from_secs(3);

#[async_trait]
impl Store for PostgresStore {
    async fn create_session(
        &self,
        id: &SessionId,
        settings: &SessionSettings,
        now: Timestamp,
    ) -> Result<Created<Session>, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let made = sessions::create(&mut tx, id, settings, now).await?;
            let change = made.created.then(|| Change::Session(id.clone()));
            commit(tx, change.as_slice()).await?;
            Ok(made)
        })
        .await
    }

    async fn get_session(&self, id: &SessionId) -> Result<Session, StoreError> {
        self.within(async { sessions::get(&mut *self.reader().await?, id).await })
            .await
    }

    async fn list_sessions(&self, labels: &LabelFilter, page: &Page<SessionId>) -> Result<Vec<Session>, StoreError> {
        self.within(async { sessions::list(&mut *self.reader().await?, labels, page).await })
            .await
    }

    async fn patch_session(&self, id: &SessionId, patch: SessionPatch, now: Timestamp) -> Result<Session, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let session = sessions::patch(&mut tx, id, patch, now).await?;
            commit(tx, &[Change::Session(id.clone())]).await?;
            Ok(session)
        })
        .await
    }

    async fn delete_session(&self, id: &SessionId) -> Result<(), StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            sessions::delete(&mut tx, id).await?;
            commit(tx, &[Change::Session(id.clone())]).await
        })
        .await
    }

    async fn list_robots(&self, session: &SessionId) -> Result<Vec<RobotSummary>, StoreError> {
        self.within(async { sessions::robots(&mut *self.reader().await?, session).await })
            .await
    }

    async fn add_map_and_enqueue(&self, add: AddMap, now: Timestamp) -> Result<Added, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            upkeep::hold_off_marks(&mut tx).await?;
            let added = maps::add_and_enqueue(&mut tx, add, &self.limits, now).await?;
            failpoint::reach(Point::BeforeCommit);
            let session = &added.map.session;
            let mut changes = Vec::new();
            if added.created {
                changes.push(Change::Map(session.clone(), added.map.id));
                changes.extend(
                    added
                        .map
                        .job
                        .map(|job| Change::Job(session.clone(), job, JobState::Queued)),
                );
            }
            commit(tx, &changes).await?;
            Ok(added)
        })
        .await
    }

    async fn list_maps(
        &self,
        session: &SessionId,
        robot: Option<&RobotId>,
        page: &Page<MapId>,
    ) -> Result<Vec<MapRecord>, StoreError> {
        self.within(async { maps::list(&mut *self.reader().await?, session, robot, page).await })
            .await
    }

    async fn get_map(&self, session: &SessionId, map: MapId) -> Result<MapRecord, StoreError> {
        self.within(async { maps::get(&mut *self.reader().await?, session, map).await })
            .await
    }

    async fn newest_maps(&self, session: &SessionId) -> Result<Vec<MapRecord>, StoreError> {
        self.within(async { maps::newest(&mut *self.reader().await?, session).await })
            .await
    }

    async fn enqueue_merge(
        &self,
        session: &SessionId,
        job: JobId,
        asked: AskedMerge,
        now: Timestamp,
    ) -> Result<Job, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let job = jobs::enqueue_merge(&mut tx, session, job, &asked, &self.limits, now).await?;
            commit(tx, &[changed(&job)]).await?;
            Ok(job)
        })
        .await
    }

    async fn get_job(&self, job: JobId) -> Result<Job, StoreError> {
        self.within(async { jobs::get(&mut *self.reader().await?, job).await })
            .await
    }

    async fn list_jobs(&self, session: &SessionId, page: &Page<JobId>) -> Result<Vec<Job>, StoreError> {
        self.within(async { jobs::list(&mut *self.reader().await?, session, page).await })
            .await
    }

    async fn cancel_job(&self, job: JobId, now: Timestamp) -> Result<Job, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let job = jobs::cancel(&mut tx, job, now).await?;
            commit(tx, &[changed(&job)]).await?;
            Ok(job)
        })
        .await
    }

    async fn queue_depth(&self) -> Result<QueueDepth, StoreError> {
        self.within(async { jobs::depth(&mut *self.reader().await?).await })
            .await
    }

    async fn claim_job(&self, owner: &str, lease: Duration, now: Timestamp) -> Result<Option<Claim>, StoreError> {
        self.within(async {
            for _ in 0..CLAIM_TRIES {
                let mut tx = self.begin().await?;
                let parked = queue::park_lost(&mut tx, now).await?;
                let mut changes: Vec<Change> = parked.iter().map(job_change).collect();
                let (claim, reclaimed) = match queue::claim(&mut tx, owner, lease, now).await? {
                    Tried::Claimed(claim, reclaimed) => (Some(*claim), reclaimed),
                    Tried::Nothing => (None, false),
                    // what was parked is parked again
                    Tried::Clash => {
                        tx.rollback().await.failed()?;
                        continue;
                    }
                };
                changes.extend(claim.iter().map(|claim| changed(&claim.job)));
                commit(tx, &changes).await?;
                meters::reclaimed("parked", parked.len());
                meters::reclaimed("begun_again", usize::from(reclaimed));
                return Ok(claim);
            }
            Ok(None)
        })
        .await
    }

    async fn renew_lease(
        &self,
        lease: &Lease,
        hold: Duration,
        report: &ProgressReport,
        now: Timestamp,
    ) -> Result<Renewed, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let job = queue::renew(&mut tx, lease, hold, report, now).await?;
            commit(tx, &[changed(&job)]).await?;
            Ok(Renewed {
                cancel_requested: job.cancel_requested,
            })
        })
        .await
    }

    async fn publish_version(&self, lease: &Lease, version: NewVersion, now: Timestamp) -> Result<Version, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            upkeep::hold_off_marks(&mut tx).await?;
            let ended = queue::succeed(&mut tx, lease, None, &version.timings, now).await?;
            upkeep::refuse_marked(&mut tx, &version.blobs()).await?;
            if version.reanchors {
                sessions::reanchor(&mut tx, &ended.session, &version.anchor, now).await?;
            }
            let version = versions::add(&mut tx, &ended.session, ended.id, version, now).await?;
            failpoint::reach(Point::BeforePublishCommit);
            let published = Change::Version(version.session.clone(), version.number);
            commit(tx, &[published, job_change(&ended)]).await?;
            Ok(version)
        })
        .await
    }

    async fn finish_dry_run(
        &self,
        lease: &Lease,
        result: &ResultText,
        timings: &[StageSeconds],
        now: Timestamp,
    ) -> Result<(), StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let ended = queue::succeed(&mut tx, lease, Some(result), timings, now).await?;
            commit(tx, &[job_change(&ended)]).await
        })
        .await
    }

    async fn fail_job(
        &self,
        lease: &Lease,
        error: &JobError,
        retry: Retry,
        now: Timestamp,
    ) -> Result<JobState, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let left = queue::fail(&mut tx, lease, error, retry, now).await?;
            commit(tx, &[job_change(&left)]).await?;
            Ok(left.state)
        })
        .await
    }

    async fn finish_cancelled(&self, lease: &Lease, now: Timestamp) -> Result<(), StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let ended = queue::end_cancelled(&mut tx, lease, now).await?;
            commit(tx, &[job_change(&ended)]).await
        })
        .await
    }

    async fn release_job(&self, lease: &Lease, now: Timestamp) -> Result<(), StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let left = queue::release(&mut tx, lease, now).await?;
            commit(tx, &[job_change(&left)]).await
        })
        .await
    }

    async fn list_versions(&self, session: &SessionId, page: &Page<VersionNumber>) -> Result<Vec<Version>, StoreError> {
        self.within(async { versions::list(&mut *self.reader().await?, session, page).await })
            .await
    }

    async fn get_version(&self, session: &SessionId, version: VersionSelector) -> Result<Version, StoreError> {
        self.within(async { versions::get(&mut *self.reader().await?, session, version).await })
            .await
    }

    async fn add_constraint(&self, constraint: Constraint) -> Result<Constraint, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let constraint = constraints::add(&mut tx, &constraint).await?;
            commit(tx, &[Change::Session(constraint.session.clone())]).await?;
            Ok(constraint)
        })
        .await
    }

    async fn list_constraints(
        &self,
        session: &SessionId,
        page: &Page<ConstraintId>,
    ) -> Result<Vec<Constraint>, StoreError> {
        self.within(async { constraints::list(&mut *self.reader().await?, session, page).await })
            .await
    }

    async fn get_constraint(&self, session: &SessionId, id: ConstraintId) -> Result<Constraint, StoreError> {
        self.within(async { constraints::get(&mut *self.reader().await?, session, id).await })
            .await
    }

    async fn remove_constraint(&self, session: &SessionId, id: ConstraintId) -> Result<(), StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            constraints::remove(&mut tx, session, id).await?;
            commit(tx, &[Change::Session(session.clone())]).await
        })
        .await
    }

    async fn check(&self) -> Result<(), StoreError> {
        self.within(async { writable(&mut *self.reader().await?).await }).await
    }

    fn changes(&self) -> broadcast::Receiver<Change> {
        self.changes.subscribe()
    }

    async fn close(&self) {
        if timeout(GOODBYE, self.pool.close()).await.is_err() {
            tracing::warn!("the database does not take our goodbye");
        }
    }
}

async fn writable(db: &mut PgConnection) -> Result<(), StoreError> {
    let row =
        sqlx::query("SELECT NOT pg_is_in_recovery() AND current_setting('transaction_read_only') = 'off' AS writable")
            .fetch_one(db)
            .await
            .failed()?;
    if rows::value(&row, "writable")? {
        Ok(())
    } else {
        Err(unavailable("the database is read-only"))
    }
}
