//! Connections that are trusted only as long as the database answers.
//!
//! A connection that was cut without a word looks alive and never answers. So everything has a time limit, on both
//! sides: here a use case ends after [`PATIENCE`], and all connections that are older than its end are replaced; there
//! the database ends a transaction whose client has gone quiet, so that its locks do not outlive it.

use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use sqlx::{Connection, PgConnection, PgPool};
use tokio::time::{Instant, timeout};

/// Longest time for one use case, the wait for a connection included.
pub(super) const PATIENCE: Duration = Duration::from_secs(5);
/// Longest wait for a connection: a new one to a database that is not there yet, or a place among many callers.
const TURN: Duration = Duration::from_secs(4);
/// Longest time for a sign of life of a connection that was not used for a moment.
const SIGN_OF_LIFE: Duration = Duration::from_secs(1);

/// What the database is told to put up with from one of our connections, in milliseconds: a statement, a wait for a lock,
/// a transaction without a statement, and bytes that nobody acknowledges.
const BOUNDS: [(&str, &str); 4] = [
    ("statement_timeout", "10000"),
    ("lock_timeout", "4000"),
    ("idle_in_transaction_session_timeout", "4000"),
    ("tcp_user_timeout", "10000"),
];

/// A pool that makes its connections when they are asked for.
pub(super) fn pool(url: &str, connections: u32, trust: &Trust) -> Result<PgPool, sqlx::Error> {
    let options = PgConnectOptions::from_str(url)?
        .application_name("mapweld")
        .options(BOUNDS);
    let (lent, given_back) = (trust.clone(), trust.clone());
    let pool = PgPoolOptions::new()
        .max_connections(connections)
        .acquire_timeout(TURN)
        // the hooks below ask for a sign of life, with a time limit, which the pool's own question has not
        .test_before_acquire(false)
        .before_acquire(move |connection, known| {
            let trusted = lent.covers(known.age);
            Box::pin(async move {
                if trusted {
                    alive(connection).await.map(|()| true)
                } else {
                    Ok(false)
                }
            })
        })
        .after_release(move |connection, known| {
            let trusted = given_back.covers(known.age);
            Box::pin(async move {
                if trusted {
                    alive(connection).await.map(|()| true)
                } else {
                    Ok(false)
                }
            })
        });
    Ok(pool.connect_lazy_with(options))
}

async fn alive(connection: &mut PgConnection) -> Result<(), sqlx::Error> {
    match timeout(SIGN_OF_LIFE, connection.ping()).await {
        Ok(answer) => answer,
        Err(_) => Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into())),
    }
}

/// Since when connections are trusted. Clones are the same trust.
#[derive(Debug, Clone, Default)]
pub(super) struct Trust(Arc<Mutex<Option<Instant>>>);

impl Trust {
    /// The database did not answer: connections that were made before now are not used again.
    pub(super) fn shaken(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    /// Whether a connection of this age was made since.
    fn covers(&self, age: Duration) -> bool {
        let since = *self.0.lock().unwrap_or_else(PoisonError::into_inner);
        since.is_none_or(|shaken| age <= shaken.elapsed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_from_before_a_silence_are_not_trusted_and_later_ones_are() {
        let trust = Trust::default();
        assert!(trust.covers(Duration::from_mins(10)));
        trust.shaken();
        assert!(!trust.covers(Duration::from_mins(10)));
        // later than the silence, however short the time since
        assert!(trust.covers(Duration::ZERO));
    }
}
