//! Named changes in SQLite.

use async_trait::async_trait;
use sqlx::SqliteConnection;
use uuid::Uuid;

use super::rows::{self, text};
use super::{Failed, SqliteStore};
use crate::model::Timestamp;
use crate::store::calls::{KeptCall, Verdict};
use crate::store::{Attempt, Begun, Call, CallEnd, CallStore, KeptAnswer, StoreError};

#[async_trait]
impl CallStore for SqliteStore {
    async fn begin_call(&self, call: &Call, now: Timestamp) -> Result<Begun, StoreError> {
        let mut tx = self.begin().await?;
        let (makes, token) = match find(&mut tx, call).await? {
            None => (call.makes, 1),
            Some(kept) => {
                let token = kept.token + 1;
                match kept.verdict(call, now) {
                    Verdict::Told(begun) => return Ok(begun),
                    Verdict::Again(makes) => (makes, token),
                    Verdict::Anew => (call.makes, token),
                }
            }
        };
        enter(&mut tx, call, makes, token).await?;
        tx.commit().await.failed()?;
        Ok(Begun::Now(Attempt {
            owner: call.owner.clone(),
            name: call.name.clone(),
            makes,
            token,
        }))
    }

    async fn keep_answer(&self, attempt: &Attempt, answer: &KeptAnswer) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        sqlx::query(
            "UPDATE calls SET status = ?4, headers = ?5, body = ?6
             WHERE owner = ?1 AND name = ?2 AND makes = ?3 AND status IS NULL",
        )
        .bind(&attempt.owner)
        .bind(attempt.name.as_str())
        .bind(attempt.makes.to_string())
        .bind(answer.status)
        .bind(text(&answer.headers))
        .bind(&answer.body)
        .execute(&mut *tx)
        .await
        .failed()?;
        tx.commit().await.failed()
    }

    async fn end_call(&self, attempt: &Attempt, end: CallEnd, now: Timestamp) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        let statement = match end {
            CallEnd::Refused => {
                "DELETE FROM calls WHERE owner = ?1 AND name = ?2 AND token = ?3 AND makes = ?4 AND status IS NULL"
            }
            CallEnd::Unknown => {
                "UPDATE calls SET lease_until = ?5
                 WHERE owner = ?1 AND name = ?2 AND token = ?3 AND makes = ?4 AND status IS NULL"
            }
        };
        let mut query = sqlx::query(statement)
            .bind(&attempt.owner)
            .bind(attempt.name.as_str())
            .bind(rows::count(attempt.token))
            .bind(attempt.makes.to_string());
        if end == CallEnd::Unknown {
            query = query.bind(now.as_microsecond());
        }
        query.execute(&mut *tx).await.failed()?;
        tx.commit().await.failed()
    }

    async fn forget_calls(&self, now: Timestamp) -> Result<u64, StoreError> {
        let mut tx = self.begin().await?;
        let gone =
            sqlx::query("DELETE FROM calls WHERE expires_at <= ?1 AND (status IS NOT NULL OR lease_until <= ?1)")
                .bind(now.as_microsecond())
                .execute(&mut *tx)
                .await
                .failed()?;
        tx.commit().await.failed()?;
        Ok(gone.rows_affected())
    }
}

async fn find(db: &mut SqliteConnection, call: &Call) -> Result<Option<KeptCall>, StoreError> {
    let row = sqlx::query("SELECT * FROM calls WHERE owner = ?1 AND name = ?2")
        .bind(&call.owner)
        .bind(call.name.as_str())
        .fetch_optional(db)
        .await
        .failed()?;
    row.as_ref().map(rows::call).transpose()
}

async fn enter(db: &mut SqliteConnection, call: &Call, makes: Uuid, token: u64) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT OR REPLACE INTO calls (owner, name, target, digest, makes, token, lease_until, expires_at)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
    )
    .bind(&call.owner)
    .bind(call.name.as_str())
    .bind(&call.target)
    .bind(call.digest.to_string())
    .bind(makes.to_string())
    .bind(rows::count(token))
    .bind(call.lease_until.as_microsecond())
    .bind(call.expires_at.as_microsecond())
    .execute(db)
    .await
    .failed()?;
    Ok(())
}
