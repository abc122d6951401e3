//! Sessions in SQLite.

use std::num::NonZeroU32;

use sqlx::SqliteConnection;

use super::{Failed, rows, text};
use crate::model::{
    LabelFilter, RobotId, RobotSummary, Session, SessionId, SessionPatch, SessionSettings, Timestamp, Title,
};
use crate::store::{Created, Missing, Page, StoreError};

pub(super) async fn create(
    db: &mut SqliteConnection,
    id: &SessionId,
    settings: &SessionSettings,
    now: Timestamp,
) -> Result<Created<Session>, StoreError> {
    if let Some(standing) = find(db, id).await? {
        if !settings.is_met_by(&standing.settings) {
            return Err(StoreError::SessionExists(id.clone()));
        }
        return Ok(Created {
            value: standing,
            created: false,
        });
    }
    sqlx::query(
        "INSERT INTO sessions (id, title, labels, anchor, auto_merge, method, resolution, keep_versions,
                               created_at, updated_at)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?9)",
    )
    .bind(id.as_str())
    .bind(settings.title.as_ref().map(Title::as_str))
    .bind(text(&settings.labels))
    .bind(settings.anchor.as_ref().map(RobotId::as_str))
    .bind(settings.auto_merge)
    .bind(text(&settings.method))
    .bind(settings.resolution.map(f64::from))
    .bind(settings.keep_versions.map(NonZeroU32::get))
    .bind(now.as_microsecond())
    .execute(db)
    .await
    .failed()?;
    Ok(Created {
        value: Session {
            id: id.clone(),
            settings: settings.clone(),
            created_at: now,
            updated_at: now,
        },
        created: true,
    })
}

pub(super) async fn find(db: &mut SqliteConnection, id: &SessionId) -> Result<Option<Session>, StoreError> {
    let row = sqlx::query("SELECT * FROM sessions WHERE id = ?1")
        .bind(id.as_str())
        .fetch_optional(db)
        .await
        .failed()?;
    row.as_ref().map(rows::session).transpose()
}

/// The session, which must be there.
pub(super) async fn get(db: &mut SqliteConnection, id: &SessionId) -> Result<Session, StoreError> {
    find(db, id)
        .await?
        .ok_or_else(|| StoreError::NotFound(Missing::Session(id.clone())))
}

pub(super) async fn list(
    db: &mut SqliteConnection,
    labels: &LabelFilter,
    page: &Page<SessionId>,
) -> Result<Vec<Session>, StoreError> {
    let found = sqlx::query(
        "SELECT * FROM sessions
         WHERE id > ?1 AND NOT EXISTS (
             SELECT 1 FROM json_each(?3) AS wanted
             WHERE NOT EXISTS (
                 SELECT 1 FROM json_each(sessions.labels) AS label
                 WHERE label.key = wanted.key AND (wanted.value IS NULL OR label.value = wanted.value)
             )
         )
         ORDER BY id LIMIT ?2",
    )
    .bind(page.after.as_ref().map_or("", SessionId::as_str))
    .bind(page.size)
    .bind(text(labels))
    .fetch_all(db)
    .await
    .failed()?;
    found.iter().map(rows::session).collect()
}

pub(super) async fn patch(
    db: &mut SqliteConnection,
    id: &SessionId,
    patch: SessionPatch,
    now: Timestamp,
) -> Result<Session, StoreError> {
    let standing = get(db, id).await?;
    let settings = patch.applied_to(standing.settings.clone());
    if settings == standing.settings {
        return Ok(standing);
    }
    update(db, Session { settings, ..standing }, now).await
}

/// Writes the settings of a session that stands.
pub(super) async fn update(db: &mut SqliteConnection, session: Session, now: Timestamp) -> Result<Session, StoreError> {
    let settings = &session.settings;
    sqlx::query(
        "UPDATE sessions
         SET title = ?2, labels = ?3, anchor = ?4, auto_merge = ?5, method = ?6, resolution = ?7,
             keep_versions = ?8, updated_at = ?9
         WHERE id = ?1",
    )
    .bind(session.id.as_str())
    .bind(settings.title.as_ref().map(Title::as_str))
    .bind(text(&settings.labels))
    .bind(settings.anchor.as_ref().map(RobotId::as_str))
    .bind(settings.auto_merge)
    .bind(text(&settings.method))
    .bind(settings.resolution.map(f64::from))
    .bind(settings.keep_versions.map(NonZeroU32::get))
    .bind(now.as_microsecond())
    .execute(db)
    .await
    .failed()?;
    Ok(Session {
        updated_at: now,
        ..session
    })
}

/// Makes a robot the anchor of a session that stands.
pub(super) async fn reanchor(
    db: &mut SqliteConnection,
    id: &SessionId,
    anchor: &RobotId,
    now: Timestamp,
) -> Result<(), StoreError> {
    let mut session = get(db, id).await?;
    if session.settings.anchor.as_ref() != Some(anchor) {
        session.settings.anchor = Some(anchor.clone());
        update(db, session, now).await?;
    }
    Ok(())
}

pub(super) async fn delete(db: &mut SqliteConnection, id: &SessionId) -> Result<(), StoreError> {
    let deleted = sqlx::query("DELETE FROM sessions WHERE id = ?1")
        .bind(id.as_str())
        .execute(db)
        .await
        .failed()?;
    match deleted.rows_affected() {
        0 => Err(StoreError::NotFound(Missing::Session(id.clone()))),
        _ => Ok(()),
    }
}

pub(super) async fn robots(db: &mut SqliteConnection, id: &SessionId) -> Result<Vec<RobotSummary>, StoreError> {
    get(db, id).await?;
    // sequences have no gaps: the highest is how many there are
    let found = sqlx::query(
        "SELECT robot, sequence, id, received_at FROM maps
         WHERE session = ?1 AND (robot, sequence) IN (SELECT robot, MAX(sequence) FROM maps WHERE session = ?1 GROUP BY robot)
         ORDER BY robot",
    )
    .bind(id.as_str())
    .fetch_all(db)
    .await
    .failed()?;
    found
        .iter()
        .map(|row| {
            Ok(RobotSummary {
                robot: rows::parsed(row, "robot")?,
                maps: rows::value(row, "sequence")?,
                newest: rows::parsed(row, "id")?,
                newest_at: rows::time(row, "received_at")?,
            })
        })
        .collect()
}
