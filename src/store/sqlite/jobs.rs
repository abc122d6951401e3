//! Jobs in SQLite, for those who ask for them.

use sqlx::SqliteConnection;

use super::{Failed, rows, sessions, text};
use crate::model::{Job, JobId, SessionId, Timestamp, TraceParent};
use crate::store::{AskedMerge, Missing, Page, QueueDepth, QueueLimits, QueueScope, StoreError};

/// The key that the jobs share which uploads ask for.
const AUTO_MERGE: &str = "auto_merge";

/// The job that will take in what has just been added: one that waits, or a new one.
pub(super) async fn ensure_auto_merge(
    db: &mut SqliteConnection,
    session: &SessionId,
    new: JobId,
    trace: Option<TraceParent>,
    limits: &QueueLimits,
    now: Timestamp,
) -> Result<JobId, StoreError> {
    let waiting = sqlx::query("SELECT id FROM jobs WHERE session = ?1 AND state = 'queued' AND dedup_key = ?2")
        .bind(session.as_str())
        .bind(AUTO_MERGE)
        .fetch_optional(&mut *db)
        .await
        .failed()?;
    if let Some(row) = waiting {
        return rows::parsed(&row, "id");
    }
    let asked = AskedMerge {
        trace,
        ..AskedMerge::default()
    };
    let job = insert(db, session, new, &asked, Some(AUTO_MERGE), limits, now).await?;
    Ok(job.id)
}

pub(super) async fn enqueue_merge(
    db: &mut SqliteConnection,
    session: &SessionId,
    id: JobId,
    asked: &AskedMerge,
    limits: &QueueLimits,
    now: Timestamp,
) -> Result<Job, StoreError> {
    sessions::get(db, session).await?;
    match get(db, id).await {
        Err(StoreError::NotFound(_)) => insert(db, session, id, asked, None, limits, now).await,
        there => there,
    }
}

async fn insert(
    db: &mut SqliteConnection,
    session: &SessionId,
    id: JobId,
    asked: &AskedMerge,
    dedup_key: Option<&str>,
    limits: &QueueLimits,
    now: Timestamp,
) -> Result<Job, StoreError> {
    refuse_when_full(db, session, limits).await?;
    let row = sqlx::query(
        "INSERT INTO jobs (id, session, kind, request, dedup_key, state, attempt, max_attempts, run_after, lease_token,
                           progress, cancel_requested, timings, created_at, trace)
         VALUES (?1, ?2, 'merge', ?3, ?4, 'queued', 0, ?5, ?6, 0, 0.0, 0, '[]', ?6, ?7)
         RETURNING *",
    )
    .bind(id.to_string())
    .bind(session.as_str())
    .bind(text(&asked.request))
    .bind(dedup_key)
    .bind(limits.max_attempts)
    .bind(now.as_microsecond())
    .bind(asked.trace.map(|trace| trace.to_string()))
    .fetch_one(db)
    .await
    .failed()?;
    rows::job(&row)
}

async fn refuse_when_full(
    db: &mut SqliteConnection,
    session: &SessionId,
    limits: &QueueLimits,
) -> Result<(), StoreError> {
    let row = sqlx::query(
        "SELECT COUNT(*) AS total, COUNT(*) FILTER (WHERE session = ?1) AS here FROM jobs WHERE state = 'queued'",
    )
    .bind(session.as_str())
    .fetch_one(db)
    .await
    .failed()?;
    let (total, here): (u32, u32) = (rows::value(&row, "total")?, rows::value(&row, "here")?);
    let full = |scope, queued, limit| Err(StoreError::QueueFull { scope, queued, limit });
    if here >= limits.per_session {
        return full(QueueScope::Session(session.clone()), here, limits.per_session);
    }
    if total >= limits.total {
        return full(QueueScope::Total, total, limits.total);
    }
    Ok(())
}

pub(super) async fn get(db: &mut SqliteConnection, id: JobId) -> Result<Job, StoreError> {
    let row = sqlx::query("SELECT * FROM jobs WHERE id = ?1")
        .bind(id.to_string())
        .fetch_optional(db)
        .await
        .failed()?;
    match row {
        Some(row) => rows::job(&row),
        None => Err(StoreError::NotFound(Missing::Job(id))),
    }
}

pub(super) async fn list(
    db: &mut SqliteConnection,
    session: &SessionId,
    page: &Page<JobId>,
) -> Result<Vec<Job>, StoreError> {
    sessions::get(db, session).await?;
    let found =
        sqlx::query("SELECT * FROM jobs WHERE session = ?1 AND (?2 IS NULL OR id < ?2) ORDER BY id DESC LIMIT ?3")
            .bind(session.as_str())
            .bind(page.after.map(|id| id.to_string()))
            .bind(page.size)
            .fetch_all(db)
            .await
            .failed()?;
    found.iter().map(rows::job).collect()
}

pub(super) async fn cancel(db: &mut SqliteConnection, id: JobId, now: Timestamp) -> Result<Job, StoreError> {
    sqlx::query(
        "UPDATE jobs
         SET cancel_requested = 1,
             state = CASE state WHEN 'queued' THEN 'cancelled' ELSE state END,
             finished_at = CASE state WHEN 'queued' THEN ?2 END
         WHERE id = ?1 AND state IN ('queued', 'running')",
    )
    .bind(id.to_string())
    .bind(now.as_microsecond())
    .execute(&mut *db)
    .await
    .failed()?;
    get(db, id).await
}

pub(super) async fn depth(db: &mut SqliteConnection) -> Result<QueueDepth, StoreError> {
    let row = sqlx::query(
        "SELECT COUNT(*) FILTER (WHERE state = 'queued') AS queued, COUNT(*) FILTER (WHERE state = 'running') AS running
         FROM jobs WHERE state IN ('queued', 'running')",
    )
    .fetch_one(db)
    .await
    .failed()?;
    Ok(QueueDepth {
        queued: rows::value(&row, "queued")?,
        running: rows::value(&row, "running")?,
    })
}
