//! A home of the service that outlives its servers.

use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::postgres::Database;

/// Records in SQLite or PostgreSQL, blobs in a folder.
pub(super) struct Home {
    folder: TempDir,
    database_url: Option<String>,
}

impl Home {
    /// SQLite in a folder.
    pub(super) fn sqlite() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a folder"),
            database_url: None,
        }
    }

    /// A PostgreSQL database of its own, if this machine has PostgreSQL.
    pub(super) fn postgres() -> Option<Self> {
        Some(Self::over(Database::fresh()?.url()))
    }

    /// A database at this URL.
    pub(super) fn over(database_url: String) -> Self {
        Self {
            folder: tempfile::tempdir().expect("a folder"),
            database_url: Some(database_url),
        }
    }

    /// What a server is told to live here.
    pub(super) fn arguments(&self) -> Vec<String> {
        let mut arguments = vec!["--data".to_owned(), self.path().display().to_string()];
        if let Some(url) = &self.database_url {
            arguments.extend(["--database-url".to_owned(), url.clone()]);
        }
        arguments
    }

    /// The folder.
    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Where the servers write their logs.
    pub(super) fn log(&self) -> PathBuf {
        self.path().join("log")
    }
}
