//! The service's home, opened as the settings say: records and the queue in one place, blobs in another.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;

use super::Failure;
use crate::config::{BlobPlace, DatabasePlace, ServeConfig};
use crate::store::{Blobs, PostgresStore, QueueLimits, SqliteStore, Store};

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

/// Opens the place of the blobs.
///
/// # Errors
/// When the folder cannot be made, or the settings of the bucket do not fit together.
pub(super) fn open_blobs(config: &ServeConfig) -> Result<Blobs, Failure> {
    open_blobs_at(&config.blob_place())
}

/// Opens this place of blobs.
///
/// # Errors
/// When the folder cannot be made, or the settings of the bucket do not fit together.
pub(super) fn open_blobs_at(place: &BlobPlace) -> Result<Blobs, Failure> {
    let opened = match place {
        BlobPlace::Folder(folder) => Blobs::open_folder(folder),
        BlobPlace::S3 { bucket, prefix } => {
            let settings = std::env::vars_os().filter_map(|(name, value)| {
                let name = name.into_string().ok().filter(|name| name.starts_with("AWS_"))?;
                Some((name, value.into_string().ok()?))
            });
            Blobs::open_bucket(bucket, prefix, settings)
        }
    };
    Ok(opened.with_context(|| format!("cannot open {place}"))?)
}

/// Opens the database for a command that looks at records and changes single ones; a server may have it open.
///
/// # Errors
/// When it cannot be reached.
pub(super) async fn open_beside(place: &DatabasePlace) -> Result<Box<dyn Store>, Failure> {
    let cannot_open = || format!("cannot open {place}");
    Ok(match place {
        DatabasePlace::Sqlite(file) => Box::new(SqliteStore::open_file_beside(file).await.with_context(cannot_open)?),
        DatabasePlace::Postgres(url) => {
            let store = PostgresStore::open(url, CONNECTIONS, QueueLimits::default()).await;
            Box::new(store.with_context(cannot_open)?)
        }
    })
}

/// For a command; one of them listens.
const CONNECTIONS: u32 = 2;

/// A database that is opened beside a server, for a command that looks at records.
pub(super) struct Home {
    /// The records.
    pub(super) store: Arc<dyn Store>,
    sqlite: Option<Arc<SqliteStore>>,
}

impl Home {
    /// What the database itself finds wrong with its file; PostgreSQL looks after its own.
    ///
    /// # Errors
    /// When it cannot be asked.
    pub(super) async fn faults(&self) -> Result<Vec<String>, Failure> {
        match &self.sqlite {
            Some(sqlite) => Ok(sqlite.faults().await.context("cannot check the database's file")?),
            None => Ok(Vec::new()),
        }
    }
}

/// Opens the database beside a server that may have it open.
///
/// # Errors
/// [`Failure::BadInput`] when it is not there, otherwise when it cannot be opened.
pub(super) async fn open_store_beside(place: &DatabasePlace) -> Result<Home, Failure> {
    match place {
        DatabasePlace::Sqlite(file) => {
            let sqlite = Arc::new(open_file_beside(file).await?);
            Ok(Home {
                store: Arc::clone(&sqlite) as Arc<dyn Store>,
                sqlite: Some(sqlite),
            })
        }
        DatabasePlace::Postgres(url) => {
            let store = PostgresStore::open(url, CONNECTIONS, QueueLimits::default()).await;
            let store = store.with_context(|| format!("cannot open {place}"))?;
            Ok(Home {
                store: Arc::new(store),
                sqlite: None,
            })
        }
    }
}

/// Opens the file of a database that is there.
///
/// # Errors
/// [`Failure::BadInput`] when it is not there, otherwise when it cannot be opened.
pub(super) async fn open_file_beside(file: &Path) -> Result<SqliteStore, Failure> {
    if !file.is_file() {
        let message = format!("{} is not there; it must be the file of a database", file.display());
        return Err(Failure::bad_input(message));
    }
    let store = SqliteStore::open_file_beside(file).await;
    Ok(store.with_context(|| format!("cannot open {}", file.display()))?)
}
