//! Jobs in SQLite, for those who do them: the statements of the protocol in [`crate::store`].
//!
//! Every write of a worker ends in `WHERE id = .. AND state = 'running' AND lease_token = ..`. No row changed: the lease
//! is lost.

use std::time::Duration;

use sqlx::SqliteConnection;

use super::Failed;
use super::rows::{self, Written, fenced, text, token, until, written};
use crate::model::{Job, JobError, JobState, ResultText, StageSeconds, Timestamp};
use crate::store::{Claim, Lease, ProgressReport, Retry, StoreError};

/// Ends the jobs whose lease has expired and that shall not run again: cancelled, or out of attempts.
///
/// A job that takes its worker down with it counts its attempts too, because they are counted when it is claimed.
pub(super) async fn park_lost(db: &mut SqliteConnection, now: Timestamp) -> Result<Vec<Written>, StoreError> {
    let lost = sqlx::query(
        "UPDATE jobs
         SET state = CASE cancel_requested WHEN 1 THEN 'cancelled' ELSE 'failed' END,
             error = CASE cancel_requested WHEN 1 THEN error ELSE json_object(
                 'code', 'worker_lost',
                 'message', 'attempt ' || attempt || ' of ' || max_attempts || ' ended without a word: its worker was lost'
             ) END,
             finished_at = ?1, stage = NULL, lease_owner = NULL, lease_until = NULL
         WHERE state = 'running' AND lease_until <= ?1 AND (cancel_requested = 1 OR attempt >= max_attempts)
         RETURNING session, id, state",
    )
    .bind(now.as_microsecond())
    .fetch_all(db)
    .await
    .failed()?;
    lost.iter().map(written).collect()
}

/// A job, and whether it was taken from a worker that was lost. The transaction is the only one that writes.
pub(super) async fn claim(
    db: &mut SqliteConnection,
    owner: &str,
    lease: Duration,
    now: Timestamp,
) -> Result<Option<(Claim, bool)>, StoreError> {
    // Longest due first; a job of a session that has one running, even with an expired lease, waits for that one.
    let due = sqlx::query(
        "SELECT due.id AS id, due.state AS state FROM jobs AS due
         WHERE ((due.state = 'queued' AND due.run_after <= ?1) OR (due.state = 'running' AND due.lease_until <= ?1))
           AND NOT EXISTS (
               SELECT 1 FROM jobs AS other
               WHERE other.session = due.session AND other.state = 'running' AND other.id <> due.id
           )
         ORDER BY due.run_after, due.id LIMIT 1",
    )
    .bind(now.as_microsecond())
    .fetch_optional(&mut *db)
    .await
    .failed()?;
    let Some(due) = due else { return Ok(None) };
    let was: JobState = rows::word(&due, "state")?;
    let row = sqlx::query(
        "UPDATE jobs
         SET state = 'running', attempt = attempt + 1, started_at = ?1, stage = NULL, progress = 0.0,
             lease_owner = ?2, lease_until = ?3, lease_token = lease_token + 1
         WHERE id = ?4
         RETURNING *",
    )
    .bind(now.as_microsecond())
    .bind(owner)
    .bind(until(now, lease))
    .bind(rows::value::<String>(&due, "id")?)
    .fetch_one(db)
    .await
    .failed()?;
    let job = rows::job(&row)?;
    let lease = Lease {
        job: job.id,
        token: rows::value(&row, "lease_token")?,
    };
    Ok(Some((Claim { lease, job }, was == JobState::Running)))
}

pub(super) async fn renew(
    db: &mut SqliteConnection,
    lease: &Lease,
    hold: Duration,
    report: &ProgressReport,
    now: Timestamp,
) -> Result<Job, StoreError> {
    let row = sqlx::query(
        "UPDATE jobs SET lease_until = ?3, stage = ?4, progress = ?5
         WHERE id = ?1 AND state = 'running' AND lease_token = ?2
         RETURNING *",
    )
    .bind(lease.job.to_string())
    .bind(token(lease))
    .bind(until(now, hold))
    .bind(report.stage.as_deref())
    .bind(report.progress.clamp(0.0, 1.0))
    .fetch_optional(db)
    .await
    .failed()?;
    rows::job(&row.ok_or(StoreError::LeaseLost(lease.job))?)
}

