//! The walk over all records and all blobs.
//!
//! Records may come and go meanwhile: what looks wrong is looked at again before it is told, and a record that is gone is
//! nobody's concern.

use std::collections::BTreeSet;

use futures_util::TryStreamExt;

use super::finding::{Finding, Kind};
use crate::api::MergeResult;
use crate::cli::Failure;
use crate::codec::decode_cells;
use crate::model::{
    BlobKey, Digest, LabelFilter, MapRecord, NewMap, Session, SessionId, Timestamp, Version, VersionSelector,
};
use crate::store::{Blobs, Missing, Page, Store, StoreError};
use crate::worker::Sweeper;

/// A check under way.
pub(super) struct Check<'a> {
    store: &'a dyn Store,
    blobs: &'a Blobs,
    tell: &'a (dyn Fn(&Finding) -> Result<(), Failure> + Sync),
    /// Blobs that records name.
    named: BTreeSet<BlobKey>,
    /// Blobs that were read and are what they were.
    sound: BTreeSet<BlobKey>,
    sums: Sums,
}

#[derive(Debug, Default, serde::Serialize)]
struct Sums {
    sessions: u64,
    maps: u64,
    versions: u64,
    blobs: u64,
    bytes: u64,
    damaged: u64,
    orphans: u64,
    orphan_bytes: u64,
    removed: u64,
}

/// Records that are read at a time.
const PAGE: u32 = 100;
/// Blobs that are removed at a time.
const BATCH: usize = 64;

impl<'a> Check<'a> {
    pub(super) fn new(
        store: &'a dyn Store,
        blobs: &'a Blobs,
        tell: &'a (dyn Fn(&Finding) -> Result<(), Failure> + Sync),
    ) -> Self {
        Self {
            store,
            blobs,
            tell,
            named: BTreeSet::new(),
            sound: BTreeSet::new(),
            sums: Sums::default(),
        }
    }

    /// What was done, as a line.
    pub(super) fn sums(&self) -> String {
        serde_json::json!({ "kind": "sums", "sums": self.sums }).to_string()
    }

    pub(super) fn is_sound(&self) -> bool {
        self.sums.damaged == 0
    }

    /// A fault that the database itself has found.
    pub(super) fn database(&mut self, fault: String) -> Result<(), Failure> {
        self.tell(&Finding::new(Kind::DatabaseDamaged, fault))
    }

    fn tell(&mut self, finding: &Finding) -> Result<(), Failure> {
        self.sums.damaged += u64::from(finding.kind.is_damage());
        (self.tell)(finding)
    }

    /// Looks at every record.
    pub(super) async fn records(&mut self) -> Result<(), Failure> {
        let mut page = Page::first(PAGE);
        loop {
            let sessions = self.store.list_sessions(&LabelFilter::default(), &page).await;
            let Some(sessions) = self.readable(sessions, "sessions")? else {
                return Ok(());
            };
            let Some(last) = sessions.last() else { return Ok(()) };
            page.after = Some(last.id.clone());
            for Session { id, .. } in &sessions {
                self.sums.sessions += 1;
                self.maps(id).await?;
                self.versions(id).await?;
            }
        }
    }

    async fn maps(&mut self, session: &SessionId) -> Result<(), Failure> {
        let mut page = Page::first(PAGE);
        loop {
            let maps = self.store.list_maps(session, None, &page).await;
            let Some(maps) = self.readable(maps, &format!("maps of session {session}"))? else {
                return Ok(());
            };
            let Some(last) = maps.last() else { return Ok(()) };
            page.after = Some(last.id);
            for map in &maps {
                self.sums.maps += 1;
                self.map(map).await?;
            }
        }
    }

    async fn map(&mut self, record: &MapRecord) -> Result<(), Failure> {
        let name = format!("map {} of session {}", record.id, record.session);
        let cells = match self.read(record.map.blob).await? {
            Ok(cells) => cells,
            Err(finding) => {
                let still = self.store.get_map(&record.session, record.id).await.is_ok();
                return if still { self.tell(&finding.of(name)) } else { Ok(()) };
            }
        };
        let says = match decode_cells(&cells) {
            Ok(grid) => {
                let map = NewMap::of(&grid, record.map.blob);
                let same = map.digest == record.map.digest
                    && map.lattice == record.map.lattice
                    && map.counts == record.map.counts;
                (!same).then(|| "its digest, lattice or counts are not those of its cells".to_owned())
            }
            Err(error) => Some(format!("its cells cannot be read: {error}")),
        };
        match says {
            Some(why) => self.tell(&Finding::new(Kind::RecordMismatch, why).of(name).at(record.map.blob)),
            None => Ok(()),
        }
    }

