//! The embedded back end: one SQLite file, served by one process.
//!
//! WAL and `synchronous = FULL`: what was answered has been fsynced. One connection writes, and every transaction that
//! writes begins IMMEDIATE: a read that upgrades would fail at once with `SQLITE_BUSY_SNAPSHOT`, whatever the time-out.

mod calls;
mod constraints;
mod jobs;
mod keys;
mod maps;
mod queue;
mod records;
mod sessions;
mod upkeep;
mod versions;

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;

use sqlx::migrate::Migrator;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{Sqlite, SqlitePool, Transaction};
use tokio::sync::broadcast;

use super::error::Part;
use super::rows::{self, text};
use super::{Change, QueueLimits, StoreError};
use crate::model::JobState;

/// Records in one SQLite file.
#[derive(Debug)]
pub struct SqliteStore {
    writer: SqlitePool,
    readers: SqlitePool,
    limits: QueueLimits,
    changes: broadcast::Sender<Change>,
    /// Held for as long as a server has the store open.
    _lock: Option<File>,
}

/// Readers beside the one writer.
const READERS: u32 = 4;
/// How long a request waits for its turn before it is told to come again.
const TURN: Duration = Duration::from_secs(10);
/// Changes that a slow listener may lag behind before it has to read the store again.
const CHANGES: usize = 1024;
/// How the tables came to be.
static MIGRATIONS: Migrator = sqlx::migrate!("migrations/sqlite");

impl SqliteStore {
    /// Opens `mapweld.sqlite` in this folder.
    ///
    /// # Errors
    /// As [`Self::open_file`].
    pub async fn open(folder: &Path, limits: QueueLimits) -> Result<Self, StoreError> {
        Self::open_file(&folder.join("mapweld.sqlite"), limits).await
    }

    /// Opens this file; makes it, with its folder, when it is not there, and brings an older one up to date. A file of
    /// the same name that ends in `.lock` is locked for as long as it is open.
    ///
    /// # Errors
    /// [`StoreError::InUse`] when another process has it open, otherwise [`StoreError::Unavailable`].
    pub async fn open_file(file: &Path, limits: QueueLimits) -> Result<Self, StoreError> {
        make_folder_of(file).map_err(unavailable)?;
        let lock = locked(&lock_of(file))?;
        let store = Self::connect(file, limits).await?;
        store.migrate().await?;
        Ok(Self {
            _lock: Some(lock),
            ..store
        })
    }

    /// Opens the file for a command beside a server that may have it open. Such a command looks at records and changes
    /// single ones; it takes no jobs.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`], also when a server of an older version has the file open: only who has it alone may
    /// bring it up to date.
    pub async fn open_file_beside(file: &Path) -> Result<Self, StoreError> {
        make_folder_of(file).map_err(unavailable)?;
        let store = Self::connect(file, QueueLimits::default()).await?;
        match locked(&lock_of(file)) {
            // the lock goes when the file is up to date, so that a server finds it free
            Ok(_alone) => store.migrate().await?,
            Err(StoreError::InUse { .. }) if store.is_up_to_date().await? => {}
            Err(StoreError::InUse { .. }) => {
                return Err(unavailable(
                    "a server of another version has it open; restart the server with this version first",
                ));
            }
            Err(error) => return Err(error),
        }
        Ok(store)
    }

    /// Writes all records as they are at one moment into a new file, while others write.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`], also when the file is there already.
    pub async fn copy_to(&self, file: &Path) -> Result<(), StoreError> {
        let name = file
            .to_str()
            .ok_or_else(|| unavailable("the file's name is not UTF-8"))?;
        sqlx::query("VACUUM INTO ?1")
            .bind(name)
            .execute(&mut *self.writer.acquire().await.failed()?)
            .await
            .failed()?;
        File::open(file).and_then(|copy| copy.sync_all()).map_err(unavailable)
    }

