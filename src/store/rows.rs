//! Rows to records and back, the same for every database: both keep texts, whole numbers, numbers and truths, and what
//! is more than that is text. What cannot be read is damage: nothing else writes these tables.

use std::num::NonZeroU32;
use std::time::Duration;

use jiff::SignedDuration;
use serde::Serialize;
use serde::de::DeserializeOwned;

use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;
use sqlx::{Decode, Postgres, Row, Sqlite, Type};

use crate::geometry::Pose2;
use crate::grid::{Lattice, StateCounts};
use crate::model::{
    ApiKey, Author, BlobKey, Constraint, Job, JobId, JobState, MapRecord, MergeRequest, MethodSpec, NewMap, Note,
    ResultText, Scope, Session, SessionId, SessionSettings, Timestamp, Version, VersionInput,
};
use crate::store::calls::KeptCall;
use crate::store::error::Part;
use crate::store::{BlobMark, KeptAnswer, Lease, StoreError};

pub(super) fn session(row: &impl StoredRow) -> Result<Session, StoreError> {
    Ok(Session {
        id: parsed(row, "id")?,
        settings: SessionSettings {
            title: optional(row, "title", |text: String| crate::model::Title::parse(&text))?,
            labels: json(row, "labels")?,
            anchor: optional_parsed(row, "anchor")?,
            auto_merge: value(row, "auto_merge")?,
            method: method(row)?,
            resolution: optional(row, "resolution", crate::model::Resolution::parse)?,
            keep_versions: optional(row, "keep_versions", |keep: u32| NonZeroU32::try_from(keep))?,
        },
        created_at: time(row, "created_at")?,
        updated_at: time(row, "updated_at")?,
    })
}

/// Whichever release wrote it.
fn method(row: &impl StoredRow) -> Result<MethodSpec, StoreError> {
    let mut record: serde_json::Value = json(row, "method")?;
    MethodSpec::renew(&mut record);
    serde_json::from_value(record).map_err(|error| damaged("method", error))
}

/// Whichever release wrote it.
fn request(row: &impl StoredRow) -> Result<MergeRequest, StoreError> {
    let mut record: serde_json::Value = json(row, "request")?;
    if let Some(method) = record.get_mut("method") {
        MethodSpec::renew(method);
    }
    serde_json::from_value(record).map_err(|error| damaged("request", error))
}

pub(super) fn map(row: &impl StoredRow) -> Result<MapRecord, StoreError> {
    let (x, y, yaw) = (
        value(row, "origin_x")?,
        value(row, "origin_y")?,
        value(row, "origin_yaw")?,
    );
    let origin = Pose2::parse(x, y, yaw).ok_or_else(|| damaged("origin", "is not finite"))?;
    let lattice = Lattice::new(
        value(row, "width")?,
        value(row, "height")?,
        value(row, "resolution")?,
        origin,
    )
    .map_err(|error| damaged("lattice", error))?;
    let counts = StateCounts {
        unknown: value(row, "unknown_cells")?,
        free: value(row, "free_cells")?,
        occupied: value(row, "occupied_cells")?,
    };
    Ok(MapRecord {
        id: parsed(row, "id")?,
        session: parsed(row, "session")?,
        robot: parsed(row, "robot")?,
        sequence: value(row, "sequence")?,
        map: NewMap {
            digest: parsed(row, "digest")?,
            blob: blob(row, "blob")?,
            lattice,
            counts,
            frame_id: value(row, "frame_id")?,
            warnings: json(row, "warnings")?,
        },
        job: optional_parsed(row, "job")?,
        received_at: time(row, "received_at")?,
    })
}

pub(super) fn job(row: &impl StoredRow) -> Result<Job, StoreError> {
    Ok(Job {
        id: parsed(row, "id")?,
        session: parsed(row, "session")?,
        kind: word(row, "kind")?,
        request: request(row)?,
        state: word(row, "state")?,
        attempt: value(row, "attempt")?,
        max_attempts: value(row, "max_attempts")?,
        run_after: time(row, "run_after")?,
        stage: value(row, "stage")?,
        progress: value(row, "progress")?,
        cancel_requested: value(row, "cancel_requested")?,
        error: optional(row, "error", |text: String| serde_json::from_str(&text))?,
        version: optional(row, "version", u32::try_into)?,
        result: optional(row, "result", ResultText::parse)?,
        timings: json(row, "timings")?,
        created_at: time(row, "created_at")?,
        started_at: optional(row, "started_at", Timestamp::from_microsecond)?,
        finished_at: optional(row, "finished_at", Timestamp::from_microsecond)?,
        trace: optional_parsed(row, "trace")?,
    })
}

