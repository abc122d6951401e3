//! SQLite keeps the contract, and what only SQLite promises.

use bytes::Bytes;
use mapweld::model::Scope;
use mapweld::store::{Blobs, KeyStore as _, QueueLimits, SqliteStore, Store, StoreError};
use tempfile::TempDir;

use crate::store_contract::prelude::{at, session, upload};
use crate::store_contract::{LEASE, LIMITS, contract, new_key};

async fn fresh() -> Option<(SqliteStore, TempDir)> {
    let folder = tempfile::tempdir().expect("a folder");
    let store = SqliteStore::open(folder.path(), LIMITS).await.expect("opens");
    Some((store, folder))
}

contract!(fresh);

#[tokio::test]
async fn a_second_opener_is_refused_by_the_lock_file() {
    let (_store, folder) = fresh().await.expect("SQLite is built in");
    let second = SqliteStore::open(folder.path(), QueueLimits::default()).await;
    match second {
        Err(StoreError::InUse { path }) => assert!(path.ends_with("mapweld.lock"), "{path}"),
        other => panic!("refused, but the answer was {other:?}"),
    }
}

#[tokio::test]
async fn a_command_beside_a_server_changes_what_the_server_reads_and_takes_no_lock() {
    let (server, folder) = fresh().await.expect("opens");
    let (_, key) = new_key(Scope::Read, at(0));
    let beside = SqliteStore::open_file_beside(&folder.path().join("mapweld.sqlite"))
        .await
        .expect("opens");
    beside.add_key(&key).await.expect("is kept");
    assert_eq!(server.find_key(key.id).await.expect("answers"), Some(key.clone()));
    drop(server);
    let server = SqliteStore::open(folder.path(), LIMITS)
        .await
        .expect("opens beside the command");
    server.revoke_key(key.id, at(1)).await.expect("is revoked");
    let revoked = beside.find_key(key.id).await.expect("answers").expect("is there");
    assert_eq!(revoked.revoked_at, Some(at(1)));
}

#[tokio::test]
async fn what_was_answered_is_there_after_everything_was_dropped_without_a_word() {
    let folder = tempfile::tempdir().expect("a folder");
    let blobs = folder.path().join("blobs");
    let (added, claim, blob);
    {
        let store = SqliteStore::open(folder.path(), LIMITS).await.expect("opens");
        blob = Blobs::open_folder(&blobs)
            .expect("opens")
            .put(Bytes::from_static(b"cells"))
            .await
            .expect("is kept");
        let mut add = upload(&session("ward"), "r1", 1);
        add.map.blob = blob;
        added = store.add_map_and_enqueue(add, at(0)).await.expect("is added");
        claim = store
            .claim_job("w", LEASE, at(1))
            .await
            .expect("answers")
            .expect("is due");
        // dropped without close
    }
    let store = SqliteStore::open(folder.path(), LIMITS).await.expect("opens again");
    let map = store.get_map(&session("ward"), added.map.id).await.expect("is there");
    assert_eq!(map, added.map);
    let bytes = Blobs::open_folder(&blobs)
        .expect("opens")
        .get(map.map.blob)
        .await
        .expect("is there");
    assert_eq!(bytes, "cells");
    // the job of the lost worker runs again once its lease has expired
    assert_eq!(store.claim_job("w2", LEASE, at(2)).await.expect("answers"), None);
    let again = store
        .claim_job("w2", LEASE, at(31))
        .await
        .expect("answers")
        .expect("is due");
    assert_eq!(again.job.id, claim.job.id);
    assert!(again.lease.token > claim.lease.token);
}
