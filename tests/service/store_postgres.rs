//! PostgreSQL keeps the contract, and what only a store with several replicas promises.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use mapweld::model::{JobId, JobState};
use mapweld::store::{Change, Claim, PostgresStore, StoreError};
use tokio::task::JoinSet;

use crate::postgres::Database;
use crate::store_contract::prelude::{at, enqueue, new_version, push, quiet_session, session};
use crate::store_contract::{AnyStore, LEASE, LIMITS, contract};

const CONNECTIONS: u32 = 8;
/// Longest time for anything that a test waits for.
const PATIENCE: Duration = Duration::from_secs(30);

async fn fresh() -> Option<(PostgresStore, Database)> {
    let database = Database::fresh()?;
    Some((open(&database).await, database))
}

async fn open(database: &Database) -> PostgresStore {
    PostgresStore::open(&database.url(), CONNECTIONS, LIMITS)
        .await
        .expect("opens")
}

/// Some replicas on one database.
async fn replicas(count: usize) -> Option<(Vec<AnyStore>, Database)> {
    let database = Database::fresh()?;
    let mut opening = JoinSet::new();
    for _ in 0..count {
        let database = database.clone();
        opening.spawn(async move { Arc::new(open(&database).await) as AnyStore });
    }
    Some((opening.join_all().await, database))
}

