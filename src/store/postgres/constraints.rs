//! Standing constraints in PostgreSQL.

use sqlx::PgConnection;

use super::rows::{self, text};
use super::{Failed, sessions};
use crate::model::{Author, Constraint, ConstraintId, Note, Rule, SessionId, Steering};
use crate::store::{Missing, Page, StoreError};

pub(super) async fn add(db: &mut PgConnection, constraint: &Constraint) -> Result<Constraint, StoreError> {
    sessions::held(db, &constraint.session).await?;
    let standing = list(db, &constraint.session, &Page::first(Constraint::COUNT_MAX)).await?;
    if let Some(there) = standing.iter().find(|standing| standing.id == constraint.id) {
        return Ok(there.clone());
    }
    if standing.len() >= Constraint::COUNT_MAX as usize {
        return Err(StoreError::TooManyConstraints {
            session: constraint.session.clone(),
            limit: Constraint::COUNT_MAX,
        });
    }
    let rules: Vec<&Rule> = standing.iter().chain([constraint]).map(|one| &one.rule).collect();
    Steering::check(&rules)?;
    sqlx::query(
        "INSERT INTO constraints (id, session, rule, author, note, created_at) VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(constraint.id.to_string())
    .bind(constraint.session.as_str())
    .bind(text(&constraint.rule))
    .bind(constraint.author.as_ref().map(Author::as_str))
    .bind(constraint.note.as_ref().map(Note::as_str))
    .bind(constraint.created_at.as_microsecond())
    .execute(db)
    .await
    .failed()?;
    Ok(constraint.clone())
}

pub(super) async fn list(
    db: &mut PgConnection,
    session: &SessionId,
    page: &Page<ConstraintId>,
) -> Result<Vec<Constraint>, StoreError> {
    sessions::get(db, session).await?;
    let found = sqlx::query(
        "SELECT * FROM constraints WHERE session = $1 AND ($2::TEXT IS NULL OR id > $2) ORDER BY id LIMIT $3",
    )
    .bind(session.as_str())
    .bind(page.after.map(|id| id.to_string()))
    .bind(i64::from(page.size))
    .fetch_all(db)
    .await
    .failed()?;
    found.iter().map(rows::constraint).collect()
}

pub(super) async fn get(
    db: &mut PgConnection,
    session: &SessionId,
    id: ConstraintId,
) -> Result<Constraint, StoreError> {
    sessions::get(db, session).await?;
    let row = sqlx::query("SELECT * FROM constraints WHERE session = $1 AND id = $2")
        .bind(session.as_str())
        .bind(id.to_string())
        .fetch_optional(db)
        .await
        .failed()?;
    match row {
        Some(row) => rows::constraint(&row),
        None => Err(StoreError::NotFound(Missing::Constraint(session.clone(), id))),
    }
}

pub(super) async fn remove(db: &mut PgConnection, session: &SessionId, id: ConstraintId) -> Result<(), StoreError> {
    sessions::held(db, session).await?;
    let removed = sqlx::query("DELETE FROM constraints WHERE session = $1 AND id = $2")
        .bind(session.as_str())
        .bind(id.to_string())
        .execute(db)
        .await
        .failed()?;
    match removed.rows_affected() {
        0 => Err(StoreError::NotFound(Missing::Constraint(session.clone(), id))),
        _ => Ok(()),
    }
}
