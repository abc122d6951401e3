//! Keeping house: labels to find sessions by, versions that are kept, blobs that are removed.

use std::num::NonZeroU32;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::prelude::*;
use mapweld::model::LabelFilter;
use mapweld::store::{BlobMark, MARK_HOLD, NewVersion, Pruned};

pub(crate) async fn sessions_are_found_by_their_labels(store: AnyStore) {
    for (name, labels) in [
        ("a", r#"{"floor":"2","site":"north \"old\" wing"}"#),
        ("b", r#"{"floor":"3"}"#),
        ("c", "{}"),
        ("d", r#"{"floor":"2"}"#),
    ] {
        let settings: SessionSettings = serde_json::from_str(&format!(r#"{{"labels":{labels}}}"#)).expect("settings");
        store
            .create_session(&session(name), &settings, at(0))
            .await
            .expect("is made");
    }
    let found = async |labels: &[&str], page: Page<SessionId>| {
        let filter = LabelFilter::parse(labels.iter().copied()).expect("labels");
        let sessions = store.list_sessions(&filter, &page).await.expect("a list");
        sessions
            .iter()
            .map(|session| session.id.to_string())
            .collect::<Vec<_>>()
    };
    assert_eq!(found(&[], Page::first(9)).await, ["a", "b", "c", "d"]);
    assert_eq!(found(&["floor=2"], Page::first(9)).await, ["a", "d"]);
    assert_eq!(found(&["floor"], Page::first(9)).await, ["a", "b", "d"]);
    assert_eq!(
        found(&["floor", "site=north \"old\" wing"], Page::first(9)).await,
        ["a"]
    );
    assert_eq!(found(&["floor=2", "site=south"], Page::first(9)).await, [""; 0]);
    let after = Page {
        after: Some(session("a")),
        size: 1,
    };
    assert_eq!(found(&["floor=2"], after).await, ["d"]);
}

async fn publish(store: &AnyStore, id: &SessionId, inputs: &[MapRecord]) {
    enqueue(store, id, at(0)).await;
    let held = claim(store, at(0)).await;
    store
        .publish_version(&held.lease, new_version(inputs), at(1))
        .await
        .expect("is published");
}

async fn numbers(store: &AnyStore, id: &SessionId) -> Vec<u32> {
    let versions = store.list_versions(id, &Page::first(99)).await.expect("a list");
    versions.iter().map(|version| version.number.get()).collect()
}

async fn sequences(store: &AnyStore, id: &SessionId) -> Vec<u32> {
    let maps = store.list_maps(id, None, &Page::first(99)).await.expect("a list");
    maps.iter().map(|map| map.sequence).collect()
}

pub(crate) async fn old_versions_go_with_the_maps_that_only_they_were_made_of(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    for seed in 1..=4 {
        let map = push(&store, &id, "r1", seed, at(0)).await.map;
        publish(&store, &id, &[map]).await;
    }
    let keep = NonZeroU32::new(2);
    assert_eq!(
        store.prune(None).await.expect("answers"),
        Pruned::default(),
        "all stay when nobody says"
    );
    let pruned = store.prune(keep).await.expect("answers");
    assert_eq!((pruned.versions, pruned.maps), (2, 2));
    assert_eq!(
        (numbers(&store, &id).await, sequences(&store, &id).await),
        (vec![4, 3], vec![4, 3])
    );
    assert_eq!(store.prune(keep).await.expect("answers"), Pruned::default());
    // numbers go on where they were
    publish(&store, &id, &[]).await;
    assert_eq!(numbers(&store, &id).await, [5, 4, 3]);

    // what the session says goes before what the server says
    let patch: SessionPatch = serde_json::from_str(r#"{"keep_versions":1}"#).expect("a patch");
    let patched = store.patch_session(&id, patch, at(2)).await.expect("is patched");
    assert_eq!(patched.settings.keep_versions, NonZeroU32::new(1));
    assert_eq!(store.get_session(&id).await.expect("is there"), patched);
    assert_eq!(store.prune(NonZeroU32::new(9)).await.expect("answers").versions, 2);
    assert_eq!(numbers(&store, &id).await, [5]);
}

pub(crate) async fn ended_jobs_go_when_they_are_old_unless_their_version_is_kept(store: AnyStore) {
    let id = session("ward");
    let mut publishers = Vec::new();
    for (seed, now) in [(1, 0), (2, 2)] {
        let added = push(&store, &id, "r1", seed, at(now)).await;
        let publisher = claim(&store, at(now)).await;
        store
            .publish_version(&publisher.lease, new_version(&[added.map]), at(now + 1))
            .await
            .expect("is published");
        publishers.push(publisher.job.id);
    }
    let cancelled = enqueue(&store, &id, at(3)).await;
    store.cancel_job(cancelled.id, at(4)).await.expect("is cancelled");
    let late = enqueue(&store, &id, at(5)).await;
    store.cancel_job(late.id, at(50)).await.expect("is cancelled");
    let running = enqueue(&store, &id, at(6)).await;
    claim(&store, at(7)).await;
    let waiting = enqueue(&store, &id, at(8)).await;

    assert_eq!(
        store.prune_jobs(at(4)).await.expect("answers"),
        0,
        "it ended at 4, not before"
    );
    assert_eq!(store.prune_jobs(at(50)).await.expect("answers"), 1);
    match store.get_job(cancelled.id).await {
        Err(StoreError::NotFound(Missing::Job(gone))) => assert_eq!(gone, cancelled.id),
        other => panic!("it is gone, but the answer was {other:?}"),
    }
    for kept in [publishers[0], publishers[1], late.id, running.id, waiting.id] {
        assert_eq!(job(&store, kept).await.id, kept);
    }
    // the job of a version goes when the version has gone
    store.prune(NonZeroU32::new(1)).await.expect("answers");
    assert_eq!(store.prune_jobs(at(50)).await.expect("answers"), 1);
    assert!(store.get_job(publishers[0]).await.is_err());
    assert_eq!(job(&store, publishers[1]).await.state, JobState::Succeeded);
}

pub(crate) async fn maps_that_a_merge_may_still_take_stay(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let first = push(&store, &id, "r1", 1, at(0)).await.map;
    publish(&store, &id, &[]).await;
    publish(&store, &id, std::slice::from_ref(&first)).await;
    // one that a merge under way has taken, and one that came since
    let taken = push(&store, &id, "r1", 2, at(0)).await.map;
    enqueue(&store, &id, at(0)).await;
    let held = claim(&store, at(0)).await;
    push(&store, &id, "r1", 3, at(0)).await;
    push(&store, &id, "never-merged", 4, at(0)).await;
    let pruned = store.prune(NonZeroU32::new(1)).await.expect("answers");
    assert_eq!((pruned.versions, pruned.maps), (1, 0));
    store
        .publish_version(&held.lease, new_version(&[taken]), at(1))
        .await
        .expect("its maps are there");
    let pruned = store.prune(NonZeroU32::new(1)).await.expect("answers");
    assert_eq!(
        (pruned.versions, pruned.maps),
        (1, 1),
        "the map of the version that went"
    );
}

fn blob(name: &str) -> BlobKey {
    BlobKey::of(name.as_bytes())
}

fn naming(id: &SessionId, blob: BlobKey) -> AddMap {
    let mut add = upload(id, "r1", 1);
    add.map.blob = blob;
    add
}

pub(crate) async fn only_blobs_that_no_record_names_are_marked(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    store
        .add_map_and_enqueue(naming(&id, blob("cells")), at(0))
        .await
        .expect("is added");
    publish(&store, &id, &[]).await;
    let all = ["cells", "grid", "png", "overlay", "nobody's"].map(blob);
    let marked = store.mark_unneeded(&all, at(5)).await.expect("answers");
    assert_eq!(marked, [blob("nobody's")]);
    let mark = |removed_at| {
        Some(BlobMark {
            marked_at: at(5),
            removed_at,
        })
    };
    assert_eq!(store.blob_mark(blob("nobody's")).await.expect("answers"), mark(None));
    assert_eq!(store.blob_mark(blob("cells")).await.expect("answers"), None);
    store.blobs_are_gone(&marked, at(6)).await.expect("is noted");
    assert_eq!(
        store.blob_mark(blob("nobody's")).await.expect("answers"),
        mark(Some(at(6)))
    );
    store.delete_session(&id).await.expect("is deleted");
    assert_eq!(store.mark_unneeded(&all, at(7)).await.expect("answers"), all);
}

pub(crate) async fn a_record_that_names_a_marked_blob_is_refused_whole(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let removed = |error: StoreError| match error {
        StoreError::BlobRemoved(blob) => blob,
        other => panic!("refused for its blob, not: {other:?}"),
    };
    store
        .mark_unneeded(&["cells", "png"].map(blob), at(0))
        .await
        .expect("answers");
    let refused = store.add_map_and_enqueue(naming(&id, blob("cells")), at(1)).await;
    assert_eq!(removed(refused.expect_err("refused")), blob("cells"));
    assert_eq!(sequences(&store, &id).await, [0; 0]);
    enqueue(&store, &id, at(0)).await;
    let held = claim(&store, at(0)).await;
    let new = NewVersion {
        anchor: robot("r9"),
        reanchors: true,
        ..new_version(&[])
    };
    let refused = store.publish_version(&held.lease, new, at(1)).await;
    assert_eq!(removed(refused.expect_err("refused")), blob("png"));
    assert_eq!(job(&store, held.job.id).await.state, JobState::Running);
    assert_eq!(store.get_session(&id).await.expect("is there").settings.anchor, None);
    assert_eq!(numbers(&store, &id).await, [0; 0]);
}

pub(crate) async fn a_mark_is_taken_away_only_by_who_saw_it_as_it_is(store: AnyStore) {
    let blobs = [blob("cells")];
    store.mark_unneeded(&blobs, at(0)).await.expect("answers");
    let seen = store.blob_mark(blobs[0]).await.expect("answers").expect("a mark");
    assert!(!seen.is_over(at(59)) && seen.is_over(at(0) + MARK_HOLD));
    store.blobs_are_gone(&blobs, at(1)).await.expect("is noted");
    assert!(
        !store.unmark_blob(blobs[0], seen).await.expect("answers"),
        "it is another mark now"
    );
    let gone = store.blob_mark(blobs[0]).await.expect("answers").expect("a mark");
    assert!(gone.is_over(at(1)));
    assert!(store.unmark_blob(blobs[0], gone).await.expect("answers"));
    assert_eq!(store.blob_mark(blobs[0]).await.expect("answers"), None);
    assert!(!store.unmark_blob(blobs[0], gone).await.expect("answers"));
    store.blobs_are_gone(&blobs, at(2)).await.expect("nothing to note");
    assert_eq!(store.blob_mark(blobs[0]).await.expect("answers"), None);

    store.mark_unneeded(&blobs, at(10)).await.expect("answers");
    store.forget_marks(at(10)).await.expect("answers");
    assert!(
        store.blob_mark(blobs[0]).await.expect("answers").is_some(),
        "not old enough"
    );
    store.forget_marks(at(11)).await.expect("answers");
    assert_eq!(store.blob_mark(blobs[0]).await.expect("answers"), None);
}

/// While a blob is marked no record names it, however many are added at the same time. Both go on until each has come
/// before the other often enough.
pub(crate) async fn marks_and_records_never_meet_halfway(store: AnyStore) {
    const ADDERS: u64 = 4;
    const OFTEN: usize = 20;
    const PATIENCE: Duration = Duration::from_mins(1);
    let key = blob("cells");
    let ids: Vec<SessionId> = (0..ADDERS).map(|adder| session(&format!("s{adder}"))).collect();
    let added = Arc::new(AtomicUsize::new(0));
    let mut adders = tokio::task::JoinSet::new();
    for (adder, id) in (0..ADDERS).zip(ids.clone()) {
        let (store, added) = (Arc::clone(&store), Arc::clone(&added));
        adders.spawn(async move {
            for round in 0_u64.. {
                let mut add = naming(&id, key);
                add.create_session = Some(SessionSettings {
                    auto_merge: false,
                    ..SessionSettings::default()
                });
                match store.add_map_and_enqueue(add, at(0)).await {
                    Ok(_) => {
                        added.fetch_add(1, Ordering::Relaxed);
                        store.delete_session(&id).await.expect("is deleted");
                    }
                    Err(StoreError::BlobRemoved(_)) => {}
                    Err(error) => panic!("{error}"),
                }
                // out of step: adders that take turns leave no moment without a record
                tokio::time::sleep(Duration::from_millis(round % (adder + 2))).await;
            }
        });
    }
    let (mut marked, mut named) = (0, 0);
    let sweeping = async {
        while marked < OFTEN || named < OFTEN || added.load(Ordering::Relaxed) < OFTEN {
            if store.mark_unneeded(&[key], at(0)).await.expect("answers").is_empty() {
                named += 1;
                continue;
            }
            marked += 1;
            for id in &ids {
                let records = store
                    .list_maps(id, None, &Page::first(9))
                    .await
                    .map_or(0, |maps| maps.len());
                assert_eq!(records, 0, "a record names the blob of mark {marked}");
            }
            let mark = store.blob_mark(key).await.expect("answers").expect("it is marked");
            assert!(store.unmark_blob(key, mark).await.expect("answers"));
        }
    };
    tokio::select! {
        () = sweeping => {}
        Some(ended) = adders.join_next() => panic!("an adder ended: {ended:?}"),
        () = tokio::time::sleep(PATIENCE) => {
            panic!("they never met: {marked} marks, {named} refused, {} records", added.load(Ordering::Relaxed))
        }
    }
}