    async fn versions(&mut self, session: &SessionId) -> Result<(), Failure> {
        let mut page = Page::first(PAGE);
        loop {
            let versions = self.store.list_versions(session, &page).await;
            let Some(versions) = self.readable(versions, &format!("versions of session {session}"))? else {
                return Ok(());
            };
            let Some(last) = versions.last() else { return Ok(()) };
            let mut expected = page.after.map(|after| after.get() - 1);
            page.after = Some(last.number);
            for version in &versions {
                self.sums.versions += 1;
                let number = version.number.get();
                if expected.is_some_and(|expected| expected != number) {
                    let detail = format!("version {} is missing", number + 1);
                    self.tell(&Finding::new(Kind::VersionGap, detail).of(format!("session {session}")))?;
                }
                expected = number.checked_sub(1);
                self.version(version).await?;
            }
        }
    }

    async fn version(&mut self, version: &Version) -> Result<(), Failure> {
        let name = format!("version {} of session {}", version.number, version.session);
        for blob in [version.png, version.overlay, version.grid] {
            match self.read(blob).await? {
                Ok(cells) if blob == version.grid => {
                    let is_that = decode_cells(&cells).is_ok_and(|grid| Digest::of_grid(&grid) == version.digest);
                    if !is_that {
                        let why = "its digest is not that of its cells";
                        self.tell(&Finding::new(Kind::RecordMismatch, why).of(&name).at(blob))?;
                    }
                }
                Ok(_) => {}
                Err(finding) => {
                    let which = VersionSelector::Number(version.number);
                    if self.store.get_version(&version.session, which).await.is_ok() {
                        self.tell(&finding.of(&name))?;
                    }
                }
            }
        }
        let result: Result<MergeResult, _> = serde_json::from_str(version.result.as_str());
        let why = match result {
            Err(error) => format!("its result cannot be read: {error}"),
            Ok(result) if result.fused.digest != version.digest => "its result tells another digest".to_owned(),
            Ok(_) => return Ok(()),
        };
        self.tell(&Finding::new(Kind::RecordMismatch, why).of(name))
    }

    /// Reads a blob that a record names.
    async fn read(&mut self, key: BlobKey) -> Result<Result<bytes::Bytes, Finding>, Failure> {
        self.named.insert(key);
        match self.blobs.get(key).await {
            Ok(bytes) => {
                if self.sound.insert(key) {
                    self.sums.blobs += 1;
                    self.sums.bytes += bytes.len() as u64;
                }
                Ok(Ok(bytes))
            }
            Err(StoreError::NotFound(Missing::Blob(_))) => {
                Ok(Err(Finding::new(Kind::BlobMissing, "its bytes are not there").at(key)))
            }
            Err(StoreError::Damaged(why)) => Ok(Err(Finding::new(Kind::BlobDamaged, why).at(key))),
            Err(error) => Err(failed(error)),
        }
    }

    /// A page of records; none when they cannot be read, which is told.
    fn readable<T>(&mut self, answer: Result<Vec<T>, StoreError>, what: &str) -> Result<Option<Vec<T>>, Failure> {
        match answer {
            Ok(records) => Ok(Some(records)),
            // a session that was deleted meanwhile
            Err(StoreError::NotFound(_)) => Ok(None),
            Err(StoreError::Damaged(why)) => {
                self.tell(&Finding::new(Kind::RecordDamaged, why).of(what))?;
                Ok(None)
            }
            Err(error) => Err(failed(error)),
        }
    }

    /// Looks for bytes that no record names, written before `old`, and removes them if there is somebody to do it.
    pub(super) async fn blobs(&mut self, old: Timestamp, sweeper: Option<&Sweeper>) -> Result<(), Failure> {
        let mut all = self.blobs.list();
        let mut orphans = Vec::new();
        while let Some(kept) = all.try_next().await.map_err(failed)? {
            let Some(key) = kept.key else {
                let finding = Finding::new(Kind::Stray, format!("{} is no blob", kept.place));
                self.tell(&finding)?;
                continue;
            };
            if self.named.contains(&key) || kept.written_at >= old {
                continue;
            }
            self.sums.orphans += 1;
            self.sums.orphan_bytes += kept.bytes;
            let detail = format!("{} bytes that no record names", kept.bytes);
            self.tell(&Finding::new(Kind::Orphan, detail).at(key))?;
            orphans.push(key);
        }
        if let Some(sweeper) = sweeper {
            for batch in orphans.chunks(BATCH) {
                // those that a record has named since stay
                let removed = sweeper.remove(batch).await.map_err(failed)?;
                self.sums.removed += removed.len() as u64;
            }
        }
        Ok(())
    }
}

fn failed(error: StoreError) -> Failure {
    Failure::Internal(anyhow::Error::new(error))
}
