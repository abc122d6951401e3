//! Jobs in PostgreSQL, for those who do them: the statements of the protocol in [`crate::store`].
//!
//! Every write of a worker ends in `WHERE id = .. AND state = 'running' AND lease_token = ..`. No row changed: the lease
//! is lost. Who gives a job back or ends it holds its session first ([`hold_session`]), as uploads do: the two meet at the
//! key that queued jobs share.

use std::time::Duration;

use sqlx::PgConnection;

use super::rows::{self, Written, fenced, text, token, until, written};
use super::{Failed, sessions};
use crate::model::{Job, JobError, JobState, ResultText, SessionId, StageSeconds, Timestamp};
use crate::store::{Claim, Lease, ProgressReport, Retry, StoreError};

/// Ends the jobs whose lease has expired and that shall not run again: cancelled, or out of attempts.
///
/// A job that takes its worker down with it counts its attempts too, because they are counted when it is claimed.
pub(super) async fn park_lost(db: &mut PgConnection, now: Timestamp) -> Result<Vec<Written>, StoreError> {
    let lost = sqlx::query(
        "UPDATE jobs
         SET state = CASE WHEN cancel_requested THEN 'cancelled' ELSE 'failed' END,
             error = CASE WHEN cancel_requested THEN error ELSE json_build_object(
                 'code', 'worker_lost',
                 'message', 'attempt ' || attempt || ' of ' || max_attempts || ' ended without a word: its worker was lost'
             )::TEXT END,
             finished_at = $1, stage = NULL, lease_owner = NULL, lease_until = NULL
         WHERE id IN (
             SELECT id FROM jobs
             WHERE state = 'running' AND lease_until <= $1 AND (cancel_requested OR attempt >= max_attempts)
             FOR UPDATE SKIP LOCKED
         )
         RETURNING session, id, state",
    )
    .bind(now.as_microsecond())
    .fetch_all(db)
    .await
    .failed()?;
    lost.iter().map(written).collect()
}

/// What came of a try to claim a job.
pub(super) enum Tried {
    /// A job was claimed; whether it was taken from a worker that was lost.
    Claimed(Box<Claim>, bool),
    /// There is none to do.
    Nothing,
    /// Somebody else has claimed a job of the same session in this very moment: the transaction is over, look again.
    Clash,
}

/// The constraint that lets one job of a session run at a time.
const ONE_RUNNING: &str = "jobs_one_running_per_session";

pub(super) async fn claim(
    db: &mut PgConnection,
    owner: &str,
    lease: Duration,
    now: Timestamp,
) -> Result<Tried, StoreError> {
    // Longest due first; a job of a session that has one running, even with an expired lease, waits for that one. Rows
    // that others hold are skipped: they are being claimed, ended, or joined by an upload, which tells when it is done.
    let claimed = sqlx::query(
        "WITH due AS MATERIALIZED (
             SELECT due.id AS due_id, due.state = 'running' AS reclaimed FROM jobs AS due
             WHERE ((due.state = 'queued' AND due.run_after <= $1) OR (due.state = 'running' AND due.lease_until <= $1))
               AND NOT EXISTS (
                   SELECT 1 FROM jobs AS other
                   WHERE other.session = due.session AND other.state = 'running' AND other.id <> due.id
               )
             ORDER BY due.run_after, due.id LIMIT 1
             FOR UPDATE OF due SKIP LOCKED
         )
         UPDATE jobs
         SET state = 'running', attempt = attempt + 1, started_at = $1, stage = NULL, progress = 0.0,
             lease_owner = $2, lease_until = $3, lease_token = lease_token + 1
         FROM due
         WHERE id = due_id
         RETURNING jobs.*, reclaimed",
    )
    .bind(now.as_microsecond())
    .bind(owner)
    .bind(until(now, lease))
    .fetch_optional(db)
    .await;
    let row = match claimed {
        Ok(Some(row)) => row,
        Ok(None) => return Ok(Tried::Nothing),
        Err(sqlx::Error::Database(refused)) if refused.constraint() == Some(ONE_RUNNING) => return Ok(Tried::Clash),
        Err(error) => return Err(error).failed(),
    };
    let job = rows::job(&row)?;
    let lease = Lease {
        job: job.id,
        token: rows::value(&row, "lease_token")?,
    };
    let reclaimed = rows::value(&row, "reclaimed")?;
    Ok(Tried::Claimed(Box::new(Claim { lease, job }), reclaimed))
}