/// Ends a job with success.
pub(super) async fn succeed(
    db: &mut SqliteConnection,
    lease: &Lease,
    dry_run: Option<&ResultText>,
    timings: &[StageSeconds],
    now: Timestamp,
) -> Result<Written, StoreError> {
    let row = sqlx::query(
        "UPDATE jobs
         SET state = 'succeeded', result = ?3, timings = ?4, finished_at = ?5, progress = 1.0, stage = NULL, error = NULL,
             lease_owner = NULL, lease_until = NULL
         WHERE id = ?1 AND state = 'running' AND lease_token = ?2
         RETURNING session, id, state",
    )
    .bind(lease.job.to_string())
    .bind(token(lease))
    .bind(dry_run.map(ResultText::as_str))
    .bind(text(timings))
    .bind(now.as_microsecond())
    .fetch_optional(db)
    .await
    .failed()?;
    fenced(row.as_ref(), lease)
}

pub(super) async fn fail(
    db: &mut SqliteConnection,
    lease: &Lease,
    error: &JobError,
    retry: Retry,
    now: Timestamp,
) -> Result<Written, StoreError> {
    let (next, pause) = match retry {
        Retry::After(pause) => (JobState::Queued, pause),
        Retry::Never => (JobState::Failed, Duration::ZERO),
    };
    let leaving = Leaving {
        next,
        error: Some(error),
        run_after: until(now, pause),
        uncounted: false,
    };
    leave(db, lease, &leaving, now).await
}

pub(super) async fn end_cancelled(
    db: &mut SqliteConnection,
    lease: &Lease,
    now: Timestamp,
) -> Result<Written, StoreError> {
    let leaving = Leaving {
        next: JobState::Cancelled,
        error: None,
        run_after: now.as_microsecond(),
        uncounted: false,
    };
    leave(db, lease, &leaving, now).await
}

pub(super) async fn release(db: &mut SqliteConnection, lease: &Lease, now: Timestamp) -> Result<Written, StoreError> {
    let leaving = Leaving {
        next: JobState::Queued,
        error: None,
        run_after: now.as_microsecond(),
        uncounted: true,
    };
    leave(db, lease, &leaving, now).await
}

/// How a job leaves a worker without success.
struct Leaving<'a> {
    /// Where to, unless somebody has asked for it to end, or it would be queued without an attempt left.
    next: JobState,
    error: Option<&'a JobError>,
    run_after: i64,
    /// Whether the attempt counts as never begun.
    uncounted: bool,
}

async fn leave(
    db: &mut SqliteConnection,
    lease: &Lease,
    leaving: &Leaving<'_>,
    now: Timestamp,
) -> Result<Written, StoreError> {
    let row = sqlx::query(
        "SELECT cancel_requested, attempt - ?3 >= max_attempts AS worn_out
         FROM jobs WHERE id = ?1 AND state = 'running' AND lease_token = ?2",
    )
    .bind(lease.job.to_string())
    .bind(token(lease))
    .bind(leaving.uncounted)
    .fetch_optional(&mut *db)
    .await
    .failed()?
    .ok_or(StoreError::LeaseLost(lease.job))?;
    let next = match leaving.next {
        _ if rows::value(&row, "cancel_requested")? => JobState::Cancelled,
        JobState::Queued if rows::value(&row, "worn_out")? => JobState::Failed,
        next => next,
    };
    // Two queued jobs may not share a key. One that was added while this one ran keeps it: later uploads join that one.
    let row = sqlx::query(
        "UPDATE jobs
         SET state = ?3, error = COALESCE(?4, error), run_after = ?5, attempt = attempt - ?6, stage = NULL, progress = 0.0,
             finished_at = CASE ?3 WHEN 'queued' THEN NULL ELSE ?7 END, lease_owner = NULL, lease_until = NULL,
             dedup_key = CASE WHEN EXISTS (
                 SELECT 1 FROM jobs AS other
                 WHERE other.session = jobs.session AND other.state = 'queued' AND other.dedup_key = jobs.dedup_key
             ) THEN NULL ELSE dedup_key END
         WHERE id = ?1 AND state = 'running' AND lease_token = ?2
         RETURNING session, id, state",
    )
    .bind(lease.job.to_string())
    .bind(token(lease))
    .bind(next.as_str())
    .bind(leaving.error.map(text))
    .bind(leaving.run_after)
    .bind(leaving.uncounted)
    .bind(now.as_microsecond())
    .fetch_optional(db)
    .await
    .failed()?;
    fenced(row.as_ref(), lease)
}
