//! Versions in PostgreSQL.

use std::collections::BTreeMap;

use sqlx::PgConnection;
use sqlx::postgres::PgRow;

use super::rows;
use super::{Failed, sessions};
use crate::model::{JobId, SessionId, Timestamp, Version, VersionInput, VersionNumber, VersionSelector};
use crate::store::{Missing, NewVersion, Page, StoreError};

/// Adds the next version of a session that is held, within the transaction that ends its job.
pub(super) async fn add(
    db: &mut PgConnection,
    session: &SessionId,
    job: JobId,
    new: NewVersion,
    now: Timestamp,
) -> Result<Version, StoreError> {
    let row = sqlx::query("SELECT COALESCE(MAX(number), 0) AS last FROM versions WHERE session = $1")
        .bind(session.as_str())
        .fetch_one(&mut *db)
        .await
        .failed()?;
    let last: u32 = rows::value(&row, "last")?;
    let version = Version {
        session: session.clone(),
        number: VersionNumber::new(last + 1).expect("invariant: the number after the last is above zero"),
        parent: VersionNumber::new(last),
        job,
        anchor: new.anchor,
        inputs: new.inputs,
        result: new.result,
        grid: new.grid,
        png: new.png,
        overlay: new.overlay,
        digest: new.digest,
        restored_from: new.restored_from,
        created_at: now,
    };
    insert(db, &version).await?;
    sqlx::query("UPDATE jobs SET version = $2 WHERE id = $1")
        .bind(job.to_string())
        .bind(i64::from(version.number.get()))
        .execute(db)
        .await
        .failed()?;
    Ok(version)
}

async fn insert(db: &mut PgConnection, version: &Version) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO versions (session, number, parent, job, anchor, result, grid_blob, png_blob, overlay_blob, digest,
                               restored_from, created_at)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12)",
    )
    .bind(version.session.as_str())
    .bind(i64::from(version.number.get()))
    .bind(version.parent.map(|parent| i64::from(parent.get())))
    .bind(version.job.to_string())
    .bind(version.anchor.as_str())
    .bind(version.result.as_str())
    .bind(version.grid.0.to_string())
    .bind(version.png.0.to_string())
    .bind(version.overlay.0.to_string())
    .bind(version.digest.to_string())
    .bind(version.restored_from.map(|number| i64::from(number.get())))
    .bind(version.created_at.as_microsecond())
    .execute(&mut *db)
    .await
    .failed()?;
    for input in &version.inputs {
        sqlx::query("INSERT INTO version_inputs (session, number, robot, map, digest) VALUES ($1, $2, $3, $4, $5)")
            .bind(version.session.as_str())
            .bind(i64::from(version.number.get()))
            .bind(input.robot.as_str())
            .bind(input.map.to_string())
            .bind(input.digest.to_string())
            .execute(&mut *db)
            .await
            .failed()?;
    }
    Ok(())
}

pub(super) async fn list(
    db: &mut PgConnection,
    session: &SessionId,
    page: &Page<VersionNumber>,
) -> Result<Vec<Version>, StoreError> {
    sessions::get(db, session).await?;
    let found = sqlx::query(
        "SELECT * FROM versions WHERE session = $1 AND ($2::BIGINT IS NULL OR number < $2)
         ORDER BY number DESC LIMIT $3",
    )
    .bind(session.as_str())
    .bind(page.after.map(|after| i64::from(after.get())))
    .bind(i64::from(page.size))
    .fetch_all(&mut *db)
    .await
    .failed()?;
    with_inputs(db, session, &found).await
}

pub(super) async fn get(
    db: &mut PgConnection,
    session: &SessionId,
    which: VersionSelector,
) -> Result<Version, StoreError> {
    let number = match which {
        VersionSelector::Latest => None,
        VersionSelector::Number(number) => Some(i64::from(number.get())),
    };
    let found = sqlx::query(
        "SELECT * FROM versions WHERE session = $1 AND ($2::BIGINT IS NULL OR number = $2)
         ORDER BY number DESC LIMIT 1",
    )
    .bind(session.as_str())
    .bind(number)
    .fetch_all(&mut *db)
    .await
    .failed()?;
    if let Some(version) = with_inputs(db, session, &found).await?.pop() {
        return Ok(version);
    }
    sessions::get(db, session).await?;
    Err(StoreError::NotFound(Missing::Version(session.clone(), which)))
}

/// The versions of these rows, which are ordered from the highest number down.
async fn with_inputs(db: &mut PgConnection, session: &SessionId, found: &[PgRow]) -> Result<Vec<Version>, StoreError> {
    let (Some(highest), Some(lowest)) = (found.first(), found.last()) else {
        return Ok(Vec::new());
    };
    let inputs = sqlx::query(
        "SELECT * FROM version_inputs WHERE session = $1 AND number BETWEEN $2 AND $3 ORDER BY number, robot",
    )
    .bind(session.as_str())
    .bind(rows::value::<i64>(lowest, "number")?)
    .bind(rows::value::<i64>(highest, "number")?)
    .fetch_all(db)
    .await
    .failed()?;
    let mut by_number: BTreeMap<u32, Vec<VersionInput>> = BTreeMap::new();
    for input in &inputs {
        let number = rows::value(input, "number")?;
        by_number.entry(number).or_default().push(rows::version_input(input)?);
    }
    found
        .iter()
        .map(|row| {
            let inputs = by_number.remove(&rows::value(row, "number")?).unwrap_or_default();
            rows::version(row, inputs)
        })
        .collect()
}
