//! Keeping house in SQLite. One connection writes, so that a mark and a record never meet halfway.

use std::num::NonZeroU32;

use async_trait::async_trait;
use sqlx::SqliteConnection;

use super::{Failed, SqliteStore};
use crate::model::{BlobKey, SessionId, Timestamp};
use crate::store::rows;
use crate::store::{BlobMark, Change, Pruned, StoreError, Upkeep};

#[async_trait]
impl Upkeep for SqliteStore {
    async fn prune(&self, keep: Option<NonZeroU32>) -> Result<Pruned, StoreError> {
        let mut pruned = Pruned::default();
        for (session, keep) in overfull(&mut *self.reader().await?, keep).await? {
            let mut tx = self.begin().await?;
            let versions = prune_versions(&mut tx, &session, keep).await?;
            let maps = prune_maps(&mut tx, &session).await?;
            tx.commit().await.failed()?;
            pruned.versions += versions;
            pruned.maps += maps;
            self.announce(Change::Session(session));
        }
        Ok(pruned)
    }

    async fn prune_jobs(&self, before: Timestamp) -> Result<u64, StoreError> {
        let mut tx = self.begin().await?;
        let deleted = sqlx::query(
            "DELETE FROM jobs WHERE finished_at < ?1 AND NOT EXISTS (SELECT 1 FROM versions WHERE versions.job = jobs.id)",
        )
        .bind(before.as_microsecond())
        .execute(&mut *tx)
        .await
        .failed()?;
        tx.commit().await.failed()?;
        Ok(deleted.rows_affected())
    }

    async fn mark_unneeded(&self, blobs: &[BlobKey], now: Timestamp) -> Result<Vec<BlobKey>, StoreError> {
        let mut tx = self.begin().await?;
        let mut marked = Vec::new();
        for blob in blobs {
            let answer = sqlx::query(
                "INSERT INTO blob_removals (blob, marked_at)
                 SELECT ?1, ?2
                 WHERE NOT EXISTS (SELECT 1 FROM maps WHERE blob = ?1)
                   AND NOT EXISTS (SELECT 1 FROM versions WHERE grid_blob = ?1)
                   AND NOT EXISTS (SELECT 1 FROM versions WHERE png_blob = ?1)
                   AND NOT EXISTS (SELECT 1 FROM versions WHERE overlay_blob = ?1)
                 ON CONFLICT (blob) DO UPDATE SET marked_at = excluded.marked_at, removed_at = NULL",
            )
            .bind(blob.0.to_string())
            .bind(now.as_microsecond())
            .execute(&mut *tx)
            .await
            .failed()?;
            if answer.rows_affected() > 0 {
                marked.push(*blob);
            }
        }
        tx.commit().await.failed()?;
        Ok(marked)
    }

    async fn blobs_are_gone(&self, blobs: &[BlobKey], now: Timestamp) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        for blob in blobs {
            sqlx::query("UPDATE blob_removals SET removed_at = ?2 WHERE blob = ?1")
                .bind(blob.0.to_string())
                .bind(now.as_microsecond())
                .execute(&mut *tx)
                .await
                .failed()?;
        }
        tx.commit().await.failed()
    }

    async fn blob_mark(&self, blob: BlobKey) -> Result<Option<BlobMark>, StoreError> {
        mark_of(&mut *self.reader().await?, blob).await
    }

    async fn unmark_blob(&self, blob: BlobKey, mark: BlobMark) -> Result<bool, StoreError> {
        let mut tx = self.begin().await?;
        let answer = sqlx::query("DELETE FROM blob_removals WHERE blob = ?1 AND marked_at = ?2 AND removed_at IS ?3")
            .bind(blob.0.to_string())
            .bind(mark.marked_at.as_microsecond())
            .bind(mark.removed_at.map(Timestamp::as_microsecond))
            .execute(&mut *tx)
            .await
            .failed()?;
        tx.commit().await.failed()?;
        Ok(answer.rows_affected() > 0)
    }

    async fn forget_marks(&self, before: Timestamp) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        sqlx::query("DELETE FROM blob_removals WHERE COALESCE(removed_at, marked_at) < ?1")
            .bind(before.as_microsecond())
            .execute(&mut *tx)
            .await
            .failed()?;
        tx.commit().await.failed()
    }
}

async fn mark_of(db: &mut SqliteConnection, blob: BlobKey) -> Result<Option<BlobMark>, StoreError> {
    let row = sqlx::query("SELECT * FROM blob_removals WHERE blob = ?1")
        .bind(blob.0.to_string())
        .fetch_optional(db)
        .await
        .failed()?;
    row.as_ref().map(rows::blob_mark).transpose()
}

/// Refuses to name blobs that are marked, within the transaction that writes the record.
pub(super) async fn refuse_marked(db: &mut SqliteConnection, blobs: &[BlobKey]) -> Result<(), StoreError> {
    for blob in blobs {
        if mark_of(db, *blob).await?.is_some() {
            return Err(StoreError::BlobRemoved(*blob));
        }
    }
    Ok(())
}

/// Sessions with more versions than they keep, and how many that is.
async fn overfull(
    db: &mut SqliteConnection,
    keep: Option<NonZeroU32>,
) -> Result<Vec<(SessionId, NonZeroU32)>, StoreError> {
    let found = sqlx::query(
        "SELECT sessions.id AS id, COALESCE(sessions.keep_versions, ?1) AS keep
         FROM sessions JOIN versions ON versions.session = sessions.id
         GROUP BY sessions.id, sessions.keep_versions
         HAVING COUNT(*) > COALESCE(sessions.keep_versions, ?1)",
    )
    .bind(keep.map(NonZeroU32::get))
    .fetch_all(db)
    .await
    .failed()?;
    found
        .iter()
        .map(|row| Ok((rows::parsed(row, "id")?, rows::keep(row, "keep")?)))
        .collect()
}

async fn prune_versions(db: &mut SqliteConnection, session: &SessionId, keep: NonZeroU32) -> Result<u64, StoreError> {
    let deleted = sqlx::query(
        "DELETE FROM versions
         WHERE session = ?1 AND number <= (SELECT MAX(number) FROM versions WHERE session = ?1) - ?2",
    )
    .bind(session.as_str())
    .bind(keep.get())
    .execute(db)
    .await
    .failed()?;
    Ok(deleted.rows_affected())
}

/// Maps that no version is made of, older than one that a version is made of: no merge takes them any more, not even one
/// that is under way.
async fn prune_maps(db: &mut SqliteConnection, session: &SessionId) -> Result<u64, StoreError> {
    let deleted = sqlx::query(
        "DELETE FROM maps
         WHERE session = ?1
           AND NOT EXISTS (SELECT 1 FROM version_inputs WHERE version_inputs.map = maps.id)
           AND sequence < (
               SELECT MAX(merged.sequence) FROM version_inputs JOIN maps AS merged ON merged.id = version_inputs.map
               WHERE version_inputs.session = ?1 AND version_inputs.robot = maps.robot
           )",
    )
    .bind(session.as_str())
    .execute(db)
    .await
    .failed()?;
    Ok(deleted.rows_affected())
}
