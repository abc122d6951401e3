//! Keeping house: old versions go, then the bytes that no record names any more.
//!
//! Any number of sweepers may run at a time; see [`crate::store::Upkeep`] for what keeps them from the bytes of a record
//! that is being made. A sweeper that was stopped between its last look at the clock and the removal of a blob, for longer
//! than [`MARK_HOLD`], could still remove bytes that were kept again meanwhile: then `mapweld fsck` tells, and the robot's
//! next push of that map brings them back.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use futures_util::{StreamExt, TryStreamExt};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::clock::Clock;
use crate::meters;
use crate::model::{BlobKey, Timestamp};
use crate::store::{Blobs, MARK_HOLD, Pruned, Store, StoreError};

/// Keeps house.
#[derive(Clone)]
pub struct Sweeper {
    /// The records.
    pub store: Arc<dyn Store>,
    /// The bytes.
    pub blobs: Blobs,
    /// What time it is.
    pub clock: Arc<dyn Clock>,
    /// Versions that are kept of sessions that do not say; all when absent.
    pub keep_versions: Option<NonZeroU32>,
    /// How long jobs that have ended are kept; as long as their session when absent.
    pub keep_jobs: Option<Duration>,
    /// How long bytes that no record names are kept.
    pub grace: Duration,
}

/// What one sweep did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Swept {
    /// Records that were deleted.
    pub pruned: Pruned,
    /// Blobs that were removed.
    pub blobs: u64,
    /// Their size.
    pub bytes: u64,
    /// Answers to named requests that were forgotten.
    pub answers: u64,
    /// Jobs that were deleted.
    pub jobs: u64,
}

/// Blobs that are marked together.
const BATCH: usize = 64;
/// Marks are given up after this long: well before others may overrule them.
const MARK_USE: Duration = MARK_HOLD.checked_div(3).expect("three is not zero");
/// Marks are remembered for longer than any upload takes.
const MARK_MEMORY: Duration = Duration::from_hours(48);

impl Sweeper {
    /// Sweeps now and then until it is stopped.
    pub async fn run(&self, every: Duration, stop: &CancellationToken) {
        loop {
            tokio::select! {
                biased;
                () = stop.cancelled() => return,
                swept = self.sweep() => match swept {
                    Ok(swept) if swept == Swept::default() => {}
                    Ok(Swept { pruned: Pruned { versions, maps }, blobs, bytes, answers, jobs }) => {
                        info!(versions, maps, blobs, bytes, answers, jobs, "swept");
                    }
                    Err(error) => warn!(%error, "not swept"),
                },
            }
            tokio::select! {
                () = stop.cancelled() => return,
                () = tokio::time::sleep(every) => {}
            }
        }
    }

    /// Sweeps once.
    ///
    /// # Errors
    /// When the records or the blobs are out of reach; what was done is done.
    pub async fn sweep(&self) -> Result<Swept, StoreError> {
        let pruned = self.store.prune(self.keep_versions).await?;
        let jobs = match self.keep_jobs {
            Some(keep) => self.store.prune_jobs(self.ago(keep)).await?,
            None => 0,
        };
        let (blobs, bytes) = self.remove_unneeded().await?;
        let old = self.ago(MARK_MEMORY);
        self.store.forget_marks(old).await?;
        let answers = self.store.forget_calls(self.clock.now()).await?;
        for (what, count) in [
            ("versions", pruned.versions),
            ("maps", pruned.maps),
            ("blobs", blobs),
            ("answers", answers),
            ("jobs", jobs),
        ] {
            meters::swept(what, count);
        }
        Ok(Swept {
            pruned,
            blobs,
            bytes,
            answers,
            jobs,
        })
    }

    fn ago(&self, time: Duration) -> Timestamp {
        self.clock.now().checked_sub(time).unwrap_or(Timestamp::MIN)
    }

    async fn remove_unneeded(&self) -> Result<(u64, u64), StoreError> {
        let old = self.ago(self.grace);
        let (mut blobs, mut bytes) = (0, 0);
        let grown_old = self.blobs.list().try_filter_map(move |kept| {
            let is_old = kept.written_at < old;
            std::future::ready(Ok(kept.key.filter(|_| is_old).map(|key| (key, kept.bytes))))
        });
        let mut batches = std::pin::pin!(grown_old.try_chunks(BATCH));
        while let Some(batch) = batches.next().await {
            let batch = batch.map_err(|error| error.1)?;
            let keys: Vec<BlobKey> = batch.iter().map(|(key, _)| *key).collect();
            for gone in self.remove(&keys).await? {
                blobs += 1;
                bytes += batch.iter().find(|(key, _)| *key == gone).map_or(0, |(_, size)| *size);
            }
        }
        Ok((blobs, bytes))
    }

    /// Removes those of these blobs that no record names, and answers them.
    ///
    /// # Errors
    /// When the records or the blobs are out of reach. Marks that are left over are overruled after [`MARK_HOLD`].
    pub async fn remove(&self, keys: &[BlobKey]) -> Result<Vec<BlobKey>, StoreError> {
        let began = self.clock.monotonic();
        let marked = self.store.mark_unneeded(keys, self.clock.now()).await?;
        let mut gone = Vec::new();
        for key in marked {
            if self.clock.monotonic().saturating_sub(began) > MARK_USE {
                break;
            }
            self.blobs.remove(key).await?;
            gone.push(key);
        }
        self.store.blobs_are_gone(&gone, self.clock.now()).await?;
        Ok(gone)
    }
}

#[cfg(test)]
#[path = "sweep_tests.rs"]
mod tests;
