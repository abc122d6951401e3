//! `mapweld backup`: the records of one moment and all bytes that they name, in a folder that can be served as it is.

use std::collections::BTreeSet;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;

use super::home::{open_blobs_at, open_file_beside};
use super::runtime::block_on;
use super::{Done, Failure, files, say};
use crate::config::BlobPlace;
use crate::model::{BlobKey, LabelFilter};
use crate::store::{Page, Store, StoreError};

/// Copy a server's records and bytes into a new folder, beside the server or without it.
///
/// The records are those of one moment; every byte is checked on its way. Serve the copy with `mapweld serve --data`.
/// For records in PostgreSQL use `pg_dump`: see docs/operations.md.
#[derive(Debug, Args)]
pub(super) struct Backup {
    /// Folder of the database and the blobs.
    #[arg(long, env = "MAPWELD_DATA", default_value = "./mapweld-data", value_name = "FOLDER")]
    data: PathBuf,
    /// Where blobs are kept, as for `mapweld serve`. Default: `blobs` in the data folder.
    #[arg(long, env = "MAPWELD_BLOBS", value_name = "PLACE")]
    blobs: Option<BlobPlace>,
    /// Folder to copy to; it must not hold a database yet.
    #[arg(long, value_name = "FOLDER")]
    to: PathBuf,
}

/// Records that are read at a time.
const PAGE: u32 = 100;

impl Backup {
    pub(super) fn run(self) -> Result<Done, Failure> {
        block_on(self.copy())??;
        Ok(Done::Entirely)
    }

    async fn copy(&self) -> Result<(), Failure> {
        let copy = self.to.join("mapweld.sqlite");
        if copy.exists() {
            let message = format!("--to is {}; it must be a folder without a database", self.to.display());
            return Err(Failure::bad_input(message));
        }
        files::make_folder(&self.to)?;
        // first the records, then the bytes: bytes that a record names stay for as long as it is there, and for the grace
        // time after that
        let live = open_file_beside(&self.data.join("mapweld.sqlite")).await?;
        live.copy_to(&copy)
            .await
            .with_context(|| format!("cannot write {}", copy.display()))?;
        live.close().await;
        let standard = || BlobPlace::Folder(self.data.join("blobs"));
        let from = open_blobs_at(&self.blobs.clone().unwrap_or_else(standard))?;
        let to = open_blobs_at(&BlobPlace::Folder(self.to.join("blobs")))?;
        let records = open_file_beside(&copy).await?;
        let (mut blobs, mut bytes) = (0_u64, 0_u64);
        for key in named(&records).await.context("cannot read the copied records")? {
            let content = from.get(key).await.with_context(|| format!("cannot read blob {key}"))?;
            bytes += content.len() as u64;
            to.put(content)
                .await
                .with_context(|| format!("cannot write blob {key}"))?;
            blobs += 1;
        }
        records.close().await;
        say(&format!(
            "{blobs} blobs with {bytes} bytes and their records are in {}",
            self.to.display()
        ))
    }
}

/// Every blob that a record names.
async fn named(store: &dyn Store) -> Result<BTreeSet<BlobKey>, StoreError> {
    let mut named = BTreeSet::new();
    let mut sessions = Page::first(PAGE);
    loop {
        let page = store.list_sessions(&LabelFilter::default(), &sessions).await?;
        let Some(last) = page.last() else { return Ok(named) };
        sessions.after = Some(last.id.clone());
        for session in &page {
            let mut maps = Page::first(PAGE);
            loop {
                let page = store.list_maps(&session.id, None, &maps).await?;
                let Some(last) = page.last() else { break };
                maps.after = Some(last.id);
                named.extend(page.iter().map(|map| map.map.blob));
            }
            let mut versions = Page::first(PAGE);
            loop {
                let page = store.list_versions(&session.id, &versions).await?;
                let Some(last) = page.last() else { break };
                versions.after = Some(last.number);
                named.extend(
                    page.iter()
                        .flat_map(|version| [version.grid, version.png, version.overlay]),
                );
            }
        }
    }
}
