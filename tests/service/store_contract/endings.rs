//! How jobs end: with a version, a failure, a cancellation, or back in the queue.

use super::prelude::*;

// Publishing

pub(crate) async fn publishing_makes_the_version_and_ends_the_job_in_one_step(store: AnyStore) {
    let id = session("ward");
    let map = push(&store, &id, "r1", 1, at(0)).await.map;
    let held = claim(&store, at(1)).await;
    let version = store
        .publish_version(&held.lease, new_version(&[map]), at(2))
        .await
        .expect("is published");
    let ended = job(&store, held.job.id).await;
    assert_eq!(
        (ended.state, ended.version, ended.finished_at),
        (JobState::Succeeded, Some(version.number), Some(at(2)))
    );
    assert_eq!(ended.progress.to_bits(), 1.0_f64.to_bits());
    is_lost(
        store.publish_version(&held.lease, new_version(&[]), at(3)).await,
        &held.lease,
    );
}

pub(crate) async fn versions_count_from_one_without_gaps_and_name_their_parent(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    for number in 1..=4 {
        enqueue(&store, &id, at(number)).await;
        let held = claim(&store, at(number)).await;
        if number == 2 {
            // an attempt that fails leaves no gap
            store
                .fail_job(&held.lease, &error("x"), Retry::Never, at(number))
                .await
                .expect("is failed");
            continue;
        }
        store
            .publish_version(&held.lease, new_version(&[]), at(number))
            .await
            .expect("is published");
    }
    let versions = store.list_versions(&id, &Page::first(9)).await.expect("a list");
    let told: Vec<_> = versions
        .iter()
        .map(|v| (v.number.get(), v.parent.map(VersionNumber::get)))
        .collect();
    assert_eq!(told, [(3, Some(2)), (2, Some(1)), (1, None)]);
    let page = Page {
        after: VersionNumber::new(3),
        size: 1,
    };
    assert_eq!(store.list_versions(&id, &page).await.expect("a list"), versions[1..2]);
}

pub(crate) async fn a_version_is_read_back_as_it_was_published(store: AnyStore) {
    let id = session("ward");
    let maps = [
        push(&store, &id, "r1", 1, at(0)).await.map,
        push(&store, &id, "r2", 2, at(0)).await.map,
    ];
    let held = claim(&store, at(1)).await;
    let new = new_version(&maps);
    let published = store
        .publish_version(&held.lease, new.clone(), at(2))
        .await
        .expect("is published");
    assert_eq!(
        (&published.inputs, &published.result, published.digest),
        (&new.inputs, &new.result, new.digest)
    );
    assert_eq!(
        (published.grid, published.png, published.overlay),
        (new.grid, new.png, new.overlay)
    );
    assert_eq!((published.job, published.created_at), (held.job.id, at(2)));
    for which in [VersionSelector::Latest, VersionSelector::Number(VersionNumber::FIRST)] {
        assert_eq!(store.get_version(&id, which).await.expect("is there"), published);
    }
    let second = VersionSelector::Number(VersionNumber::new(2).expect("above zero"));
    let answer = store.get_version(&id, second).await;
    assert!(matches!(answer, Err(StoreError::NotFound(Missing::Version(_, which))) if which == second));
}

