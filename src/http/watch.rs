//! Waiting for a change: long polls and event streams share it.

use std::time::Duration;

use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio_util::sync::CancellationToken;

use super::error::ApiResult;
use super::state::AppState;
use crate::model::{Job, JobId};
use crate::store::Change;

/// Look again after this long even when nobody has told of a change: another process may have made one.
const POLL: Duration = Duration::from_secs(2);

/// Changes of the store from now on.
pub(super) struct Watch {
    changes: Receiver<Change>,
    stop: CancellationToken,
}

/// Why a wait is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Woken {
    /// Something may have changed: look again.
    Look,
    /// The server stops: end.
    Stop,
}

impl Watch {
    /// Starts to watch. Look at the store after this, not before, or a change is missed.
    pub(super) fn start(state: &AppState) -> Self {
        Self {
            changes: state.store.changes(),
            stop: state.stop.clone(),
        }
    }

    /// Until a change that `concerns` us, at most [`POLL`].
    pub(super) async fn next(&mut self, concerns: impl Fn(&Change) -> bool) -> Woken {
        let changed = async {
            loop {
                match self.changes.recv().await {
                    Ok(change) if !concerns(&change) => {}
                    Ok(_) | Err(RecvError::Lagged(_)) => return,
                    Err(RecvError::Closed) => std::future::pending().await,
                }
            }
        };
        tokio::select! {
            () = self.stop.cancelled() => Woken::Stop,
            () = changed => Woken::Look,
            () = tokio::time::sleep(POLL) => Woken::Look,
        }
    }
}

/// The job when it has ended, or as it is after `wait` or when the server stops.
pub(super) async fn ended_job(state: &AppState, id: JobId, wait: Duration) -> ApiResult<Job> {
    let mut watch = Watch::start(state);
    let deadline = tokio::time::sleep(wait);
    let mut deadline = std::pin::pin!(deadline);
    loop {
        let job = state.store.get_job(id).await?;
        if job.state.is_terminal() || wait.is_zero() {
            return Ok(job);
        }
        let ours = |change: &Change| matches!(change, Change::Job(_, changed, _) if *changed == id);
        let woken = tokio::select! {
            () = deadline.as_mut() => Woken::Stop,
            woken = watch.next(ours) => woken,
        };
        if woken == Woken::Stop {
            return Ok(state.store.get_job(id).await?);
        }
    }
}
