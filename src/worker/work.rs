//! What a job's work is, seen from the queue.

use async_trait::async_trait;
use tokio::sync::watch;

use crate::compute::{ComputeError, RunControl};
use crate::model::{Job, JobError, ResultText, StageSeconds};
use crate::registration::Stop;
use crate::store::{NewVersion, ProgressReport, StoreError};

/// Does jobs, without a word about leases.
#[async_trait]
pub trait Work: Send + Sync {
    /// Does one job. Ends soon after `control` says so.
    ///
    /// # Errors
    /// [`Failure`] says whether it is worth another attempt.
    async fn run(&self, job: &Job, control: &RunControl, progress: &Progress) -> Result<Done, Failure>;
}

/// What a job came to.
#[derive(Debug, Clone, PartialEq)]
pub enum Done {
    /// A version, to be published.
    Version(Box<NewVersion>),
    /// The answer of a dry run.
    DryRun {
        /// What would be published.
        result: ResultText,
        /// How long each stage took.
        timings: Vec<StageSeconds>,
    },
}

/// Why an attempt came to nothing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// It was stopped.
    #[error("stopped: {0:?}")]
    Stopped(Stop),
    /// It would fail again.
    #[error("{}: {}", .0.code, .0.message)]
    ForGood(JobError),
    /// Another attempt may succeed.
    #[error("{}: {}", .0.code, .0.message)]
    ForNow(JobError),
}

impl Failure {
    /// A failure for good, with a code for programs and a message for people.
    pub fn for_good(code: &str, message: impl Into<String>) -> Self {
        Self::ForGood(JobError::new(code, message))
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        let code = match &error {
            StoreError::Unavailable(_) => return Self::ForNow(JobError::new("store_unavailable", error.to_string())),
            StoreError::BlobBusy(_) | StoreError::BlobRemoved(_) => {
                return Self::ForNow(JobError::new("blob_removed", error.to_string()));
            }
            StoreError::Damaged(_) => "store_damaged",
            _ => "store_refused",
        };
        Self::for_good(code, error.to_string())
    }
}

impl From<ComputeError> for Failure {
    fn from(error: ComputeError) -> Self {
        Self::ForNow(JobError::new("panicked", error.to_string()))
    }
}

/// Tells how far a job is, from wherever its work goes on.
#[derive(Debug, Clone)]
pub struct Progress(watch::Sender<ProgressReport>);

impl Progress {
    pub(super) fn new() -> (Self, watch::Receiver<ProgressReport>) {
        let (sender, receiver) = watch::channel(ProgressReport::default());
        (Self(sender), receiver)
    }

    /// A new stage begins, with this much of all the work done.
    pub fn stage(&self, stage: &str, done: f64) {
        self.0.send_replace(ProgressReport {
            stage: Some(stage.to_owned()),
            progress: done,
        });
    }

    /// The stage goes on, with this much of all the work done.
    pub fn done(&self, done: f64) {
        self.0.send_if_modified(|report| {
            let further = done > report.progress;
            if further {
                report.progress = done;
            }
            further
        });
    }
}
