//! `mapweld fsck`: whether every record has its bytes and every blob is what it was.

mod check;
mod finding;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;

use super::home::{open_blobs_at, open_store_beside};
use super::runtime::block_on;
use super::{Done, Failure, say};
use crate::clock::{Clock, SystemClock};
use crate::config::{BlobPlace, DatabasePlace, parse_duration};
use crate::worker::Sweeper;
use check::Check;

/// Check every blob against its hash and every record against its blob.
///
/// Works beside a running server or without one. Prints a line of JSON for each finding and one with the sums. The exit
/// code is 0 when the records and their bytes are sound, 4 when something is damaged or missing. Bytes that no record
/// names are no damage; they go with --repair.
#[derive(Debug, Args)]
pub(super) struct Fsck {
    /// Folder of the database and the blobs, as long as nothing else is said.
    #[arg(long, env = "MAPWELD_DATA", default_value = "./mapweld-data", value_name = "FOLDER")]
    data: PathBuf,
    /// Where records are kept, as for `mapweld serve`.
    #[arg(long, env = "MAPWELD_DATABASE_URL", hide_env_values = true, value_name = "URL")]
    database_url: Option<DatabasePlace>,
    /// Where blobs are kept, as for `mapweld serve`. Default: `blobs` in the data folder.
    #[arg(long, env = "MAPWELD_BLOBS", value_name = "PLACE")]
    blobs: Option<BlobPlace>,
    /// Remove bytes that no record names.
    #[arg(long)]
    repair: bool,
    /// With --repair: only bytes that were written at least this long ago. Shorter than an upload takes is safe all the
    /// same, but makes uploads that are under way begin again.
    #[arg(long, env = "MAPWELD_BLOB_GRACE", default_value = "24h", value_parser = parse_duration, value_name = "TIME")]
    grace: Duration,
}

impl Fsck {
    pub(super) fn run(self) -> Result<Done, Failure> {
        let standard = || DatabasePlace::Sqlite(self.data.join("mapweld.sqlite"));
        let place = self.database_url.clone().unwrap_or_else(standard);
        block_on(async {
            let home = open_store_beside(&place).await?;
            let standard = || BlobPlace::Folder(self.data.join("blobs"));
            let blobs = open_blobs_at(&self.blobs.clone().unwrap_or_else(standard))?;
            let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
            let sweeper = self.repair.then(|| Sweeper {
                store: Arc::clone(&home.store),
                blobs: blobs.clone(),
                clock: Arc::clone(&clock),
                keep_versions: None,
                keep_jobs: None,
                grace: self.grace,
            });
            let mut check = Check::new(&*home.store, &blobs, &|finding| say(&finding.line()));
            for fault in home.faults().await? {
                check.database(fault)?;
            }
            check.records().await?;
            let old = clock.now().checked_sub(self.grace);
            check.blobs(old.unwrap_or_default(), sweeper.as_ref()).await?;
            say(&check.sums())?;
            let done = if check.is_sound() {
                Done::Entirely
            } else {
                Done::Damaged
            };
            home.store.close().await;
            Ok(done)
        })?
    }
}
