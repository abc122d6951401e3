//! Maps, and the jobs that uploads ask for.

use super::prelude::*;

// Maps

pub(crate) async fn a_map_is_read_back_as_it_was_added(store: AnyStore) {
    let mut add = upload(&session("ward"), "r1", 7);
    add.map.frame_id = Some("r1/map".to_owned());
    add.map.warnings = vec!["alpha below 255 was read as unknown".to_owned()];
    let added = store.add_map_and_enqueue(add.clone(), at(3)).await.expect("is added");
    assert!(added.created);
    assert_eq!(
        (added.map.id, &added.map.map, added.map.sequence),
        (add.id, &add.map, 1)
    );
    assert_eq!((added.map.job, added.map.received_at), (Some(add.job), at(3)));
    let read = store.get_map(&session("ward"), add.id).await.expect("is there");
    assert_eq!(read, added.map);
    let elsewhere = store.get_map(&session("other"), add.id).await;
    assert!(matches!(elsewhere, Err(StoreError::NotFound(Missing::Map(..)))));
}

pub(crate) async fn a_map_of_an_unknown_session_makes_it_only_when_asked_to(store: AnyStore) {
    let mut add = upload(&session("ward"), "r1", 1);
    add.create_session = None;
    let answer = store.add_map_and_enqueue(add.clone(), at(0)).await;
    assert!(matches!(answer, Err(StoreError::NotFound(Missing::Session(_)))));
    add.create_session = Some(SessionSettings::default());
    store.add_map_and_enqueue(add, at(1)).await.expect("is added");
    assert_eq!(
        store.get_session(&session("ward")).await.expect("was made").created_at,
        at(1)
    );
}

pub(crate) async fn the_first_robot_to_push_becomes_the_anchor_unless_one_was_named(store: AnyStore) {
    push(&store, &session("a"), "r2", 1, at(0)).await;
    push(&store, &session("a"), "r1", 1, at(0)).await;
    let anchor = |session: Session| session.settings.anchor;
    assert_eq!(
        anchor(store.get_session(&session("a")).await.expect("is there")),
        Some(robot("r2"))
    );
    let settings = SessionSettings {
        anchor: Some(robot("r9")),
        ..SessionSettings::default()
    };
    store
        .create_session(&session("b"), &settings, at(0))
        .await
        .expect("is made");
    push(&store, &session("b"), "r1", 1, at(0)).await;
    assert_eq!(
        anchor(store.get_session(&session("b")).await.expect("is there")),
        Some(robot("r9"))
    );
}

pub(crate) async fn the_same_content_from_the_same_robot_again_is_the_same_map_and_causes_no_job(store: AnyStore) {
    let id = session("ward");
    let first = push(&store, &id, "r1", 1, at(0)).await;
    push(&store, &id, "r1", 2, at(1)).await;
    let running = claim(&store, at(2)).await;
    store
        .publish_version(&running.lease, new_version(&[]), at(3))
        .await
        .expect("is published");
    let again = push(&store, &id, "r1", 1, at(4)).await;
    assert!(!again.created);
    assert_eq!(again.map, first.map, "with the job that took it in");
    nothing_to_claim(&store, at(1000)).await;
}

pub(crate) async fn the_same_content_from_another_robot_is_another_map(store: AnyStore) {
    let first = push(&store, &session("ward"), "r1", 1, at(0)).await;
    let second = push(&store, &session("ward"), "r2", 1, at(0)).await;
    assert!(second.created);
    assert_ne!(first.map.id, second.map.id);
}

pub(crate) async fn the_newest_map_of_each_robot_is_the_one_of_its_highest_sequence(store: AnyStore) {
    let id = session("ward");
    push(&store, &id, "r2", 1, at(0)).await;
    let newest_1 = push(&store, &id, "r1", 2, at(1)).await.map;
    push(&store, &id, "r2", 3, at(2)).await;
    let newest_2 = push(&store, &id, "r2", 4, at(2)).await.map;
    assert_eq!(newest_2.sequence, 3);
    let newest = store.newest_maps(&id).await.expect("a list");
    assert_eq!(newest, [newest_1.clone(), newest_2.clone()], "ordered by robot");
    let robots = store.list_robots(&id).await.expect("a list");
    let told: Vec<_> = robots
        .iter()
        .map(|r| (r.robot.as_str(), r.maps, r.newest, r.newest_at))
        .collect();
    assert_eq!(told, [("r1", 1, newest_1.id, at(1)), ("r2", 3, newest_2.id, at(2))]);
}

