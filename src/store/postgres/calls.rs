//! Named changes in PostgreSQL. Who enters a request holds the row of its name, so that of those who come at once one is
//! the first.

use async_trait::async_trait;
use sqlx::PgConnection;
use uuid::Uuid;

use super::rows::{self, text};
use super::{Failed, PostgresStore, commit};
use crate::model::Timestamp;
use crate::store::calls::{KeptCall, Verdict};
use crate::store::{Attempt, Begun, Call, CallEnd, CallStore, KeptAnswer, StoreError};

#[async_trait]
impl CallStore for PostgresStore {
    async fn begin_call(&self, call: &Call, now: Timestamp) -> Result<Begun, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let (makes, token) = if enter(&mut tx, call).await? {
                (call.makes, 1)
            } else {
                // none: its holder has given the name back since
                let Some(kept) = held(&mut tx, call).await? else {
                    return Ok(Begun::UnderWay);
                };
                let token = kept.token + 1;
                let makes = match kept.verdict(call, now) {
                    Verdict::Told(begun) => return Ok(begun),
                    Verdict::Again(makes) => makes,
                    Verdict::Anew => call.makes,
                };
                enter_again(&mut tx, call, makes, token).await?;
                (makes, token)
            };
            commit(tx, &[]).await?;
            Ok(Begun::Now(Attempt {
                owner: call.owner.clone(),
                name: call.name.clone(),
                makes,
                token,
            }))
        })
        .await
    }

    async fn keep_answer(&self, attempt: &Attempt, answer: &KeptAnswer) -> Result<(), StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            sqlx::query(
                "UPDATE calls SET status = $4, headers = $5, body = $6
                 WHERE owner = $1 AND name = $2 AND makes = $3 AND status IS NULL",
            )
            .bind(&attempt.owner)
            .bind(attempt.name.as_str())
            .bind(attempt.makes.to_string())
            .bind(i64::from(answer.status))
            .bind(text(&answer.headers))
            .bind(&answer.body)
            .execute(&mut *tx)
            .await
            .failed()?;
            commit(tx, &[]).await
        })
        .await
    }

    async fn end_call(&self, attempt: &Attempt, end: CallEnd, now: Timestamp) -> Result<(), StoreError> {
        let statement = match end {
            CallEnd::Refused => {
                "DELETE FROM calls WHERE owner = $1 AND name = $2 AND token = $3 AND makes = $4 AND status IS NULL"
            }
            CallEnd::Unknown => {
                "UPDATE calls SET lease_until = $5
                 WHERE owner = $1 AND name = $2 AND token = $3 AND makes = $4 AND status IS NULL"
            }
        };
        self.within(async {
            let mut tx = self.begin().await?;
            let mut query = sqlx::query(statement)
                .bind(&attempt.owner)
                .bind(attempt.name.as_str())
                .bind(rows::count(attempt.token))
                .bind(attempt.makes.to_string());
            if end == CallEnd::Unknown {
                query = query.bind(now.as_microsecond());
            }
            query.execute(&mut *tx).await.failed()?;
            commit(tx, &[]).await
        })
        .await
    }

    async fn forget_calls(&self, now: Timestamp) -> Result<u64, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let gone =
                sqlx::query("DELETE FROM calls WHERE expires_at <= $1 AND (status IS NOT NULL OR lease_until <= $1)")
                    .bind(now.as_microsecond())
                    .execute(&mut *tx)
                    .await
                    .failed()?;
            commit(tx, &[]).await?;
            Ok(gone.rows_affected())
        })
        .await
    }
}

/// Whether the name was free. Waits for whoever is entering it.
async fn enter(db: &mut PgConnection, call: &Call) -> Result<bool, StoreError> {
    let entered = sqlx::query(
        "INSERT INTO calls (owner, name, target, digest, makes, token, lease_until, expires_at)
         VALUES ($1, $2, $3, $4, $5, 1, $6, $7) ON CONFLICT DO NOTHING",
    )
    .bind(&call.owner)
    .bind(call.name.as_str())
    .bind(&call.target)
    .bind(call.digest.to_string())
    .bind(call.makes.to_string())
    .bind(call.lease_until.as_microsecond())
    .bind(call.expires_at.as_microsecond())
    .execute(db)
    .await
    .failed()?;
    Ok(entered.rows_affected() == 1)
}

async fn held(db: &mut PgConnection, call: &Call) -> Result<Option<KeptCall>, StoreError> {
    let row = sqlx::query("SELECT * FROM calls WHERE owner = $1 AND name = $2 FOR UPDATE")
        .bind(&call.owner)
        .bind(call.name.as_str())
        .fetch_optional(db)
        .await
        .failed()?;
    row.as_ref().map(rows::call).transpose()
}

async fn enter_again(db: &mut PgConnection, call: &Call, makes: Uuid, token: u64) -> Result<(), StoreError> {
    sqlx::query(
        "UPDATE calls
         SET target = $3, digest = $4, makes = $5, token = $6, lease_until = $7, expires_at = $8,
             status = NULL, headers = NULL, body = NULL
         WHERE owner = $1 AND name = $2",
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
