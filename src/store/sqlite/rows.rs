//! Rows to records. What cannot be read is damage: nothing else writes these tables.

use serde::de::DeserializeOwned;
use sqlx::sqlite::SqliteRow;
use sqlx::{Decode, Row, Sqlite, Type};

use crate::geometry::Pose2;
use crate::grid::{Lattice, StateCounts};
use crate::model::{
    BlobKey, Job, MapRecord, NewMap, ResultText, Session, SessionSettings, Timestamp, Version, VersionInput,
};
use crate::store::StoreError;

pub(super) fn session(row: &SqliteRow) -> Result<Session, StoreError> {
    Ok(Session {
        id: parsed(row, "id")?,
        settings: SessionSettings {
            title: optional(row, "title", |text: String| crate::model::Title::parse(&text))?,
            labels: json(row, "labels")?,
            anchor: optional_parsed(row, "anchor")?,
            auto_merge: value(row, "auto_merge")?,
            method: json(row, "method")?,
            resolution: optional(row, "resolution", crate::model::Resolution::parse)?,
        },
        created_at: time(row, "created_at")?,
        updated_at: time(row, "updated_at")?,
    })
}

pub(super) fn map(row: &SqliteRow) -> Result<MapRecord, StoreError> {
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
        unknown: count(row, "unknown_cells")?,
        free: count(row, "free_cells")?,
        occupied: count(row, "occupied_cells")?,
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

pub(super) fn job(row: &SqliteRow) -> Result<Job, StoreError> {
    Ok(Job {
        id: parsed(row, "id")?,
        session: parsed(row, "session")?,
        kind: word(row, "kind")?,
        request: json(row, "request")?,
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
    })
}

/// The version of a row, with the inputs that stand in rows of their own.
pub(super) fn version(row: &SqliteRow, inputs: Vec<VersionInput>) -> Result<Version, StoreError> {
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
        created_at: time(row, "created_at")?,
    })
}

pub(super) fn version_input(row: &SqliteRow) -> Result<VersionInput, StoreError> {
    Ok(VersionInput {
        robot: parsed(row, "robot")?,
        map: parsed(row, "map")?,
        digest: parsed(row, "digest")?,
    })
}

/// A column of a type that the database knows.
pub(super) fn value<'r, T: Decode<'r, Sqlite> + Type<Sqlite>>(
    row: &'r SqliteRow,
    column: &'static str,
) -> Result<T, StoreError> {
    row.try_get(column).map_err(|error| damaged(column, error))
}

/// A column of text that a type of ours is read from.
pub(super) fn parsed<T: std::str::FromStr<Err: std::fmt::Display>>(
    row: &SqliteRow,
    column: &'static str,
) -> Result<T, StoreError> {
    value::<&str>(row, column)?
        .parse()
        .map_err(|error| damaged(column, error))
}

/// A column of microseconds.
pub(super) fn time(row: &SqliteRow, column: &'static str) -> Result<Timestamp, StoreError> {
    convert(value(row, column)?, column, Timestamp::from_microsecond)
}

/// A column with a word that serde knows as a unit variant.
pub(super) fn word<T: DeserializeOwned>(row: &SqliteRow, column: &'static str) -> Result<T, StoreError> {
    let word = serde_json::Value::String(value(row, column)?);
    convert(word, column, serde_json::from_value)
}

fn optional_parsed<T: std::str::FromStr<Err: std::fmt::Display>>(
    row: &SqliteRow,
    column: &'static str,
) -> Result<Option<T>, StoreError> {
    optional(row, column, |text: String| text.parse())
}

fn optional<'r, S, T, E: std::fmt::Display>(
    row: &'r SqliteRow,
    column: &'static str,
    read: impl FnOnce(S) -> Result<T, E>,
) -> Result<Option<T>, StoreError>
where
    Option<S>: Decode<'r, Sqlite> + Type<Sqlite>,
{
    let stored: Option<S> = value(row, column)?;
    stored.map(|stored| convert(stored, column, read)).transpose()
}

fn json<T: DeserializeOwned>(row: &SqliteRow, column: &'static str) -> Result<T, StoreError> {
    convert(value::<&str>(row, column)?, column, serde_json::from_str)
}

fn blob(row: &SqliteRow, column: &'static str) -> Result<BlobKey, StoreError> {
    parsed(row, column).map(BlobKey)
}

fn count(row: &SqliteRow, column: &'static str) -> Result<usize, StoreError> {
    convert(value::<i64>(row, column)?, column, usize::try_from)
}

fn convert<S, T, E: std::fmt::Display>(
    stored: S,
    column: &'static str,
    read: impl FnOnce(S) -> Result<T, E>,
) -> Result<T, StoreError> {
    read(stored).map_err(|error| damaged(column, error))
}

fn damaged(column: &'static str, why: impl std::fmt::Display) -> StoreError {
    StoreError::Damaged(format!("column {column}: {why}"))
}
