//! Maps in PostgreSQL.

use sqlx::PgConnection;

use super::rows::{self, cells, text};
use super::{Failed, jobs, sessions, upkeep};
use crate::model::{MapId, MapRecord, RobotId, SessionId, Timestamp};
use crate::store::{AddMap, Added, Missing, Page, QueueLimits, StoreError};

pub(super) async fn add_and_enqueue(
    db: &mut PgConnection,
    add: AddMap,
    limits: &QueueLimits,
    now: Timestamp,
) -> Result<Added, StoreError> {
    let mut session = match (sessions::hold(db, &add.session).await?, &add.create_session) {
        (Some(session), _) => session,
        (None, Some(settings)) => made_or_found(db, &add.session, settings, now).await?,
        (None, None) => return Err(StoreError::NotFound(Missing::Session(add.session))),
    };
    if let Some(map) = find_content(db, &add).await? {
        return Ok(Added { map, created: false });
    }
    if session.settings.anchor.is_none() {
        session.settings.anchor = Some(add.robot.clone());
        session = sessions::update(db, session, now).await?;
    }
    let job = if session.settings.auto_merge {
        Some(jobs::ensure_auto_merge(db, &add.session, add.job, add.trace, limits, now).await?)
    } else {
        None
    };
    let map = MapRecord {
        id: add.id,
        sequence: last_sequence(db, &add.session, &add.robot).await? + 1,
        session: add.session,
        robot: add.robot,
        map: add.map,
        job,
        received_at: now,
    };
    upkeep::refuse_marked(db, &[map.map.blob]).await?;
    insert(db, &map).await?;
    Ok(Added { map, created: true })
}

/// The session that a map makes, or the one that somebody else has made since we looked, whatever its settings.
async fn made_or_found(
    db: &mut PgConnection,
    id: &SessionId,
    settings: &crate::model::SessionSettings,
    now: Timestamp,
) -> Result<crate::model::Session, StoreError> {
    match sessions::create(db, id, settings, now).await {
        Ok(made) => Ok(made.value),
        Err(StoreError::SessionExists(_)) => sessions::held(db, id).await,
        Err(error) => Err(error),
    }
}

async fn find_content(db: &mut PgConnection, add: &AddMap) -> Result<Option<MapRecord>, StoreError> {
    let row = sqlx::query("SELECT * FROM maps WHERE session = $1 AND robot = $2 AND digest = $3")
        .bind(add.session.as_str())
        .bind(add.robot.as_str())
        .bind(add.map.digest.to_string())
        .fetch_optional(db)
        .await
        .failed()?;
    row.as_ref().map(rows::map).transpose()
}

async fn last_sequence(db: &mut PgConnection, session: &SessionId, robot: &RobotId) -> Result<u32, StoreError> {
    let row = sqlx::query("SELECT COALESCE(MAX(sequence), 0) AS last FROM maps WHERE session = $1 AND robot = $2")
        .bind(session.as_str())
        .bind(robot.as_str())
        .fetch_one(db)
        .await
        .failed()?;
    rows::value(&row, "last")
}

async fn insert(db: &mut PgConnection, record: &MapRecord) -> Result<(), StoreError> {
    let map = &record.map;
    let (lattice, origin) = (map.lattice, map.lattice.origin());
    sqlx::query(
        "INSERT INTO maps (id, session, robot, sequence, digest, blob, width, height, resolution, origin_x, origin_y,
                           origin_yaw, unknown_cells, free_cells, occupied_cells, frame_id, warnings, job, received_at)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17, $18, $19)",
    )
    .bind(record.id.to_string())
    .bind(record.session.as_str())
    .bind(record.robot.as_str())
    .bind(i64::from(record.sequence))
    .bind(map.digest.to_string())
    .bind(map.blob.0.to_string())
    .bind(i64::from(lattice.width()))
    .bind(i64::from(lattice.height()))
    .bind(lattice.resolution())
    .bind(origin.x())
    .bind(origin.y())
    .bind(origin.yaw().radians())
    .bind(cells(map.counts.unknown))
    .bind(cells(map.counts.free))
    .bind(cells(map.counts.occupied))
    .bind(map.frame_id.as_deref())
    .bind(text(&map.warnings))
    .bind(record.job.map(|job| job.to_string()))
    .bind(record.received_at.as_microsecond())
    .execute(db)
    .await
    .failed()?;
    Ok(())
}

pub(super) async fn list(
    db: &mut PgConnection,
    session: &SessionId,
    robot: Option<&RobotId>,
    page: &Page<MapId>,
) -> Result<Vec<MapRecord>, StoreError> {
    sessions::get(db, session).await?;
    let found = sqlx::query(
        "SELECT * FROM maps
         WHERE session = $1 AND ($2::TEXT IS NULL OR robot = $2) AND ($3::TEXT IS NULL OR id < $3)
         ORDER BY id DESC LIMIT $4",
    )
    .bind(session.as_str())
    .bind(robot.map(RobotId::as_str))
    .bind(page.after.map(|id| id.to_string()))
    .bind(i64::from(page.size))
    .fetch_all(db)
    .await
    .failed()?;
    found.iter().map(rows::map).collect()
}

pub(super) async fn get(db: &mut PgConnection, session: &SessionId, id: MapId) -> Result<MapRecord, StoreError> {
    let row = sqlx::query("SELECT * FROM maps WHERE session = $1 AND id = $2")
        .bind(session.as_str())
        .bind(id.to_string())
        .fetch_optional(db)
        .await
        .failed()?;
    match row {
        Some(row) => rows::map(&row),
        None => Err(StoreError::NotFound(Missing::Map(session.clone(), id))),
    }
}

pub(super) async fn newest(db: &mut PgConnection, session: &SessionId) -> Result<Vec<MapRecord>, StoreError> {
    sessions::get(db, session).await?;
    let found = sqlx::query("SELECT DISTINCT ON (robot) * FROM maps WHERE session = $1 ORDER BY robot, sequence DESC")
        .bind(session.as_str())
        .fetch_all(db)
        .await
        .failed()?;
    found.iter().map(rows::map).collect()
}
