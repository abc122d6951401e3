//! Lists, counts and changes, and many callers at once.

use super::prelude::*;

// Looking

pub(crate) async fn jobs_are_listed_newest_first(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let mut asked = Vec::new();
    for second in 0..3 {
        asked.push(enqueue(&store, &id, at(second)).await.id);
    }
    asked.reverse();
    let of = |jobs: Vec<Job>| jobs.into_iter().map(|job| job.id).collect::<Vec<_>>();
    assert_eq!(
        of(store.list_jobs(&id, &Page::first(2)).await.expect("a list")),
        asked[..2]
    );
    let rest = Page {
        after: Some(asked[1]),
        size: 2,
    };
    assert_eq!(of(store.list_jobs(&id, &rest).await.expect("a list")), asked[2..]);
}

pub(crate) async fn the_depth_of_the_queue_counts_waiting_and_running_jobs(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    for _ in 0..3 {
        enqueue(&store, &id, at(0)).await;
    }
    claim(&store, at(0)).await;
    let depth = store.queue_depth().await.expect("is counted");
    assert_eq!((depth.queued, depth.running), (2, 1));
    store.check().await.expect("is well");
}

pub(crate) async fn changes_are_announced_to_those_who_listen(store: AnyStore) {
    let id = session("ward");
    let mut changes = store.changes();
    let map = push(&store, &id, "r1", 1, at(0)).await.map;
    let job = map.job.expect("a job");
    let held = claim(&store, at(0)).await;
    let version = store
        .publish_version(&held.lease, new_version(&[]), at(1))
        .await
        .expect("is published");
    let expected = [
        Change::Map(id.clone(), map.id),
        Change::Job(id.clone(), job, JobState::Queued),
        Change::Job(id.clone(), job, JobState::Running),
        Change::Version(id.clone(), version.number),
        Change::Job(id.clone(), job, JobState::Succeeded),
    ];
    for change in expected {
        let heard = tokio::time::timeout(Duration::from_secs(10), changes.recv()).await;
        assert_eq!(heard.expect("in time").expect("not lagging"), change);
    }
}

// Many at once

pub(crate) async fn many_tasks_that_claim_at_once_get_each_job_once(store: AnyStore) {
    let mut asked = BTreeSet::new();
    for number in 0..LIMITS.total {
        let id = quiet_session(&store, &format!("s{number}")).await;
        asked.insert(enqueue(&store, &id, at(0)).await.id);
    }
    let mut tasks = tokio::task::JoinSet::new();
    for _ in 0..32 {
        let store = Arc::clone(&store);
        tasks.spawn(async move { store.claim_job("w", LEASE, at(1)).await.expect("the store answers") });
    }
    let claims: Vec<Claim> = tasks.join_all().await.into_iter().flatten().collect();
    assert_eq!(claims.len(), asked.len());
    assert_eq!(claims.iter().map(|claim| claim.job.id).collect::<BTreeSet<_>>(), asked);
}

pub(crate) async fn many_sessions_and_workers_publish_without_gaps_or_doubles(store: AnyStore) {
    const ROUNDS: u32 = 8;
    let ids = [quiet_session(&store, "a").await, quiet_session(&store, "b").await];
    for _ in 0..ROUNDS {
        for id in &ids {
            enqueue(&store, id, at(0)).await;
            enqueue(&store, id, at(0)).await;
        }
        let mut workers = tokio::task::JoinSet::new();
        for _ in 0..4 {
            let store = Arc::clone(&store);
            workers.spawn(async move {
                while let Some(held) = store.claim_job("w", LEASE, at(1)).await.expect("the store answers") {
                    store
                        .publish_version(&held.lease, new_version(&[]), at(1))
                        .await
                        .expect("is published");
                }
            });
        }
        workers.join_all().await;
        // a worker that found the session of a waiting job busy has gone home: finish what is left
        while let Some(held) = store.claim_job("w", LEASE, at(1)).await.expect("the store answers") {
            store
                .publish_version(&held.lease, new_version(&[]), at(1))
                .await
                .expect("is published");
        }
    }
    for id in &ids {
        let versions = store.list_versions(id, &Page::first(100)).await.expect("a list");
        let numbers: Vec<u32> = versions.iter().rev().map(|version| version.number.get()).collect();
        assert_eq!(numbers, (1..=2 * ROUNDS).collect::<Vec<_>>());
        let jobs: BTreeSet<JobId> = versions.iter().map(|version| version.job).collect();
        assert_eq!(jobs.len(), versions.len(), "no job published twice");
    }
}

pub(crate) async fn many_uploads_at_once_keep_sequences_without_gaps_and_share_jobs(store: AnyStore) {
    let id = session("ward");
    let mut tasks = tokio::task::JoinSet::new();
    for upload_number in 0..48_u16 {
        let (store, id) = (Arc::clone(&store), id.clone());
        // every content is pushed twice
        tasks.spawn(async move { push(&store, &id, "r1", upload_number / 2, at(0)).await });
    }
    let added = tasks.join_all().await;
    assert_eq!(added.iter().filter(|added| added.created).count(), 24);
    let maps = store.list_maps(&id, None, &Page::first(100)).await.expect("a list");
    let sequences: BTreeSet<u32> = maps.iter().map(|map| map.sequence).collect();
    assert_eq!(sequences, (1..=24).collect());
    assert_eq!(store.list_jobs(&id, &Page::first(9)).await.expect("a list").len(), 1);
}
