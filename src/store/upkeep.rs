//! Keeping house: which versions and maps stay, and how blobs that nothing needs go without taking a new record's bytes
//! along.
//!
//! A blob is kept before the record that names it, so for a while it looks unneeded; and bytes that are about to go may be
//! uploaded again at that moment. The protocol:
//!
//! 1. Who removes first marks the blob, in a transaction that sees that no record names it ([`Upkeep::mark_unneeded`]),
//!    then removes the bytes, then says so ([`Upkeep::blobs_are_gone`]). Marks stay for long after.
//! 2. Who keeps bytes looks for a mark first ([`Upkeep::blob_mark`]); while the bytes are being removed it is told to come
//!    again. It writes the bytes, and then takes away the mark that it saw, if it is still the same
//!    ([`Upkeep::unmark_blob`]): whoever finds no mark finds the bytes. Then it writes the record.
//! 3. A record is refused when a blob that it names is marked ([`StoreError::BlobRemoved`]): the bytes that were written
//!    before may be gone. Who meets that begins again at 2.
//!
//! Whichever way the steps of a remover and a keeper interleave: when the keeper's record is there before the mark, there
//! is no mark; when the mark is there first, there is no record. A remover that died is overruled after [`MARK_HOLD`]; one
//! that lives gives up its marks long before.

use std::num::NonZeroU32;
use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;

use super::{Blobs, Store, StoreError};
use crate::model::{BlobKey, Timestamp};

/// How long a mark holds whose remover says nothing.
pub const MARK_HOLD: Duration = Duration::from_mins(1);

/// Keeping house in the records.
#[async_trait]
pub trait Upkeep: Send + Sync {
    /// Deletes all but the newest versions of each session, as many as the session keeps, or `keep` when it does not say;
    /// all stay when nobody says. With versions go the maps of which no version is made any more, but never those that
    /// came after the last merged ones.
    async fn prune(&self, keep: Option<NonZeroU32>) -> Result<Pruned, StoreError>;

    /// Deletes jobs that have ended before `before`, but none whose version is kept; says how many.
    async fn prune_jobs(&self, before: Timestamp) -> Result<u64, StoreError>;

    /// Marks those of the blobs that no record names, and answers them.
    async fn mark_unneeded(&self, blobs: &[BlobKey], now: Timestamp) -> Result<Vec<BlobKey>, StoreError>;

    /// The bytes of marked blobs are gone.
    async fn blobs_are_gone(&self, blobs: &[BlobKey], now: Timestamp) -> Result<(), StoreError>;

    /// The mark of a blob, if there is one.
    async fn blob_mark(&self, blob: BlobKey) -> Result<Option<BlobMark>, StoreError>;

    /// Takes a mark away, if it is still this one: the bytes are there again. Says whether it was.
    async fn unmark_blob(&self, blob: BlobKey, mark: BlobMark) -> Result<bool, StoreError>;

    /// Forgets marks that are older than any upload that could still be under way.
    async fn forget_marks(&self, before: Timestamp) -> Result<(), StoreError>;
}

/// That somebody removes a blob's bytes, or has done so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlobMark {
    /// When it was marked.
    pub marked_at: Timestamp,
    /// When the bytes were gone.
    pub removed_at: Option<Timestamp>,
}

impl BlobMark {
    /// Whether the bytes may be written again: they are gone, or whoever was to remove them is overdue.
    #[must_use]
    pub fn is_over(&self, now: Timestamp) -> bool {
        self.removed_at.is_some() || now.duration_since(self.marked_at).unsigned_abs() >= MARK_HOLD
    }
}

/// What was deleted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Pruned {
    /// Versions.
    pub versions: u64,
    /// Maps.
    pub maps: u64,
}

/// Keeps bytes for a record that will name them: step 2 of the protocol. They are durable when this returns.
///
/// # Errors
/// [`StoreError::BlobBusy`], [`StoreError::Unavailable`].
pub async fn keep_blob(store: &dyn Store, blobs: &Blobs, bytes: Bytes, now: Timestamp) -> Result<BlobKey, StoreError> {
    let (key, bytes) = super::blobs::hashed(bytes).await?;
    for pause in KEEP_PAUSES {
        let mark = store.blob_mark(key).await?;
        if mark.is_some_and(|mark| !mark.is_over(now)) {
            // a removal takes some milliseconds
            tokio::time::sleep(pause).await;
            continue;
        }
        blobs.put_hashed(key, bytes.clone()).await?;
        match mark {
            Some(mark) if !store.unmark_blob(key, mark).await? => {}
            _ => return Ok(key),
        }
    }
    Err(StoreError::BlobBusy(key))
}

/// The pauses before bytes that are being removed are looked at again.
const KEEP_PAUSES: [Duration; 5] = [
    Duration::from_millis(50),
    Duration::from_millis(100),
    Duration::from_millis(200),
    Duration::from_millis(400),
    Duration::from_millis(800),
];
