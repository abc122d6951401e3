//! The service's home, opened as the settings say: records and the queue in one place, blobs in another.

use std::sync::Arc;

use anyhow::Context;

use super::Failure;
use crate::config::{DatabasePlace, ServeConfig};
use crate::store::{PostgresStore, QueueLimits, SqliteStore, Store};

/// Opens the database.
///
/// # Errors
/// When it cannot be reached, or, being a file, is served by another process.
pub(super) async fn open_store(config: &ServeConfig, limits: QueueLimits) -> Result<Arc<dyn Store>, Failure> {
    let place = config.database();
    let cannot_open = || format!("cannot open {place}");
    Ok(match &place {
        DatabasePlace::Sqlite(file) => Arc::new(SqliteStore::open_file(file, limits).await.with_context(cannot_open)?),
        DatabasePlace::Postgres(url) => {
            let store = PostgresStore::open(url, config.database_connections, limits).await;
            Arc::new(store.with_context(cannot_open)?)
        }
    })
}
