//! Keeping house in PostgreSQL. Who marks blobs holds a lock alone that all who write records hold together, so that a
//! mark and a record never meet halfway.

use std::num::NonZeroU32;

use async_trait::async_trait;
use sqlx::PgConnection;

use super::{Failed, PostgresStore, commit, sessions};
use crate::model::{BlobKey, SessionId, Timestamp};
use crate::store::rows;
use crate::store::{BlobMark, Change, Pruned, StoreError, Upkeep};

#[async_trait]
impl Upkeep for PostgresStore {
    async fn prune(&self, keep: Option<NonZeroU32>) -> Result<Pruned, StoreError> {
        let sessions = self
            .within(async { overfull(&mut *self.reader().await?, keep).await })
            .await?;
        let mut pruned = Pruned::default();
        for (session, keep) in sessions {
            let (versions, maps) = self
                .within(async {
                    let mut tx = self.begin().await?;
                    sessions::hold(&mut tx, &session).await?;
                    let versions = prune_versions(&mut tx, &session, keep).await?;
                    let maps = prune_maps(&mut tx, &session).await?;
                    commit(tx, &[Change::Session(session.clone())]).await?;
                    Ok((versions, maps))
                })
                .await?;
            pruned.versions += versions;
            pruned.maps += maps;
        }
        Ok(pruned)
    }

    async fn prune_jobs(&self, before: Timestamp) -> Result<u64, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let deleted = sqlx::query(
                "DELETE FROM jobs WHERE finished_at < $1 AND NOT EXISTS (SELECT 1 FROM versions WHERE versions.job = jobs.id)",
            )
            .bind(before.as_microsecond())
            .execute(&mut *tx)
            .await
            .failed()?;
            commit(tx, &[]).await?;
            Ok(deleted.rows_affected())
        })
        .await
    }

    async fn mark_unneeded(&self, blobs: &[BlobKey], now: Timestamp) -> Result<Vec<BlobKey>, StoreError> {
        let mut marked = Vec::new();
        for blob in blobs {
            let is_marked = self
                .within(async {
                    let mut tx = self.begin().await?;
                    lock(&mut tx, "SELECT pg_advisory_xact_lock($1)").await?;
                    let is_marked = mark(&mut tx, *blob, now).await?;
                    commit(tx, &[]).await?;
                    Ok(is_marked)
                })
                .await?;
            if is_marked {
                marked.push(*blob);
            }
        }
        Ok(marked)
    }

    async fn blobs_are_gone(&self, blobs: &[BlobKey], now: Timestamp) -> Result<(), StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            for blob in blobs {
                sqlx::query("UPDATE blob_removals SET removed_at = $2 WHERE blob = $1")
                    .bind(blob.0.to_string())
                    .bind(now.as_microsecond())
                    .execute(&mut *tx)
                    .await
                    .failed()?;
            }
            commit(tx, &[]).await
        })
        .await
    }

    async fn blob_mark(&self, blob: BlobKey) -> Result<Option<BlobMark>, StoreError> {
        self.within(async { mark_of(&mut *self.reader().await?, blob).await })
            .await
    }

    async fn unmark_blob(&self, blob: BlobKey, mark: BlobMark) -> Result<bool, StoreError> {
        self.within(async {
            let answer = sqlx::query(
                "DELETE FROM blob_removals
                 WHERE blob = $1 AND marked_at = $2 AND removed_at IS NOT DISTINCT FROM $3",
            )
            .bind(blob.0.to_string())
            .bind(mark.marked_at.as_microsecond())
            .bind(mark.removed_at.map(Timestamp::as_microsecond))
            .execute(&mut *self.reader().await?)
            .await
            .failed()?;
            Ok(answer.rows_affected() > 0)
        })
        .await
    }

    async fn forget_marks(&self, before: Timestamp) -> Result<(), StoreError> {
        self.within(async {
            sqlx::query("DELETE FROM blob_removals WHERE COALESCE(removed_at, marked_at) < $1")
                .bind(before.as_microsecond())
                .execute(&mut *self.reader().await?)
                .await
                .failed()?;
            Ok(())
        })
        .await
    }
}

/// The lock of blobs and the records that name them: any number, as no table has it.
const LOCK: i64 = 0x6d61_7077_656c_6401;

