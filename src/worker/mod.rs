//! The worker: takes jobs from the queue, does them, and writes down how they ended.
//!
//! Imports `geometry`, `grid`, `registration`, `fusion`, `codec`, `model`, `api`, `clock`, `compute` and `store`. It never
//! meets `http`: the queue links them.
//!
//! A job is claimed, done by its [`Work`] while its lease is renewed, and settled: published, failed, cancelled or given
//! back. Whatever goes wrong with one job, a panic included, ends that job only.

mod earlier;
mod lease;
mod measured;
mod memory;
mod merge;
mod order;
mod steering;
mod sweep;
mod work;

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tracing::{Instrument as _, field, info, info_span, warn};

pub use memory::Memory;
pub use merge::Merges;
pub use sweep::{Sweeper, Swept};
pub use work::{Done, Failure, Progress, Work};

use crate::clock::Clock;
use crate::compute::RunControl;
use crate::failpoint::{self, Point};
use crate::meters::{self, Busy};
use crate::model::{Job, JobError, JobState, Timestamp};
use crate::store::{Change, Claim, Lease, Retry, Store, StoreError};
use crate::telemetry;
use lease::Ended;

/// Takes jobs from the queue and does them. Clones are the same worker.
#[derive(Clone)]
pub struct Worker {
    store: Arc<dyn Store>,
    work: Arc<dyn Work>,
    clock: Arc<dyn Clock>,
    settings: WorkerSettings,
}

/// How a worker works.
#[derive(Debug, Clone)]
pub struct WorkerSettings {
    /// What it is called in the queue.
    pub name: String,
    /// Jobs at one time.
    pub at_once: NonZeroUsize,
    /// How long others wait for a sign of life before they take over a job. Renewed three times as often.
    pub lease: Duration,
    /// The most time for one attempt.
    pub deadline: Duration,
    /// How long work may take to stop once it is told to, before it is left to itself.
    pub stop_within: Duration,
    /// How long it sleeps at most before it looks for jobs that nobody has told it of.
    pub poll: Duration,
    /// The pause after the first failed attempt; doubled after each further one.
    pub retry_pause: Duration,
}

impl WorkerSettings {
    /// The defaults, under this name.
    #[must_use]
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            at_once: NonZeroUsize::MIN,
            lease: Duration::from_secs(30),
            deadline: Duration::from_mins(10),
            stop_within: Duration::from_secs(15),
            poll: Duration::from_secs(1),
            retry_pause: Duration::from_secs(1),
        }
    }
}

/// What came of looking for a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ran {
    /// One was done.
    Job,
    /// There was none to do.
    Empty,
}

/// How often what a job found is written down again while the store is out of reach.
const SETTLE_TRIES: u32 = 6;

impl Worker {
    /// A worker that does its jobs by `work`.
    #[must_use]
    pub fn new(store: Arc<dyn Store>, work: Arc<dyn Work>, clock: Arc<dyn Clock>, settings: WorkerSettings) -> Self {
        Self {
            store,
            work,
            clock,
            settings,
        }
    }

    /// Does jobs, as many at a time as the settings say, until it is stopped. Jobs that are under way then are given back
    /// to the queue.
    pub async fn run(&self, stop: CancellationToken) {
        meters::workers(u32::try_from(self.settings.at_once.get()).unwrap_or(u32::MAX));
        let mut lanes = JoinSet::new();
        for _ in 0..self.settings.at_once.get() {
            let (worker, stop) = (self.clone(), stop.clone());
            lanes.spawn(async move { worker.run_lane(&stop).await });
        }
        while lanes.join_next().await.is_some() {}
    }

    async fn run_lane(&self, stop: &CancellationToken) {
        // listen before looking, or what comes in between is missed
        let mut changes = self.store.changes();
        while !stop.is_cancelled() {
            match self.run_one(stop).await {
                Ok(Ran::Job) => continue,
                Ok(Ran::Empty) => {}
                Err(error) => warn!(%error, "the queue is out of reach"),
            }
            tokio::select! {
                () = stop.cancelled() => {}
                () = news(&mut changes) => {}
                () = tokio::time::sleep(self.settings.poll) => {}
            }
        }
    }

    /// Does one job, if there is one.
    ///
    /// # Errors
    /// When the store does not answer. A job that was claimed is claimed again once its lease has expired.
    pub async fn run_one(&self, stop: &CancellationToken) -> Result<Ran, StoreError> {
        let claimed = self
            .store
            .claim_job(&self.settings.name, self.settings.lease, self.clock.now())
            .await?;
        let Some(Claim { lease, job }) = claimed else {
            return Ok(Ran::Empty);
        };
        let span =
            info_span!("job", job = %job.id, session = %job.session, attempt = job.attempt, trace_id = field::Empty);
        let _ = telemetry::join(&span, job.trace, job.id.uuid()); // a job asks nobody else for anything
        self.attempt(lease, job, stop).instrument(span).await?;
        Ok(Ran::Job)
    }

