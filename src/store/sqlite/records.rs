//! What a store does, each in its transaction: the SQL is in the files beside this one.

use std::time::Duration;

use async_trait::async_trait;
use tokio::sync::broadcast;

use super::{Failed as _, SqliteStore, constraints, jobs, maps, queue, sessions, upkeep, versions};
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

#[async_trait]
impl Store for SqliteStore {
    async fn create_session(
        &self,
        id: &SessionId,
        settings: &SessionSettings,
        now: Timestamp,
    ) -> Result<Created<Session>, StoreError> {
        let mut tx = self.begin().await?;
        let made = sessions::create(&mut tx, id, settings, now).await?;
        tx.commit().await.failed()?;
        if made.created {
            self.announce(Change::Session(id.clone()));
        }
        Ok(made)
    }

    async fn get_session(&self, id: &SessionId) -> Result<Session, StoreError> {
        sessions::get(&mut *self.reader().await?, id).await
    }

    async fn list_sessions(&self, labels: &LabelFilter, page: &Page<SessionId>) -> Result<Vec<Session>, StoreError> {
        sessions::list(&mut *self.reader().await?, labels, page).await
    }

    async fn patch_session(&self, id: &SessionId, patch: SessionPatch, now: Timestamp) -> Result<Session, StoreError> {
        let mut tx = self.begin().await?;
        let session = sessions::patch(&mut tx, id, patch, now).await?;
        tx.commit().await.failed()?;
        self.announce(Change::Session(id.clone()));
        Ok(session)
    }

