//! Keys in PostgreSQL.

use async_trait::async_trait;

use super::{Failed, PostgresStore, commit, rows};
use crate::model::{ApiKey, KeyId, RobotId, Scope, SessionId, Timestamp};
use crate::store::{KeyStore, Missing, Page, StoreError};

#[async_trait]
impl KeyStore for PostgresStore {
    async fn add_key(&self, key: &ApiKey) -> Result<(), StoreError> {
        let (session, robot) = match &key.scope {
            Scope::Robot { session, robot } => (Some(session), Some(robot)),
            Scope::Admin | Scope::Operator | Scope::Read => (None, None),
        };
        self.within(async {
            let mut tx = self.begin().await?;
            sqlx::query(
                "INSERT INTO api_keys (id, name, scope, session, robot, digest, created_at, expires_at, revoked_at)
                 VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
            )
            .bind(key.id.to_string())
            .bind(key.name.as_str())
            .bind(key.scope.as_str())
            .bind(session.map(SessionId::as_str))
            .bind(robot.map(RobotId::as_str))
            .bind(key.digest.to_string())
            .bind(key.created_at.as_microsecond())
            .bind(key.expires_at.map(Timestamp::as_microsecond))
            .bind(key.revoked_at.map(Timestamp::as_microsecond))
            .execute(&mut *tx)
            .await
            .failed()?;
            commit(tx, &[]).await
        })
        .await
    }

    async fn find_key(&self, id: KeyId) -> Result<Option<ApiKey>, StoreError> {
        self.within(async {
            let row = sqlx::query("SELECT * FROM api_keys WHERE id = $1")
                .bind(id.to_string())
                .fetch_optional(&mut *self.reader().await?)
                .await
                .failed()?;
            row.as_ref().map(rows::key).transpose()
        })
        .await
    }

    async fn list_keys(&self, page: &Page<KeyId>) -> Result<Vec<ApiKey>, StoreError> {
        self.within(async {
            let found = sqlx::query("SELECT * FROM api_keys WHERE ($1::TEXT IS NULL OR id > $1) ORDER BY id LIMIT $2")
                .bind(page.after.map(|id| id.to_string()))
                .bind(i64::from(page.size))
                .fetch_all(&mut *self.reader().await?)
                .await
                .failed()?;
            found.iter().map(rows::key).collect()
        })
        .await
    }

    async fn revoke_key(&self, id: KeyId, now: Timestamp) -> Result<ApiKey, StoreError> {
        self.within(async {
            let mut tx = self.begin().await?;
            let row = sqlx::query(
                "UPDATE api_keys SET revoked_at = COALESCE(revoked_at, $2) WHERE id = $1
                 RETURNING *",
            )
            .bind(id.to_string())
            .bind(now.as_microsecond())
            .fetch_optional(&mut *tx)
            .await
            .failed()?;
            let row = row.ok_or(StoreError::NotFound(Missing::Key(id)))?;
            commit(tx, &[]).await?;
            rows::key(&row)
        })
        .await
    }

    async fn has_keys(&self) -> Result<bool, StoreError> {
        self.within(async {
            let any = sqlx::query("SELECT 1 FROM api_keys LIMIT 1")
                .fetch_optional(&mut *self.reader().await?)
                .await
                .failed()?;
            Ok(any.is_some())
        })
        .await
    }
}
