//! The back end for many replicas: one PostgreSQL database, any number of equal processes.
//!
//! Transactions are READ COMMITTED. Whoever changes what belongs to a session holds its row first, so that changes of one
//! session come one after the other and nobody waits in a circle; claims skip what others hold. Changes are told to all
//! replicas by NOTIFY, in the transaction that makes them.

mod calls;
mod constraints;
mod jobs;
mod keys;
mod maps;
mod news;
mod pool;
mod queue;
mod records;
mod sessions;
mod upkeep;
mod versions;

use sqlx::pool::PoolConnection;
use sqlx::{PgPool, Postgres, Transaction};
use tokio::sync::broadcast;
use tokio::time::timeout;
use tokio_util::task::AbortOnDropHandle;

use super::error::Part;
use super::rows;
use super::{Change, QueueLimits, StoreError};
use crate::model::Job;
use pool::{PATIENCE, Trust};

/// Records in one PostgreSQL database, which other processes use at the same time.
#[derive(Debug)]
pub struct PostgresStore {
    pool: PgPool,
    trust: Trust,
    limits: QueueLimits,
    changes: broadcast::Sender<Change>,
    _hearing: AbortOnDropHandle<()>,
}

/// Changes that a slow listener may lag behind before it has to read the store again.
const CHANGES: usize = 1024;

impl PostgresStore {
    /// Connects to the database of this URL (`postgres://user:password@host:port/database`), with at most so many
    /// connections, and brings its tables up to date; replicas that start together take turns at that.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] when the URL is no good, the database cannot be reached, or its tables are newer than
    /// this program.
    pub async fn open(url: &str, connections: u32, limits: QueueLimits) -> Result<Self, StoreError> {
        let trust = Trust::default();
        let pool = pool::pool(url, connections, &trust).failed()?;
        sqlx::migrate!("migrations/postgres")
            .run(&pool)
            .await
            .map_err(unavailable)?;
        let changes = broadcast::Sender::new(CHANGES);
        // listens before it is open: whoever looks at the store after this misses nothing
        let listener = news::listener(&pool).await.failed()?;
        let hearing = tokio::spawn(news::hear(pool.clone(), listener, changes.clone()));
        Ok(Self {
            pool,
            trust,
            limits,
            changes,
            _hearing: AbortOnDropHandle::new(hearing),
        })
    }

    /// One use case within its time.
    async fn within<T>(&self, work: impl Future<Output = Result<T, StoreError>> + Send) -> Result<T, StoreError> {
        timeout(PATIENCE, work).await.unwrap_or_else(|_| {
            self.trust.shaken();
            Err(unavailable(format!(
                "the database did not answer within {} s",
                PATIENCE.as_secs()
            )))
        })
    }

    async fn begin(&self) -> Result<Transaction<'static, Postgres>, StoreError> {
        self.pool.begin().await.failed()
    }

    async fn reader(&self) -> Result<PoolConnection<Postgres>, StoreError> {
        self.pool.acquire().await.failed()
    }
}

/// Ends a transaction well, and tells all replicas what it has changed.
async fn commit(mut tx: Transaction<'static, Postgres>, changes: &[Change]) -> Result<(), StoreError> {
    if !changes.is_empty() {
        news::tell(&mut tx, changes).await?;
    }
    tx.commit().await.failed()
}

fn job_change(written: &rows::Written) -> Change {
    Change::Job(written.session.clone(), written.id, written.state)
}

fn changed(job: &Job) -> Change {
    Change::Job(job.session.clone(), job.id, job.state)
}

fn unavailable(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> StoreError {
    Part::Records.unavailable(error)
}

/// Answers of the database as answers of the store.
trait Failed<T> {
    fn failed(self) -> Result<T, StoreError>;
}

impl<T> Failed<T> for Result<T, sqlx::Error> {
    fn failed(self) -> Result<T, StoreError> {
        self.map_err(|error| match &error {
            sqlx::Error::Database(refused) if !passes(refused.code().as_deref()) => {
                Part::Records.damaged(error.to_string())
            }
            sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_) | sqlx::Error::ColumnNotFound(_) => {
                Part::Records.damaged(error.to_string())
            }
            _ => unavailable(error),
        })
    }
}

/// Whether an error of this SQLSTATE may be gone at the next try: its class is about connections (08), a transaction that
/// the database has ended or does not let write (25, 40), who may log in and to what (28, 3D), room (53), locks (55), the
/// operator (57) or the machine (58). Any other says that our own statements and its tables do not fit together.
fn passes(code: Option<&str>) -> bool {
    let class = code.and_then(|code| code.get(..2)).unwrap_or_default();
    matches!(class, "08" | "25" | "28" | "3D" | "40" | "53" | "55" | "57" | "58")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_that_may_be_gone_at_the_next_try_are_told_from_those_that_stay() {
        for passing in ["08006", "25006", "40P01", "53100", "55P03", "57P01", "57014", "58030"] {
            assert!(passes(Some(passing)), "{passing}");
        }
        for staying in [Some("23505"), Some("42P01"), Some("22021"), Some(""), None] {
            assert!(!passes(staying), "{staying:?}");
        }
    }
}