    async fn delete_session(&self, id: &SessionId) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        sessions::delete(&mut tx, id).await?;
        tx.commit().await.failed()?;
        self.announce(Change::Session(id.clone()));
        Ok(())
    }

    async fn list_robots(&self, session: &SessionId) -> Result<Vec<RobotSummary>, StoreError> {
        sessions::robots(&mut *self.reader().await?, session).await
    }

    async fn add_map_and_enqueue(&self, add: AddMap, now: Timestamp) -> Result<Added, StoreError> {
        let mut tx = self.begin().await?;
        let added = maps::add_and_enqueue(&mut tx, add, &self.limits, now).await?;
        failpoint::reach(Point::BeforeCommit);
        tx.commit().await.failed()?;
        if added.created {
            self.announce(Change::Map(added.map.session.clone(), added.map.id));
            if let Some(job) = added.map.job {
                self.announce(Change::Job(added.map.session.clone(), job, JobState::Queued));
            }
        }
        Ok(added)
    }

    async fn list_maps(
        &self,
        session: &SessionId,
        robot: Option<&RobotId>,
        page: &Page<MapId>,
    ) -> Result<Vec<MapRecord>, StoreError> {
        maps::list(&mut *self.reader().await?, session, robot, page).await
    }

    async fn get_map(&self, session: &SessionId, map: MapId) -> Result<MapRecord, StoreError> {
        maps::get(&mut *self.reader().await?, session, map).await
    }

    async fn newest_maps(&self, session: &SessionId) -> Result<Vec<MapRecord>, StoreError> {
        maps::newest(&mut *self.reader().await?, session).await
    }

    async fn enqueue_merge(
        &self,
        session: &SessionId,
        job: JobId,
        asked: AskedMerge,
        now: Timestamp,
    ) -> Result<Job, StoreError> {
        let mut tx = self.begin().await?;
        let job = jobs::enqueue_merge(&mut tx, session, job, &asked, &self.limits, now).await?;
        tx.commit().await.failed()?;
        self.announce(Change::Job(job.session.clone(), job.id, job.state));
        Ok(job)
    }

    async fn get_job(&self, job: JobId) -> Result<Job, StoreError> {
        jobs::get(&mut *self.reader().await?, job).await
    }

    async fn list_jobs(&self, session: &SessionId, page: &Page<JobId>) -> Result<Vec<Job>, StoreError> {
        jobs::list(&mut *self.reader().await?, session, page).await
    }

    async fn cancel_job(&self, job: JobId, now: Timestamp) -> Result<Job, StoreError> {
        let mut tx = self.begin().await?;
        let job = jobs::cancel(&mut tx, job, now).await?;
        tx.commit().await.failed()?;
        self.announce(Change::Job(job.session.clone(), job.id, job.state));
        Ok(job)
    }

    async fn queue_depth(&self) -> Result<QueueDepth, StoreError> {
        jobs::depth(&mut *self.reader().await?).await
    }

    async fn claim_job(&self, owner: &str, lease: Duration, now: Timestamp) -> Result<Option<Claim>, StoreError> {
        let mut tx = self.begin().await?;
        let parked = queue::park_lost(&mut tx, now).await?;
        let claim = queue::claim(&mut tx, owner, lease, now).await?;
        tx.commit().await.failed()?;
        meters::reclaimed("parked", parked.len());
        for written in parked {
            self.announce_job(written);
        }
        Ok(claim.map(|(claim, reclaimed)| {
            meters::reclaimed("begun_again", usize::from(reclaimed));
            self.announce(Change::Job(claim.job.session.clone(), claim.job.id, claim.job.state));
            claim
        }))
    }

    async fn renew_lease(
        &self,
        lease: &Lease,
        hold: Duration,
        report: &ProgressReport,
        now: Timestamp,
    ) -> Result<Renewed, StoreError> {
        let mut tx = self.begin().await?;
        let job = queue::renew(&mut tx, lease, hold, report, now).await?;
        tx.commit().await.failed()?;
        self.announce(Change::Job(job.session, job.id, job.state));
        Ok(Renewed {
            cancel_requested: job.cancel_requested,
        })
    }

    async fn publish_version(&self, lease: &Lease, version: NewVersion, now: Timestamp) -> Result<Version, StoreError> {
        let mut tx = self.begin().await?;
        let ended = queue::succeed(&mut tx, lease, None, &version.timings, now).await?;
        upkeep::refuse_marked(&mut tx, &version.blobs()).await?;
        if version.reanchors {
            sessions::reanchor(&mut tx, &ended.session, &version.anchor, now).await?;
        }
        let version = versions::add(&mut tx, &ended.session, ended.id, version, now).await?;
        failpoint::reach(Point::BeforePublishCommit);
        tx.commit().await.failed()?;
        self.announce(Change::Version(version.session.clone(), version.number));
        self.announce_job(ended);
        Ok(version)
    }

    async fn finish_dry_run(
        &self,
        lease: &Lease,
        result: &ResultText,
        timings: &[StageSeconds],
        now: Timestamp,
    ) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        let ended = queue::succeed(&mut tx, lease, Some(result), timings, now).await?;
        tx.commit().await.failed()?;
        self.announce_job(ended);
        Ok(())
    }

    async fn fail_job(
        &self,
        lease: &Lease,
        error: &JobError,
        retry: Retry,
        now: Timestamp,
    ) -> Result<JobState, StoreError> {
        let mut tx = self.begin().await?;
        let left = queue::fail(&mut tx, lease, error, retry, now).await?;
        tx.commit().await.failed()?;
        Ok(self.announce_job(left))
    }

    async fn finish_cancelled(&self, lease: &Lease, now: Timestamp) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        let ended = queue::end_cancelled(&mut tx, lease, now).await?;
        tx.commit().await.failed()?;
        self.announce_job(ended);
        Ok(())
    }

    async fn release_job(&self, lease: &Lease, now: Timestamp) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        let left = queue::release(&mut tx, lease, now).await?;
        tx.commit().await.failed()?;
        self.announce_job(left);
        Ok(())
    }

    async fn list_versions(&self, session: &SessionId, page: &Page<VersionNumber>) -> Result<Vec<Version>, StoreError> {
        versions::list(&mut *self.reader().await?, session, page).await
    }

    async fn get_version(&self, session: &SessionId, version: VersionSelector) -> Result<Version, StoreError> {
        versions::get(&mut *self.reader().await?, session, version).await
    }

    async fn add_constraint(&self, constraint: Constraint) -> Result<Constraint, StoreError> {
        let mut tx = self.begin().await?;
        let constraint = constraints::add(&mut tx, &constraint).await?;
        tx.commit().await.failed()?;
        self.announce(Change::Session(constraint.session.clone()));
        Ok(constraint)
    }

    async fn list_constraints(
        &self,
        session: &SessionId,
        page: &Page<ConstraintId>,
    ) -> Result<Vec<Constraint>, StoreError> {
        constraints::list(&mut *self.reader().await?, session, page).await
    }

    async fn get_constraint(&self, session: &SessionId, id: ConstraintId) -> Result<Constraint, StoreError> {
        constraints::get(&mut *self.reader().await?, session, id).await
    }

    async fn remove_constraint(&self, session: &SessionId, id: ConstraintId) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        constraints::remove(&mut tx, session, id).await?;
        tx.commit().await.failed()?;
        self.announce(Change::Session(session.clone()));
        Ok(())
    }

    async fn check(&self) -> Result<(), StoreError> {
        let tx = self.begin().await?;
        tx.rollback().await.failed()?;
        sqlx::query("SELECT 1").execute(&self.readers).await.failed()?;
        Ok(())
    }

    fn changes(&self) -> broadcast::Receiver<Change> {
        self.changes.subscribe()
    }

    async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }
}
