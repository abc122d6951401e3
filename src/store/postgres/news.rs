//! What any replica changes, told to every replica: NOTIFY within the transaction that makes the change, so that it is
//! told exactly when it is committed; LISTEN on a connection of its own.
//!
//! What is said while the connection is lost is not heard. That costs time, not truth: whoever waits for a change also
//! looks at the store now and then.

use std::time::Duration;

use sqlx::postgres::PgListener;
use sqlx::{Executor, PgConnection, PgPool};
use tokio::sync::broadcast;
use tokio::time::timeout;

use super::Failed;
use crate::store::{Change, StoreError};

/// The channel of all our notifications.
const CHANNEL: &str = "mapweld";
/// The pause before the connection is made again.
const PAUSE: Duration = Duration::from_secs(1);
/// After this long without a word the connection is asked for a sign of life.
const SILENCE: Duration = Duration::from_secs(10);
/// Longest time for that sign.
const SIGN_OF_LIFE: Duration = Duration::from_secs(3);

/// Tells all replicas of these changes, in this order, when the transaction commits.
pub(super) async fn tell(db: &mut PgConnection, changes: &[Change]) -> Result<(), StoreError> {
    let said: Vec<String> = changes
        .iter()
        .map(|change| serde_json::to_string(change).expect("invariant: a change is plain data"))
        .collect();
    sqlx::query(
        "SELECT pg_notify($1, change) FROM unnest($2::TEXT[]) WITH ORDINALITY AS said (change, place) ORDER BY place",
    )
    .bind(CHANNEL)
    .bind(said)
    .execute(db)
    .await
    .failed()?;
    Ok(())
}

/// A connection that listens.
pub(super) async fn listener(pool: &PgPool) -> Result<PgListener, sqlx::Error> {
    let mut listener = PgListener::connect_with(pool).await?;
    listener.listen(CHANNEL).await?;
    Ok(listener)
}

/// Hands on what is heard until the pool is closed, over new connections when one is lost.
pub(super) async fn hear(pool: PgPool, first: PgListener, changes: broadcast::Sender<Change>) {
    let mut listening = Some(first);
    while !pool.is_closed() {
        if let Some(listener) = &mut listening
            && let Err(error) = hear_until_lost(listener, &changes).await
            && !pool.is_closed()
        {
            tracing::warn!(%error, "no word of the other replicas' changes until the connection is made again");
        }
        listening = None;
        tokio::time::sleep(PAUSE).await;
        match listener(&pool).await {
            Ok(listener) => listening = Some(listener),
            Err(error) => tracing::debug!(%error, "cannot listen for changes"),
        }
    }
}

async fn hear_until_lost(listener: &mut PgListener, changes: &broadcast::Sender<Change>) -> Result<(), sqlx::Error> {
    // a connection that is made again behind our back would hide what was missed, and is not asked for signs of life
    listener.eager_reconnect(false);
    loop {
        match timeout(SILENCE, listener.try_recv()).await {
            Ok(Ok(Some(said))) => match serde_json::from_str(said.payload()) {
                // that nobody is there to hear it is no error
                Ok(change) => drop(changes.send(change)),
                // a newer replica tells of things that this one does not know
                Err(error) => tracing::debug!(%error, payload = said.payload(), "an unknown change"),
            },
            Ok(Ok(None)) => return Ok(()),
            Ok(Err(error)) => return Err(error),
            Err(_) => match timeout(SIGN_OF_LIFE, listener.execute("SELECT 1")).await {
                Ok(answer) => {
                    answer?;
                }
                Err(_) => return Err(sqlx::Error::Io(std::io::ErrorKind::TimedOut.into())),
            },
        }
    }
}