pub(crate) async fn a_dry_run_ends_with_its_result_and_no_version(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let request = MergeRequest {
        dry_run: true,
        robots: Some(vec![robot("r1"), robot("r2")]),
        method: None,
        anchor: Some(robot("r1")),
        rules: vec![Rule::Apart(Apart {
            robots: [robot("r1"), robot("r2")],
        })],
        restore: None,
        author: None,
    };
    store
        .enqueue_merge(&id, job_id(), request.clone().into(), at(0))
        .await
        .expect("is queued");
    let held = claim(&store, at(1)).await;
    assert_eq!(held.job.request, request);
    let result = ResultText::parse(r#"{"a":1.50}"#.to_owned()).expect("JSON");
    store
        .finish_dry_run(&held.lease, &result, &[], at(2))
        .await
        .expect("is ended");
    let ended = job(&store, held.job.id).await;
    assert_eq!(
        (ended.state, ended.result, ended.version),
        (JobState::Succeeded, Some(result), None)
    );
    assert_eq!(store.list_versions(&id, &Page::first(9)).await.expect("a list"), []);
}

// Failing

pub(crate) async fn a_failed_attempt_waits_for_its_pause_and_runs_again(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    let held = claim(&store, at(0)).await;
    let retry = Retry::After(Duration::from_secs(10));
    let state = store
        .fail_job(&held.lease, &error("blob_missing"), retry, at(5))
        .await
        .expect("is failed");
    assert_eq!(state, JobState::Queued);
    let waiting = job(&store, held.job.id).await;
    assert_eq!(
        (waiting.error, waiting.run_after),
        (Some(error("blob_missing")), at(15))
    );
    nothing_to_claim(&store, at(14)).await;
    let again = claim(&store, at(15)).await;
    assert_eq!((again.job.id, again.job.attempt), (held.job.id, 2));
    store
        .publish_version(&again.lease, new_version(&[]), at(16))
        .await
        .expect("is published");
    assert_eq!(job(&store, held.job.id).await.error, None);
}

pub(crate) async fn a_job_that_would_fail_again_is_failed_at_once(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    let held = claim(&store, at(0)).await;
    let state = store
        .fail_job(&held.lease, &error("no_maps"), Retry::Never, at(1))
        .await
        .expect("is failed");
    assert_eq!(state, JobState::Failed);
    let ended = job(&store, held.job.id).await;
    assert_eq!((ended.state, ended.finished_at), (JobState::Failed, Some(at(1))));
    assert_eq!(ended.error, Some(error("no_maps")));
}

pub(crate) async fn a_job_out_of_attempts_is_failed_with_the_last_reason(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let asked = enqueue(&store, &id, at(0)).await;
    let mut state = JobState::Queued;
    for attempt in 1..=LIMITS.max_attempts {
        let now = at(i64::from(attempt));
        let held = claim(&store, now).await;
        let reason = error(&format!("attempt_{attempt}"));
        let retry = Retry::After(Duration::ZERO);
        state = store
            .fail_job(&held.lease, &reason, retry, now)
            .await
            .expect("is failed");
    }
    assert_eq!(state, JobState::Failed);
    assert_eq!(job(&store, asked.id).await.error, Some(error("attempt_3")));
    nothing_to_claim(&store, at(1000)).await;
}

pub(crate) async fn a_poison_job_that_takes_its_workers_with_it_is_parked_with_a_reason(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let poison = enqueue(&store, &id, at(0)).await;
    let behind = enqueue(&store, &id, at(1)).await;
    for attempt in 0..LIMITS.max_attempts {
        let lost = claim(&store, at(100 * i64::from(attempt) + 1)).await;
        assert_eq!(lost.job.id, poison.id);
    }
    let next = claim(&store, at(1000)).await;
    assert_eq!(next.job.id, behind.id);
    let parked = job(&store, poison.id).await;
    assert_eq!(
        (parked.state, parked.attempt, parked.finished_at),
        (JobState::Failed, 3, Some(at(1000)))
    );
    let reason = parked.error.expect("a reason");
    assert_eq!(reason.code, "worker_lost");
    assert!(reason.message.contains("attempt 3 of 3"), "{}", reason.message);
}

pub(crate) async fn a_released_job_is_due_at_once_and_its_attempt_does_not_count(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    for second in 1..=9 {
        let held = claim(&store, at(second)).await;
        assert_eq!(held.job.attempt, 1);
        store.release_job(&held.lease, at(second)).await.expect("is released");
        is_lost(
            store.publish_version(&held.lease, new_version(&[]), at(second)).await,
            &held.lease,
        );
    }
}

pub(crate) async fn a_job_that_goes_back_to_the_queue_leaves_the_key_to_the_one_that_came_meanwhile(store: AnyStore) {
    let id = session("ward");
    push(&store, &id, "r1", 1, at(0)).await;
    let held = claim(&store, at(1)).await;
    let second = push(&store, &id, "r1", 2, at(2)).await.map.job;
    store.release_job(&held.lease, at(3)).await.expect("is released");
    assert_eq!(push(&store, &id, "r1", 3, at(4)).await.map.job, second);
    // alone in the queue, a job that went back is shared like any other
    let other = session("other");
    let alone = push(&store, &other, "r1", 1, at(0)).await.map.job;
    let held = store
        .claim_job("w", LEASE, at(0))
        .await
        .expect("answers")
        .expect("is due");
    assert_eq!(Some(held.job.id), alone);
    store.release_job(&held.lease, at(1)).await.expect("is released");
    assert_eq!(push(&store, &other, "r1", 2, at(2)).await.map.job, alone);
}

// Cancelling

pub(crate) async fn cancelling_ends_a_waiting_job_and_asks_a_running_one(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let waiting = enqueue(&store, &id, at(0)).await;
    let cancelled = store.cancel_job(waiting.id, at(1)).await.expect("is cancelled");
    assert_eq!(
        (cancelled.state, cancelled.finished_at),
        (JobState::Cancelled, Some(at(1)))
    );
    nothing_to_claim(&store, at(1)).await;
    enqueue(&store, &id, at(2)).await;
    let held = claim(&store, at(2)).await;
    let asked = store.cancel_job(held.job.id, at(3)).await.expect("is asked");
    assert_eq!((asked.state, asked.cancel_requested), (JobState::Running, true));
    store.finish_cancelled(&held.lease, at(4)).await.expect("ends");
    assert_eq!(job(&store, held.job.id).await.state, JobState::Cancelled);
}

pub(crate) async fn a_cancelled_runner_ends_as_cancelled_however_it_leaves(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    for way in 0..3 {
        let asked = enqueue(&store, &id, at(way)).await;
        let lease = claim(&store, at(way)).await.lease;
        store.cancel_job(asked.id, at(way)).await.expect("is asked");
        let retry = if way == 0 {
            Retry::Never
        } else {
            Retry::After(Duration::ZERO)
        };
        match way {
            2 => store.release_job(&lease, at(way)).await.expect("is released"),
            _ => drop(
                store
                    .fail_job(&lease, &error("x"), retry, at(way))
                    .await
                    .expect("is failed"),
            ),
        }
        assert_eq!(job(&store, asked.id).await.state, JobState::Cancelled);
    }
}

pub(crate) async fn a_job_whose_worker_was_lost_after_a_cancel_is_cancelled_not_run_again(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    let lost = claim(&store, at(0)).await;
    store.cancel_job(lost.job.id, at(1)).await.expect("is asked");
    nothing_to_claim(&store, at(31)).await;
    assert_eq!(job(&store, lost.job.id).await.state, JobState::Cancelled);
}

pub(crate) async fn an_ended_job_stays_as_it_is(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    let held = claim(&store, at(0)).await;
    store
        .publish_version(&held.lease, new_version(&[]), at(1))
        .await
        .expect("is published");
    let ended = job(&store, held.job.id).await;
    assert_eq!(store.cancel_job(held.job.id, at(2)).await.expect("answers"), ended);
    nothing_to_claim(&store, at(1000)).await;
}