async fn lock(db: &mut PgConnection, statement: &'static str) -> Result<(), StoreError> {
    sqlx::query(statement).bind(LOCK).execute(db).await.failed()?;
    Ok(())
}

/// Before anything else in a transaction that will name blobs: nobody marks any until it ends.
pub(super) async fn hold_off_marks(db: &mut PgConnection) -> Result<(), StoreError> {
    lock(db, "SELECT pg_advisory_xact_lock_shared($1)").await
}

async fn mark(db: &mut PgConnection, blob: BlobKey, now: Timestamp) -> Result<bool, StoreError> {
    let answer = sqlx::query(
        "INSERT INTO blob_removals (blob, marked_at)
         SELECT $1, $2
         WHERE NOT EXISTS (SELECT 1 FROM maps WHERE blob = $1)
           AND NOT EXISTS (SELECT 1 FROM versions WHERE grid_blob = $1)
           AND NOT EXISTS (SELECT 1 FROM versions WHERE png_blob = $1)
           AND NOT EXISTS (SELECT 1 FROM versions WHERE overlay_blob = $1)
         ON CONFLICT (blob) DO UPDATE SET marked_at = excluded.marked_at, removed_at = NULL",
    )
    .bind(blob.0.to_string())
    .bind(now.as_microsecond())
    .execute(db)
    .await
    .failed()?;
    Ok(answer.rows_affected() > 0)
}

async fn mark_of(db: &mut PgConnection, blob: BlobKey) -> Result<Option<BlobMark>, StoreError> {
    let row = sqlx::query("SELECT * FROM blob_removals WHERE blob = $1")
        .bind(blob.0.to_string())
        .fetch_optional(db)
        .await
        .failed()?;
    row.as_ref().map(rows::blob_mark).transpose()
}

/// Refuses to name blobs that are marked, within the transaction that writes the record.
pub(super) async fn refuse_marked(db: &mut PgConnection, blobs: &[BlobKey]) -> Result<(), StoreError> {
    for blob in blobs {
        if mark_of(db, *blob).await?.is_some() {
            return Err(StoreError::BlobRemoved(*blob));
        }
    }
    Ok(())
}

/// Sessions with more versions than they keep, and how many that is.
async fn overfull(db: &mut PgConnection, keep: Option<NonZeroU32>) -> Result<Vec<(SessionId, NonZeroU32)>, StoreError> {
    let found = sqlx::query(
        "SELECT sessions.id AS id, COALESCE(sessions.keep_versions, $1::BIGINT) AS keep
         FROM sessions JOIN versions ON versions.session = sessions.id
         GROUP BY sessions.id, sessions.keep_versions
         HAVING COUNT(*) > COALESCE(sessions.keep_versions, $1::BIGINT)",
    )
    .bind(keep.map(|keep| i64::from(keep.get())))
    .fetch_all(db)
    .await
    .failed()?;
    found
        .iter()
        .map(|row| Ok((rows::parsed(row, "id")?, rows::keep(row, "keep")?)))
        .collect()
}

async fn prune_versions(db: &mut PgConnection, session: &SessionId, keep: NonZeroU32) -> Result<u64, StoreError> {
    let deleted = sqlx::query(
        "DELETE FROM versions
         WHERE session = $1 AND number <= (SELECT MAX(number) FROM versions WHERE session = $1) - $2",
    )
    .bind(session.as_str())
    .bind(i64::from(keep.get()))
    .execute(db)
    .await
    .failed()?;
    Ok(deleted.rows_affected())
}

/// Maps that no version is made of, older than one that a version is made of: no merge takes them any more, not even one
/// that is under way.
async fn prune_maps(db: &mut PgConnection, session: &SessionId) -> Result<u64, StoreError> {
    let deleted = sqlx::query(
        "DELETE FROM maps
         WHERE session = $1
           AND NOT EXISTS (SELECT 1 FROM version_inputs WHERE version_inputs.map = maps.id)
           AND sequence < (
               SELECT MAX(merged.sequence) FROM version_inputs JOIN maps AS merged ON merged.id = version_inputs.map
               WHERE version_inputs.session = $1 AND version_inputs.robot = maps.robot
           )",
    )
    .bind(session.as_str())
    .execute(db)
    .await
    .failed()?;
    Ok(deleted.rows_affected())
}
