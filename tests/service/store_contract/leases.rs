//! Claims, leases, and the fence around what a worker writes.

use super::prelude::*;

// Claim and lease

pub(crate) async fn nothing_to_do_is_no_claim(store: AnyStore) {
    nothing_to_claim(&store, at(0)).await;
}

pub(crate) async fn a_job_is_not_claimed_before_it_is_due_and_the_longest_due_comes_first(store: AnyStore) {
    let (a, b) = (quiet_session(&store, "a").await, quiet_session(&store, "b").await);
    let later = enqueue(&store, &a, at(20)).await;
    let sooner = enqueue(&store, &b, at(10)).await;
    nothing_to_claim(&store, at(9)).await;
    let first = claim(&store, at(30)).await;
    assert_eq!(first.job.id, sooner.id);
    assert_eq!(
        (first.job.state, first.job.attempt, first.job.started_at),
        (JobState::Running, 1, Some(at(30)))
    );
    assert_eq!(claim(&store, at(30)).await.job.id, later.id);
}

pub(crate) async fn a_claimed_job_is_not_claimed_again_while_its_lease_holds(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    claim(&store, at(0)).await;
    nothing_to_claim(&store, at(29)).await;
}

pub(crate) async fn jobs_of_one_session_run_one_after_the_other(store: AnyStore) {
    let (a, b) = (quiet_session(&store, "a").await, quiet_session(&store, "b").await);
    let first = enqueue(&store, &a, at(0)).await;
    let second = enqueue(&store, &a, at(1)).await;
    let other = enqueue(&store, &b, at(2)).await;
    let running = claim(&store, at(5)).await;
    assert_eq!(running.job.id, first.id);
    assert_eq!(
        claim(&store, at(5)).await.job.id,
        other.id,
        "another session does not wait"
    );
    nothing_to_claim(&store, at(6)).await;
    store
        .publish_version(&running.lease, new_version(&[]), at(7))
        .await
        .expect("is published");
    assert_eq!(claim(&store, at(7)).await.job.id, second.id);
}

pub(crate) async fn an_expired_lease_is_claimed_again_with_a_greater_token(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    let behind = enqueue(&store, &id, at(0)).await;
    let lost = claim(&store, at(0)).await;
    let again = claim(&store, at(30)).await;
    assert_eq!(again.job.id, lost.job.id, "the job behind it waits for it");
    assert_ne!(again.job.id, behind.id);
    assert!(again.lease.token > lost.lease.token);
    assert_eq!(again.job.attempt, 2);
}

pub(crate) async fn a_renewed_lease_does_not_expire(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    let held = claim(&store, at(0)).await;
    let report = ProgressReport::default();
    store
        .renew_lease(&held.lease, LEASE, &report, at(20))
        .await
        .expect("is renewed");
    nothing_to_claim(&store, at(49)).await;
    assert_eq!(claim(&store, at(50)).await.job.id, held.job.id);
}

pub(crate) async fn a_renewal_tells_progress_and_the_wish_to_cancel(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    let held = claim(&store, at(0)).await;
    let report = ProgressReport {
        stage: Some("register".to_owned()),
        progress: 0.25,
    };
    let renewed = store
        .renew_lease(&held.lease, LEASE, &report, at(1))
        .await
        .expect("is renewed");
    assert!(!renewed.cancel_requested);
    let seen = job(&store, held.job.id).await;
    assert_eq!(
        (seen.stage.as_deref(), seen.progress.to_bits()),
        (Some("register"), 0.25_f64.to_bits())
    );
    store.cancel_job(held.job.id, at(2)).await.expect("is asked");
    let renewed = store
        .renew_lease(&held.lease, LEASE, &report, at(3))
        .await
        .expect("is renewed");
    assert!(renewed.cancel_requested);
}

// The fence

pub(crate) async fn a_zombie_whose_job_was_claimed_again_can_write_nothing(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    let zombie = claim(&store, at(0)).await.lease;
    let alive = claim(&store, at(31)).await;
    let before = job(&store, zombie.job).await;
    let result = ResultText::parse("{}".to_owned()).expect("JSON");
    is_lost(store.publish_version(&zombie, new_version(&[]), at(32)).await, &zombie);
    is_lost(store.finish_dry_run(&zombie, &result, &[], at(32)).await, &zombie);
    is_lost(
        store
            .renew_lease(&zombie, LEASE, &ProgressReport::default(), at(32))
            .await,
        &zombie,
    );
    is_lost(
        store.fail_job(&zombie, &error("x"), Retry::Never, at(32)).await,
        &zombie,
    );
    is_lost(store.finish_cancelled(&zombie, at(32)).await, &zombie);
    is_lost(store.release_job(&zombie, at(32)).await, &zombie);
    assert_eq!(job(&store, zombie.job).await, before);
    assert_eq!(store.list_versions(&id, &Page::first(9)).await.expect("a list"), []);
    store
        .publish_version(&alive.lease, new_version(&[]), at(33))
        .await
        .expect("the lease is good");
    is_lost(store.publish_version(&zombie, new_version(&[]), at(34)).await, &zombie);
    assert_eq!(
        store.list_versions(&id, &Page::first(9)).await.expect("a list").len(),
        1
    );
}

pub(crate) async fn a_lease_that_expired_but_was_not_claimed_again_still_publishes(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    enqueue(&store, &id, at(0)).await;
    let slow = claim(&store, at(0)).await;
    store
        .publish_version(&slow.lease, new_version(&[]), at(100))
        .await
        .expect("nobody else has it");
}