pub(super) async fn renew(
    db: &mut PgConnection,
    lease: &Lease,
    hold: Duration,
    report: &ProgressReport,
    now: Timestamp,
) -> Result<Job, StoreError> {
    let row = sqlx::query(
        "UPDATE jobs SET lease_until = $3, stage = $4, progress = $5
         WHERE id = $1 AND state = 'running' AND lease_token = $2
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
    db: &mut PgConnection,
    lease: &Lease,
    dry_run: Option<&ResultText>,
    timings: &[StageSeconds],
    now: Timestamp,
) -> Result<Written, StoreError> {
    hold_session(db, lease).await?;
    let row = sqlx::query(
        "UPDATE jobs
         SET state = 'succeeded', result = $3, timings = $4, finished_at = $5, progress = 1.0, stage = NULL, error = NULL,
             lease_owner = NULL, lease_until = NULL
         WHERE id = $1 AND state = 'running' AND lease_token = $2
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

/// Holds the session of a job. A job that is gone has lost its lease with it.
async fn hold_session(db: &mut PgConnection, lease: &Lease) -> Result<(), StoreError> {
    let lost = StoreError::LeaseLost(lease.job);
    let row = sqlx::query("SELECT session FROM jobs WHERE id = $1")
        .bind(lease.job.to_string())
        .fetch_optional(&mut *db)
        .await
        .failed()?;
    let Some(row) = row else { return Err(lost) };
    let session: SessionId = rows::parsed(&row, "session")?;
    match sessions::hold(db, &session).await? {
        Some(_) => Ok(()),
        None => Err(lost),
    }
}

pub(super) async fn fail(
    db: &mut PgConnection,
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

pub(super) async fn end_cancelled(db: &mut PgConnection, lease: &Lease, now: Timestamp) -> Result<Written, StoreError> {
    let leaving = Leaving {
        next: JobState::Cancelled,
        error: None,
        run_after: now.as_microsecond(),
        uncounted: false,
    };
    leave(db, lease, &leaving, now).await
}

pub(super) async fn release(db: &mut PgConnection, lease: &Lease, now: Timestamp) -> Result<Written, StoreError> {
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
    db: &mut PgConnection,
    lease: &Lease,
    leaving: &Leaving<'_>,
    now: Timestamp,
) -> Result<Written, StoreError> {
    hold_session(db, lease).await?;
    let row = sqlx::query(
        "SELECT cancel_requested, attempt - $3 >= max_attempts AS worn_out
         FROM jobs WHERE id = $1 AND state = 'running' AND lease_token = $2
         FOR UPDATE",
    )
    .bind(lease.job.to_string())
    .bind(token(lease))
    .bind(i64::from(leaving.uncounted))
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
         SET state = $3, error = COALESCE($4, error), run_after = $5, attempt = attempt - $6, stage = NULL, progress = 0.0,
             finished_at = CASE $3 WHEN 'queued' THEN NULL ELSE $7::BIGINT END, lease_owner = NULL, lease_until = NULL,
             dedup_key = CASE WHEN EXISTS (
                 SELECT 1 FROM jobs AS other
                 WHERE other.session = jobs.session AND other.state = 'queued' AND other.dedup_key = jobs.dedup_key
             ) THEN NULL ELSE dedup_key END
         WHERE id = $1 AND state = 'running' AND lease_token = $2
         RETURNING session, id, state",
    )
    .bind(lease.job.to_string())
    .bind(token(lease))
    .bind(next.as_str())
    .bind(leaving.error.map(text))
    .bind(leaving.run_after)
    .bind(i64::from(leaving.uncounted))
    .bind(now.as_microsecond())
    .fetch_optional(db)
    .await
    .failed()?;
    fenced(row.as_ref(), lease)
}
