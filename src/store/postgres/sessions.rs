//! Sessions in PostgreSQL.

use sqlx::PgConnection;

use super::Failed;
use super::rows::{self, text};
use crate::model::{
    LabelFilter, RobotId, RobotSummary, Session, SessionId, SessionPatch, SessionSettings, Timestamp, Title,
};
use crate::store::{Created, Missing, Page, StoreError};

/// Makes a session or answers the one that stands, and holds it for this transaction either way.
pub(super) async fn create(
    db: &mut PgConnection,
    id: &SessionId,
    settings: &SessionSettings,
    now: Timestamp,
) -> Result<Created<Session>, StoreError> {
    // Again only when somebody deletes the session between the two statements.
    loop {
        if let Some(value) = insert(db, id, settings, now).await? {
            return Ok(Created { value, created: true });
        }
        if let Some(standing) = hold(db, id).await? {
            if !settings.is_met_by(&standing.settings) {
                return Err(StoreError::SessionExists(id.clone()));
            }
            return Ok(Created {
                value: standing,
                created: false,
            });
        }
    }
}

/// The session when it is new. Waits for whoever is making or deleting the same one right now.
async fn insert(
    db: &mut PgConnection,
    id: &SessionId,
    settings: &SessionSettings,
    now: Timestamp,
) -> Result<Option<Session>, StoreError> {
    let row = sqlx::query(
        "INSERT INTO sessions (id, title, labels, anchor, auto_merge, method, resolution, keep_versions,
                               created_at, updated_at)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $9)
         ON CONFLICT (id) DO NOTHING
         RETURNING *",
    )
    .bind(id.as_str())
    .bind(settings.title.as_ref().map(Title::as_str))
    .bind(text(&settings.labels))
    .bind(settings.anchor.as_ref().map(RobotId::as_str))
    .bind(settings.auto_merge)
    .bind(text(&settings.method))
    .bind(settings.resolution.map(f64::from))
    .bind(settings.keep_versions.map(|keep| i64::from(keep.get())))
    .bind(now.as_microsecond())
    .fetch_optional(db)
    .await
    .failed()?;
    row.as_ref().map(rows::session).transpose()
}

/// The session if it is there, held until the transaction ends: who changes what belongs to a session holds it first, so
/// that changes of one session come one after the other, and all take their locks in the same order.
pub(super) async fn hold(db: &mut PgConnection, id: &SessionId) -> Result<Option<Session>, StoreError> {
    let row = sqlx::query("SELECT * FROM sessions WHERE id = $1 FOR NO KEY UPDATE")
        .bind(id.as_str())
        .fetch_optional(db)
        .await
        .failed()?;
    row.as_ref().map(rows::session).transpose()
}

/// The session, which must be there, held until the transaction ends.
pub(super) async fn held(db: &mut PgConnection, id: &SessionId) -> Result<Session, StoreError> {
    hold(db, id).await?.ok_or_else(|| missing(id))
}

/// The session, which must be there, as it is right now.
pub(super) async fn get(db: &mut PgConnection, id: &SessionId) -> Result<Session, StoreError> {
    let row = sqlx::query("SELECT * FROM sessions WHERE id = $1")
        .bind(id.as_str())
        .fetch_optional(db)
        .await
        .failed()?;
    rows::session(&row.ok_or_else(|| missing(id))?)
}

fn missing(id: &SessionId) -> StoreError {
    StoreError::NotFound(Missing::Session(id.clone()))
}

pub(super) async fn list(
    db: &mut PgConnection,
    labels: &LabelFilter,
    page: &Page<SessionId>,
) -> Result<Vec<Session>, StoreError> {
    let found = sqlx::query(
        "SELECT * FROM sessions
         WHERE id > $1 AND NOT EXISTS (
             SELECT 1 FROM json_each_text($3::JSON) AS wanted
             WHERE NOT EXISTS (
                 SELECT 1 FROM json_each_text(sessions.labels::JSON) AS label
                 WHERE label.key = wanted.key AND (wanted.value IS NULL OR label.value = wanted.value)
             )
         )
         ORDER BY id LIMIT $2",
    )
    .bind(page.after.as_ref().map_or("", SessionId::as_str))
    .bind(i64::from(page.size))
    .bind(text(labels))
    .fetch_all(db)
    .await
    .failed()?;
    found.iter().map(rows::session).collect()
}

pub(super) async fn patch(
    db: &mut PgConnection,
    id: &SessionId,
    patch: SessionPatch,
    now: Timestamp,
) -> Result<Session, StoreError> {
    let standing = held(db, id).await?;
    let settings = patch.applied_to(standing.settings.clone());
    if settings == standing.settings {
        return Ok(standing);
    }
    update(db, Session { settings, ..standing }, now).await
}

/// Writes the settings of a session that is held.
pub(super) async fn update(db: &mut PgConnection, session: Session, now: Timestamp) -> Result<Session, StoreError> {
    let settings = &session.settings;
    sqlx::query(
        "UPDATE sessions
         SET title = $2, labels = $3, anchor = $4, auto_merge = $5, method = $6, resolution = $7,
             keep_versions = $8, updated_at = $9
         WHERE id = $1",
    )
    .bind(session.id.as_str())
    .bind(settings.title.as_ref().map(Title::as_str))
    .bind(text(&settings.labels))
    .bind(settings.anchor.as_ref().map(RobotId::as_str))
    .bind(settings.auto_merge)
    .bind(text(&settings.method))
    .bind(settings.resolution.map(f64::from))
    .bind(settings.keep_versions.map(|keep| i64::from(keep.get())))
    .bind(now.as_microsecond())
    .execute(db)
    .await
    .failed()?;
    Ok(Session {
        updated_at: now,
        ..session
    })
}

/// Makes a robot the anchor of a session.
pub(super) async fn reanchor(
    db: &mut PgConnection,
    id: &SessionId,
    anchor: &RobotId,
    now: Timestamp,
) -> Result<(), StoreError> {
    let mut session = held(db, id).await?;
    if session.settings.anchor.as_ref() != Some(anchor) {
        session.settings.anchor = Some(anchor.clone());
        update(db, session, now).await?;
    }
    Ok(())
}

pub(super) async fn delete(db: &mut PgConnection, id: &SessionId) -> Result<(), StoreError> {
    let held = sqlx::query("SELECT id FROM sessions WHERE id = $1 FOR UPDATE")
        .bind(id.as_str())
        .fetch_optional(&mut *db)
        .await
        .failed()?;
    if held.is_none() {
        return Err(missing(id));
    }
    // Before the maps, which the inputs of versions refer to: the order in which cascades run is not promised.
    for statement in [
        "DELETE FROM versions WHERE session = $1",
        "DELETE FROM sessions WHERE id = $1",
    ] {
        sqlx::query(statement)
            .bind(id.as_str())
            .execute(&mut *db)
            .await
            .failed()?;
    }
    Ok(())
}

pub(super) async fn robots(db: &mut PgConnection, id: &SessionId) -> Result<Vec<RobotSummary>, StoreError> {
    get(db, id).await?;
    // sequences have no gaps: the highest is how many there are
    let found = sqlx::query(
        "SELECT DISTINCT ON (robot) robot, sequence, id, received_at FROM maps
         WHERE session = $1 ORDER BY robot, sequence DESC",
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