pub(crate) async fn maps_are_listed_newest_first_page_after_page_and_by_robot(store: AnyStore) {
    let id = session("ward");
    let mut ids = Vec::new();
    for seed in 1..=4 {
        let robot = if seed % 2 == 0 { "r2" } else { "r1" };
        ids.push(push(&store, &id, robot, seed, at(seed.into())).await.map.id);
    }
    ids.reverse();
    let of = |maps: Vec<MapRecord>| maps.into_iter().map(|map| map.id).collect::<Vec<_>>();
    let first = of(store.list_maps(&id, None, &Page::first(3)).await.expect("a list"));
    assert_eq!(first, ids[..3]);
    let rest = Page {
        after: first.last().copied(),
        size: 3,
    };
    assert_eq!(of(store.list_maps(&id, None, &rest).await.expect("a list")), ids[3..]);
    let of_r2 = store
        .list_maps(&id, Some(&robot("r2")), &Page::first(9))
        .await
        .expect("a list");
    assert_eq!(of(of_r2), [ids[0], ids[2]]);
}

// What uploads ask for

pub(crate) async fn uploads_while_a_job_waits_share_it(store: AnyStore) {
    let id = session("ward");
    let first = push(&store, &id, "r1", 1, at(0)).await.map.job;
    assert!(first.is_some());
    for seed in 2..=9 {
        assert_eq!(push(&store, &id, "r2", seed, at(1)).await.map.job, first);
    }
    assert_eq!(store.list_jobs(&id, &Page::first(9)).await.expect("a list").len(), 1);
}

pub(crate) async fn uploads_while_a_job_runs_cause_exactly_one_more(store: AnyStore) {
    let id = session("ward");
    let first = push(&store, &id, "r1", 1, at(0)).await.map.job;
    let running = claim(&store, at(1)).await;
    assert_eq!(Some(running.job.id), first);
    let second = push(&store, &id, "r1", 2, at(2)).await.map.job;
    assert_ne!(second, first);
    for seed in 3..=9 {
        assert_eq!(push(&store, &id, "r2", seed, at(2)).await.map.job, second);
    }
    store
        .publish_version(&running.lease, new_version(&[]), at(3))
        .await
        .expect("is published");
    assert_eq!(Some(claim(&store, at(3)).await.job.id), second);
    assert_eq!(store.list_jobs(&id, &Page::first(9)).await.expect("a list").len(), 2);
}

pub(crate) async fn a_session_that_does_not_merge_by_itself_gets_no_job(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    assert_eq!(push(&store, &id, "r1", 1, at(0)).await.map.job, None);
    nothing_to_claim(&store, at(1000)).await;
}

pub(crate) async fn a_full_queue_of_a_session_refuses_the_job_and_the_map_that_needs_it(store: AnyStore) {
    let id = session("ward");
    store
        .create_session(&id, &SessionSettings::default(), at(0))
        .await
        .expect("is made");
    for _ in 0..LIMITS.per_session {
        enqueue(&store, &id, at(0)).await;
    }
    let merge = store.enqueue_merge(&id, job_id(), AskedMerge::default(), at(0)).await;
    assert!(matches!(
        merge,
        Err(StoreError::QueueFull {
            scope: QueueScope::Session(_),
            queued: 3,
            limit: 3
        })
    ));
    let map = store.add_map_and_enqueue(upload(&id, "r1", 1), at(0)).await;
    assert!(matches!(map, Err(StoreError::QueueFull { .. })));
    assert_eq!(store.list_maps(&id, None, &Page::first(9)).await.expect("a list"), []);
    let anchor = store.get_session(&id).await.expect("is there").settings.anchor;
    assert_eq!(anchor, None, "a refused upload leaves no trace");
}

pub(crate) async fn a_full_queue_of_the_service_refuses_too(store: AnyStore) {
    for name in ["a", "b"] {
        let id = quiet_session(&store, name).await;
        enqueue(&store, &id, at(0)).await;
        enqueue(&store, &id, at(0)).await;
    }
    push(&store, &session("c"), "r1", 1, at(0)).await;
    let answer = store.add_map_and_enqueue(upload(&session("d"), "r1", 1), at(0)).await;
    assert!(matches!(
        answer,
        Err(StoreError::QueueFull {
            scope: QueueScope::Total,
            queued: 5,
            limit: 5
        })
    ));
    assert!(
        store.get_session(&session("d")).await.is_err(),
        "the session was not made either"
    );
}

pub(crate) async fn an_upload_that_joins_a_waiting_job_needs_no_room_in_the_queue(store: AnyStore) {
    let id = session("ward");
    let first = push(&store, &id, "r1", 1, at(0)).await;
    for _ in 1..LIMITS.per_session {
        enqueue(&store, &id, at(0)).await;
    }
    assert_eq!(push(&store, &id, "r2", 2, at(1)).await.map.job, first.map.job);
}