/// The version of a row, with the inputs that stand in rows of their own.
pub(super) fn version(row: &impl StoredRow, inputs: Vec<VersionInput>) -> Result<Version, StoreError> {
    Ok(Version {
        session: parsed(row, "session")?,
        number: convert(value::<u32>(row, "number")?, "number", u32::try_into)?,
        parent: optional(row, "parent", u32::try_into)?,
        job: parsed(row, "job")?,
        anchor: parsed(row, "anchor")?,
        inputs,
        result: convert(value(row, "result")?, "result", ResultText::parse)?,
        grid: blob(row, "grid_blob")?,
        png: blob(row, "png_blob")?,
        overlay: blob(row, "overlay_blob")?,
        digest: parsed(row, "digest")?,
        restored_from: optional(row, "restored_from", u32::try_into)?,
        created_at: time(row, "created_at")?,
    })
}

pub(super) fn constraint(row: &impl StoredRow) -> Result<Constraint, StoreError> {
    Ok(Constraint {
        id: parsed(row, "id")?,
        session: parsed(row, "session")?,
        rule: json(row, "rule")?,
        author: optional(row, "author", |text: String| Author::parse(&text))?,
        note: optional(row, "note", |text: String| Note::parse(&text))?,
        created_at: time(row, "created_at")?,
    })
}

pub(super) fn key(row: &impl StoredRow) -> Result<ApiKey, StoreError> {
    let scope = Scope::parse(
        &value::<String>(row, "scope")?,
        optional_parsed(row, "session")?,
        optional_parsed(row, "robot")?,
    );
    Ok(ApiKey {
        id: parsed(row, "id")?,
        name: parsed(row, "name")?,
        scope: scope.map_err(|error| damaged("scope", error))?,
        digest: parsed(row, "digest")?,
        created_at: time(row, "created_at")?,
        expires_at: optional(row, "expires_at", Timestamp::from_microsecond)?,
        revoked_at: optional(row, "revoked_at", Timestamp::from_microsecond)?,
    })
}

pub(super) fn version_input(row: &impl StoredRow) -> Result<VersionInput, StoreError> {
    Ok(VersionInput {
        robot: parsed(row, "robot")?,
        map: parsed(row, "map")?,
        digest: parsed(row, "digest")?,
    })
}

pub(super) fn blob_mark(row: &impl StoredRow) -> Result<BlobMark, StoreError> {
    Ok(BlobMark {
        marked_at: time(row, "marked_at")?,
        removed_at: optional(row, "removed_at", Timestamp::from_microsecond)?,
    })
}

pub(super) fn call(row: &impl StoredRow) -> Result<KeptCall, StoreError> {
    let status = optional(row, "status", |status: u32| u16::try_from(status))?;
    let answer = status.map(|status| {
        Ok::<_, StoreError>(KeptAnswer {
            status,
            headers: json(row, "headers")?,
            body: value(row, "body")?,
        })
    });
    Ok(KeptCall {
        target: value(row, "target")?,
        digest: parsed(row, "digest")?,
        makes: parsed(row, "makes")?,
        token: value(row, "token")?,
        lease_until: time(row, "lease_until")?,
        expires_at: time(row, "expires_at")?,
        answer: answer.transpose()?,
    })
}

/// A column of how many are kept.
pub(super) fn keep(row: &impl StoredRow, column: &'static str) -> Result<NonZeroU32, StoreError> {
    convert(value::<u32>(row, column)?, column, NonZeroU32::try_from)
}

/// What a job that was written about is now.
pub(super) struct Written {
    pub(super) session: SessionId,
    pub(super) id: JobId,
    pub(super) state: JobState,
}

pub(super) fn written(row: &impl StoredRow) -> Result<Written, StoreError> {
    Ok(Written {
        session: parsed(row, "session")?,
        id: parsed(row, "id")?,
        state: word(row, "state")?,
    })
}

/// The answer to a worker's write: no row changed, so the lease is lost.
pub(super) fn fenced(row: Option<&impl StoredRow>, lease: &Lease) -> Result<Written, StoreError> {
    written(row.ok_or(StoreError::LeaseLost(lease.job))?)
}

/// A record's part as JSON.
pub(super) fn text<T: Serialize + ?Sized>(value: &T) -> String {
    serde_json::to_string(value).expect("invariant: records are plain data with text keys")
}

/// A count of cells as a column.
pub(super) fn cells(count: usize) -> i64 {
    i64::try_from(count).expect("invariant: a lattice has at most 2^31 cells")
}

/// A lease's token as a column.
pub(super) fn token(lease: &Lease) -> i64 {
    count(lease.token)
}

/// A count of claims or attempts as a column.
pub(super) fn count(count: u64) -> i64 {
    i64::try_from(count).expect("invariant: nobody counts that far")
}

/// The microsecond after a pause.
pub(super) fn until(now: Timestamp, pause: Duration) -> i64 {
    let pause = SignedDuration::try_from(pause).unwrap_or(SignedDuration::MAX);
    now.saturating_add(pause)
        .map_or(i64::MAX, jiff::Timestamp::as_microsecond)
}

