//! Holding on to a job while it is done: the lease is renewed, progress told, and the wish to cancel heard.

use std::panic::AssertUnwindSafe;
use std::pin::pin;
use std::time::Duration;

use futures_util::FutureExt;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{Instant, MissedTickBehavior, interval_at, sleep_until};
use tokio_util::sync::CancellationToken;
use tracing::warn;

use super::Worker;
use super::work::{Done, Failure, Progress};
use crate::compute::{ComputeError, RunControl};
use crate::model::{Job, JobError};
use crate::registration::Stop;
use crate::store::{Change, Lease, ProgressReport, StoreError};

/// How an attempt ended, to be written down.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Ended {
    /// With what was wanted.
    Done(Done),
    /// It would fail again.
    Failed(JobError),
    /// Another attempt may succeed.
    FailedForNow(JobError),
    /// Somebody had asked for it.
    Cancelled,
    /// The worker stops: somebody else shall do it.
    Stopped,
    /// Somebody else does it already.
    Lost,
}

/// Progress is not written down more often than this.
const PROGRESS_PAUSE: Duration = Duration::from_millis(500);

/// Why the work was told to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wish {
    None,
    Cancel,
    GiveBack,
    Drop,
}

impl Worker {
    /// Does the job and holds its lease meanwhile.
    pub(super) async fn hold(&self, lease: &Lease, job: &Job, control: &RunControl, stop: &CancellationToken) -> Ended {
        let (progress, mut report) = Progress::new();
        let mut news = self.store.changes();
        // a panic ends this job, not the lane that does it
        let mut work = pin!(AssertUnwindSafe(self.work.run(job, control, &progress)).catch_unwind());
        let beat = self.settings.lease / 3;
        let mut beats = interval_at(Instant::now() + beat, beat);
        beats.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut next_report = Instant::now();
        let mut wish = Wish::None;
        // work that does not stop when it is told to is left to itself: its lane and its session go on
        let mut give_up = Instant::now() + self.settings.deadline + self.settings.stop_within;
        let result = loop {
            let mut renew = false;
            let mut look = false;
            tokio::select! {
                biased;
                result = &mut work => break result.unwrap_or_else(|panic| Err(ComputeError::of(&*panic).into())),
                () = stop.cancelled(), if wish == Wish::None => {
                    wish = Wish::GiveBack;
                    control.cancel();
                    give_up = give_up.min(Instant::now() + self.settings.stop_within);
                }
                change = news.recv() => look = match change {
                    Ok(Change::Job(_, job, _)) => job == lease.job,
                    Ok(Change::Session(session)) => session == job.session,
                    Ok(_) => false,
                    Err(RecvError::Lagged(_)) => true,
                    Err(RecvError::Closed) => std::future::pending().await,
                },
                () = sleep_until(give_up) => {
                    tracing::error!(job = %lease.job, "the work does not stop: it is left to itself");
                    control.cancel();
                    break Err(Failure::Stopped(Stop::Deadline));
                }
                _ = beats.tick() => renew = true,
                () = sleep_until(next_report), if report.has_changed().unwrap_or(false) => renew = true,
            }
            let heard = if renew {
                next_report = Instant::now() + PROGRESS_PAUSE;
                let told = report.borrow_and_update().clone();
                self.renew(lease, &told).await
            } else if look && wish == Wish::None {
                self.asked_to_cancel(lease).await
            } else {
                continue;
            };
            let heard = match heard {
                Ok(false) => continue,
                Ok(true) => Wish::Cancel,
                Err(StoreError::LeaseLost(_) | StoreError::NotFound(_)) => Wish::Drop,
                Err(error) => {
                    // the fence protects what is written, should the lease run out meanwhile
                    warn!(job = %lease.job, %error, "the lease is not renewed");
                    continue;
                }
            };
            if wish != Wish::Drop {
                wish = heard;
            }
            control.cancel();
            give_up = give_up.min(Instant::now() + self.settings.stop_within);
        };
        match (result, wish) {
            (_, Wish::Drop) => Ended::Lost,
            // done before it heard of the wish
            (Ok(done), _) => Ended::Done(done),
            (Err(Failure::Stopped(Stop::Deadline)), Wish::None) => Ended::Failed(JobError::new(
                "deadline",
                format!("not done within {} s", self.settings.deadline.as_secs_f64()),
            )),
            (Err(_), Wish::Cancel) => Ended::Cancelled,
            (Err(Failure::Stopped(_)), _) => Ended::Stopped,
            (Err(Failure::ForGood(error)), _) => Ended::Failed(error),
            (Err(Failure::ForNow(error)), _) => Ended::FailedForNow(error),
        }
    }

    async fn renew(&self, lease: &Lease, report: &ProgressReport) -> Result<bool, StoreError> {
        let renewed = self
            .store
            .renew_lease(lease, self.settings.lease, report, self.clock.now())
            .await?;
        Ok(renewed.cancel_requested)
    }

    /// Reads only: a renewal would be a change of the job, which would be heard here again.
    async fn asked_to_cancel(&self, lease: &Lease) -> Result<bool, StoreError> {
        Ok(self.store.get_job(lease.job).await?.cancel_requested)
    }
}