    async fn attempt(&self, lease: Lease, job: Job, stop: &CancellationToken) -> Result<(), StoreError> {
        info!(job = %job.id, session = %job.session, attempt = job.attempt, "job begins");
        let _busy = Busy::begin(self.since(job.run_after));
        let control = RunControl::start(Arc::clone(&self.clock), Some(self.settings.deadline));
        let _cancelled_when_dropped = control.cancel_on_drop();
        let ended = self.hold(&lease, &job, &control, stop).await;
        self.settle(&lease, &job, ended).await
    }

    /// Writes down how a job ended, patiently: the work is done, and the lease holds for a while.
    async fn settle(&self, lease: &Lease, job: &Job, ended: Ended) -> Result<(), StoreError> {
        let mut pause = Duration::from_millis(100);
        for _ in 1..SETTLE_TRIES {
            match self.settle_once(lease, job, &ended).await {
                Err(error @ StoreError::Unavailable(_)) => {
                    warn!(job = %job.id, %error, "the end of the job is not written down yet");
                }
                answer => return answer,
            }
            tokio::time::sleep(pause).await;
            pause *= 2;
        }
        self.settle_once(lease, job, &ended).await
    }

    async fn settle_once(&self, lease: &Lease, job: &Job, ended: &Ended) -> Result<(), StoreError> {
        let now = self.clock.now();
        let written = match ended {
            Ended::Done(Done::Version(version)) => self
                .store
                .publish_version(lease, (**version).clone(), now)
                .await
                .map(|published| {
                    failpoint::reach(Point::AfterPublish);
                    measured::published(version);
                    self.ended(job, "published");
                    let version = published;
                    info!(job = %job.id, session = %job.session, version = %version.number, "published");
                }),
            Ended::Done(Done::DryRun { result, timings }) => {
                let written = self.store.finish_dry_run(lease, result, timings, now).await;
                written.map(|()| {
                    measured::stages(timings);
                    self.ended(job, "dry_run");
                })
            }
            Ended::Failed(error) => self.fail(lease, job, error, Retry::Never).await,
            Ended::FailedForNow(error) => self.fail(lease, job, error, self.retry(job)).await,
            Ended::Cancelled => {
                let written = self.store.finish_cancelled(lease, now).await;
                written.map(|()| self.ended(job, "cancelled"))
            }
            Ended::Stopped => {
                let written = self.store.release_job(lease, now).await;
                written.map(|()| self.ended(job, "given_back"))
            }
            Ended::Lost => Err(StoreError::LeaseLost(job.id)),
        };
        match written {
            Err(error @ StoreError::BlobRemoved(_)) => {
                // what was kept before the version was written is needed once more: another attempt keeps it again
                let error = JobError::new("blob_removed", error.to_string());
                self.fail(lease, job, &error, self.retry(job)).await
            }
            Err(StoreError::LeaseLost(_)) => {
                self.ended(job, "lost");
                warn!(job = %job.id, "the lease is lost: the result is dropped");
                Ok(())
            }
            written => written,
        }
    }

    async fn fail(&self, lease: &Lease, job: &Job, error: &JobError, retry: Retry) -> Result<(), StoreError> {
        let state = self.store.fail_job(lease, error, retry, self.clock.now()).await?;
        let again = state == JobState::Queued;
        self.ended(
            job,
            match state {
                JobState::Queued => "retried",
                JobState::Cancelled => "cancelled",
                _ => "failed",
            },
        );
        warn!(job = %job.id, session = %job.session, code = error.code, message = error.message, again, "attempt failed");
        Ok(())
    }

    /// How long ago that was.
    fn since(&self, then: Timestamp) -> Duration {
        Duration::try_from(self.clock.now().duration_since(then)).unwrap_or_default()
    }

    /// Counts how an attempt ended.
    fn ended(&self, job: &Job, outcome: &'static str) {
        meters::attempt(
            outcome,
            job.started_at.map_or(Duration::ZERO, |began| self.since(began)),
        );
    }

    fn retry(&self, job: &Job) -> Retry {
        let doublings = job.attempt.saturating_sub(1).min(16);
        Retry::After(self.settings.retry_pause.saturating_mul(1 << doublings))
    }
}

/// Until something has changed that may let a job be claimed: one was queued, or one ended and its session is free.
async fn news(changes: &mut Receiver<Change>) {
    loop {
        match changes.recv().await {
            Ok(Change::Job(_, _, JobState::Running)) => {}
            Ok(Change::Job(..)) | Err(RecvError::Lagged(_)) => return,
            Ok(_) => {}
            Err(RecvError::Closed) => std::future::pending().await,
        }
    }
}

#[cfg(test)]
mod tests;