    /// What the database itself finds wrong with its file, a sentence each.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    pub async fn faults(&self) -> Result<Vec<String>, StoreError> {
        let mut db = self.reader().await?;
        let mut faults: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check")
            .fetch_all(&mut *db)
            .await
            .failed()?;
        faults.retain(|fault| fault != "ok");
        let dangling =
            sqlx::query("SELECT \"table\" AS name, COUNT(*) AS count FROM pragma_foreign_key_check GROUP BY 1")
                .fetch_all(&mut *db)
                .await
                .failed()?;
        for row in &dangling {
            let (name, count): (String, i64) = (rows::value(row, "name")?, rows::value(row, "count")?);
            faults.push(format!("{count} rows of table {name} refer to rows that are not there"));
        }
        Ok(faults)
    }

    async fn connect(file: &Path, limits: QueueLimits) -> Result<Self, StoreError> {
        let options = SqliteConnectOptions::new()
            .filename(file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(TURN);
        let pool = |size| SqlitePoolOptions::new().max_connections(size).acquire_timeout(TURN);
        let writer = pool(1).connect_with(options.clone()).await.failed()?;
        let readers = pool(READERS)
            .connect_with(options.pragma("query_only", "ON"))
            .await
            .failed()?;
        Ok(Self {
            writer,
            readers,
            limits,
            changes: broadcast::Sender::new(CHANGES),
            _lock: None,
        })
    }

    async fn migrate(&self) -> Result<(), StoreError> {
        MIGRATIONS.run(&self.writer).await.map_err(unavailable)
    }

    /// Whether the newest of our migrations has been applied.
    async fn is_up_to_date(&self) -> Result<bool, StoreError> {
        let newest = MIGRATIONS.iter().map(|migration| migration.version).max();
        let applied: Result<Option<i64>, _> =
            sqlx::query_scalar("SELECT MAX(version) FROM _sqlx_migrations WHERE success")
                .fetch_one(&self.readers)
                .await;
        Ok(applied.failed()? == newest)
    }

    async fn begin(&self) -> Result<Transaction<'static, Sqlite>, StoreError> {
        self.writer.begin_with("BEGIN IMMEDIATE").await.failed()
    }

    async fn reader(&self) -> Result<sqlx::pool::PoolConnection<Sqlite>, StoreError> {
        self.readers.acquire().await.failed()
    }

    /// That nobody listens is no error.
    fn announce(&self, change: Change) {
        let _ = self.changes.send(change);
    }

    fn announce_job(&self, written: rows::Written) -> JobState {
        self.announce(Change::Job(written.session, written.id, written.state));
        written.state
    }
}

/// The lock file of whoever serves this file.
fn lock_of(file: &Path) -> PathBuf {
    file.with_extension("lock")
}

fn make_folder_of(file: &Path) -> std::io::Result<()> {
    let folder = file.parent().filter(|folder| *folder != Path::new(""));
    make_folder(folder.unwrap_or(Path::new(".")))
}

/// A folder is as durable as its entry in the folder above, where that can be looked at.
fn make_folder(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    match folder.canonicalize()?.parent().map(File::open) {
        Some(Ok(above)) => above.sync_all(),
        _ => Ok(()),
    }
}

fn locked(path: &Path) -> Result<File, StoreError> {
    let lock = File::options()
        .create(true)
        .truncate(false)
        .write(true)
        .open(path)
        .map_err(unavailable)?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(TryLockError::WouldBlock) => Err(StoreError::InUse {
            path: path.display().to_string(),
        }),
        Err(TryLockError::Error(error)) => Err(unavailable(error)),
    }
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
            // our own statements met a constraint: what is written there is not what this code writes
            sqlx::Error::Database(refused) if refused.kind() != sqlx::error::ErrorKind::Other => {
                Part::Records.damaged(error.to_string())
            }
            sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_) | sqlx::Error::ColumnNotFound(_) => {
                Part::Records.damaged(error.to_string())
            }
            _ => unavailable(error),
        })
    }
}