contract!(fresh);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn replicas_that_start_together_on_an_empty_database_all_come_up() {
    let Some((stores, _database)) = replicas(4).await else {
        return;
    };
    for store in &stores {
        store.check().await.expect("is well");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_one_replica_changes_is_told_to_those_who_listen_at_another() {
    let Some((stores, _database)) = replicas(2).await else {
        return;
    };
    let [here, there] = &stores[..] else {
        panic!("two were asked for")
    };
    let id = session("ward");
    let mut changes = there.changes();
    let map = push(here, &id, "r1", 1, at(0)).await.map;
    let expected = [
        Change::Map(id.clone(), map.id),
        Change::Job(id, map.job.expect("a job"), JobState::Queued),
    ];
    for change in expected {
        let heard = tokio::time::timeout(PATIENCE, changes.recv()).await;
        assert_eq!(heard.expect("in time").expect("not lagging"), change);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn replicas_that_claim_and_publish_at_once_leave_no_gaps_and_no_doubles() {
    const ROUNDS: u32 = 6;
    let Some((stores, _database)) = replicas(3).await else {
        return;
    };
    let mut ids = Vec::new();
    for name in ["a", "b"] {
        ids.push(quiet_session(&stores[0], name).await);
    }
    for _ in 0..ROUNDS {
        for id in &ids {
            enqueue(&stores[0], id, at(0)).await;
            enqueue(&stores[1], id, at(0)).await;
        }
        let mut workers = JoinSet::new();
        for lane in 0..9 {
            let store = Arc::clone(&stores[lane % stores.len()]);
            workers.spawn(async move {
                // whoever finds the sessions busy looks again until the queue is empty
                while store.queue_depth().await.expect("is counted").queued > 0 {
                    while let Some(held) = claim(&store).await {
                        store
                            .publish_version(&held.lease, new_version(&[]), at(1))
                            .await
                            .expect("is published");
                    }
                }
            });
        }
        tokio::time::timeout(PATIENCE, workers.join_all())
            .await
            .expect("in time");
    }
    for id in &ids {
        let versions = stores[2]
            .list_versions(id, &mapweld::store::Page::first(100))
            .await
            .expect("a list");
        let numbers: Vec<u32> = versions.iter().rev().map(|version| version.number.get()).collect();
        assert_eq!(numbers, (1..=2 * ROUNDS).collect::<Vec<_>>());
        let jobs: BTreeSet<JobId> = versions.iter().map(|version| version.job).collect();
        assert_eq!(jobs.len(), versions.len(), "no job published twice");
    }
}

async fn claim(store: &AnyStore) -> Option<Claim> {
    store.claim_job("w", LEASE, at(1)).await.expect("the store answers")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn uploads_of_many_robots_through_many_replicas_make_one_session_and_share_its_job() {
    let Some((stores, _database)) = replicas(3).await else {
        return;
    };
    let id = session("ward");
    let mut uploads = JoinSet::new();
    for number in 0..24_u16 {
        let (store, id) = (Arc::clone(&stores[usize::from(number) % 3]), id.clone());
        uploads.spawn(async move { push(&store, &id, &format!("r{}", number % 6), number, at(0)).await });
    }
    let added = uploads.join_all().await;
    let jobs: BTreeSet<_> = added.iter().map(|added| added.map.job).collect();
    assert_eq!(jobs.len(), 1);
    let robots = stores[0].list_robots(&id).await.expect("a list");
    assert_eq!(robots.iter().map(|robot| robot.maps).collect::<Vec<_>>(), [4; 6]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_upload_that_joins_a_job_is_seen_by_the_worker_that_claims_it() {
    let Some((stores, _database)) = replicas(2).await else {
        return;
    };
    let id = session("ward");
    for round in 0..40_u16 {
        push(&stores[0], &id, "r1", 2 * round, at(0)).await;
        let (store, other) = (Arc::clone(&stores[0]), id.clone());
        let uploading = tokio::spawn(async move { push(&store, &other, "r2", 2 * round + 1, at(0)).await });
        let Some(held) = claim(&stores[1]).await else {
            // the upload holds the job: it is claimed after it
            uploading.await.expect("no panic");
            let held = claim(&stores[1]).await.expect("is due");
            publish_all(&stores[1], &held).await;
            continue;
        };
        let seen: BTreeSet<_> = newest(&stores[1], &id).await;
        let uploaded = uploading.await.expect("no panic").map;
        if uploaded.job == Some(held.job.id) {
            assert!(
                seen.contains(&uploaded.id),
                "round {round}: the job that takes it in has not seen it"
            );
        }
        publish_all(&stores[1], &held).await;
    }
}

async fn newest(store: &AnyStore, id: &mapweld::model::SessionId) -> BTreeSet<mapweld::model::MapId> {
    let maps = store.newest_maps(id).await.expect("a list");
    maps.iter().map(|map| map.id).collect()
}

/// Ends this job and whatever waits.
async fn publish_all(store: &AnyStore, held: &Claim) {
    let mut next = Some(held.clone());
    while let Some(held) = next {
        store
            .publish_version(&held.lease, new_version(&[]), at(1))
            .await
            .expect("is published");
        next = claim(store).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_whose_connections_are_cut_works_on_and_hears_changes_again() {
    let Some((stores, database)) = replicas(2).await else {
        return;
    };
    let [here, there] = &stores[..] else {
        panic!("two were asked for")
    };
    let id = quiet_session(here, "ward").await;
    database.query(
        "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
         WHERE datname = current_database() AND pid <> pg_backend_pid()",
    );
    assert_eq!(here.get_session(&id).await.expect("is there").id, id);
    let mut changes = there.changes();
    let heard = async {
        loop {
            // said again and again: what is said before the connection is made again is not heard
            match enqueue_when_possible(here, &id).await {
                Ok(()) | Err(StoreError::QueueFull { .. }) => {}
                Err(error) => panic!("{error}"),
            }
            let patch = serde_json::from_str(r#"{"title":null}"#).expect("a patch");
            here.patch_session(&id, patch, at(1)).await.expect("is patched");
            if let Ok(Ok(change)) = tokio::time::timeout(Duration::from_millis(200), changes.recv()).await {
                break change;
            }
        }
    };
    let change = tokio::time::timeout(PATIENCE, heard).await.expect("in time");
    assert_eq!(change.session(), &id);
}

async fn enqueue_when_possible(store: &AnyStore, id: &mapweld::model::SessionId) -> Result<(), StoreError> {
    let job = crate::store_contract::prelude::job_id();
    let request = mapweld::model::MergeRequest::default();
    store.enqueue_merge(id, job, request.into(), at(0)).await.map(drop)
}

#[tokio::test]
async fn a_database_that_is_not_there_is_unavailable_and_the_password_is_not_told() {
    let url = "postgres://somebody:hunter2@127.0.0.1:1/nowhere";
    let began = std::time::Instant::now();
    match PostgresStore::open(url, 1, LIMITS).await {
        Err(error @ StoreError::Unavailable(_)) => assert!(!format!("{error} {error:?}").contains("hunter2")),
        other => panic!("there is no database, but the answer was {other:?}"),
    }
    assert!(began.elapsed() < PATIENCE);
}