/// A row of any of the databases.
pub(super) trait StoredRow {
    /// A column as the database has it.
    fn cell<T: Cell>(&self, column: &'static str) -> Result<T, sqlx::Error>;
}

impl StoredRow for SqliteRow {
    fn cell<T: Cell>(&self, column: &'static str) -> Result<T, sqlx::Error> {
        self.try_get(column)
    }
}

impl StoredRow for PgRow {
    fn cell<T: Cell>(&self, column: &'static str) -> Result<T, sqlx::Error> {
        self.try_get(column)
    }
}

/// A type that every database reads.
pub(super) trait Cell:
    for<'r> Decode<'r, Sqlite> + Type<Sqlite> + for<'r> Decode<'r, Postgres> + Type<Postgres>
{
}

impl<T> Cell for T where T: for<'r> Decode<'r, Sqlite> + Type<Sqlite> + for<'r> Decode<'r, Postgres> + Type<Postgres> {}

/// A type that [`value`] reads: one that the databases have, or a count, which they have as a whole number.
pub(super) trait Value: Sized {
    fn of(row: &impl StoredRow, column: &'static str) -> Result<Self, StoreError>;
}

macro_rules! kept_as_it_is {
    ($($kept:ty),+) => {$(
        impl Value for $kept {
            fn of(row: &impl StoredRow, column: &'static str) -> Result<Self, StoreError> {
                row.cell(column).map_err(|error| damaged(column, error))
            }
        }
    )+};
}
kept_as_it_is!(
    String,
    bool,
    i64,
    f64,
    Option<String>,
    Option<bool>,
    Option<i64>,
    Option<f64>
);

macro_rules! kept_as_a_whole_number {
    ($($count:ty),+) => {$(
        impl Value for $count {
            fn of(row: &impl StoredRow, column: &'static str) -> Result<Self, StoreError> {
                convert(i64::of(row, column)?, column, Self::try_from)
            }
        }
        impl Value for Option<$count> {
            fn of(row: &impl StoredRow, column: &'static str) -> Result<Self, StoreError> {
                optional(row, column, |kept: i64| <$count>::try_from(kept))
            }
        }
    )+};
}
kept_as_a_whole_number!(u32, u64, usize);

/// A column of a type that stands in it as such.
pub(super) fn value<T: Value>(row: &impl StoredRow, column: &'static str) -> Result<T, StoreError> {
    T::of(row, column)
}

/// A column of text that a type of ours is read from.
pub(super) fn parsed<T: std::str::FromStr<Err: std::fmt::Display>>(
    row: &impl StoredRow,
    column: &'static str,
) -> Result<T, StoreError> {
    value::<String>(row, column)?
        .parse()
        .map_err(|error| damaged(column, error))
}

/// A column of microseconds.
pub(super) fn time(row: &impl StoredRow, column: &'static str) -> Result<Timestamp, StoreError> {
    convert(value(row, column)?, column, Timestamp::from_microsecond)
}

/// A column with a word that serde knows as a unit variant.
pub(super) fn word<T: DeserializeOwned>(row: &impl StoredRow, column: &'static str) -> Result<T, StoreError> {
    let word = serde_json::Value::String(value(row, column)?);
    convert(word, column, serde_json::from_value)
}

fn optional_parsed<T: std::str::FromStr<Err: std::fmt::Display>>(
    row: &impl StoredRow,
    column: &'static str,
) -> Result<Option<T>, StoreError> {
    optional(row, column, |text: String| text.parse())
}

fn optional<S, T, E: std::fmt::Display>(
    row: &impl StoredRow,
    column: &'static str,
    read: impl FnOnce(S) -> Result<T, E>,
) -> Result<Option<T>, StoreError>
where
    Option<S>: Value,
{
    let stored: Option<S> = value(row, column)?;
    stored.map(|stored| convert(stored, column, read)).transpose()
}

fn json<T: DeserializeOwned>(row: &impl StoredRow, column: &'static str) -> Result<T, StoreError> {
    convert(value::<String>(row, column)?, column, |text| {
        serde_json::from_str(&text)
    })
}

fn blob(row: &impl StoredRow, column: &'static str) -> Result<BlobKey, StoreError> {
    parsed(row, column).map(BlobKey)
}

fn convert<S, T, E: std::fmt::Display>(
    stored: S,
    column: &'static str,
    read: impl FnOnce(S) -> Result<T, E>,
) -> Result<T, StoreError> {
    read(stored).map_err(|error| damaged(column, error))
}

fn damaged(column: &'static str, why: impl std::fmt::Display) -> StoreError {
    Part::Records.damaged(format!("column {column}: {why}"))
}
