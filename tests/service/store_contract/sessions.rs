//! Sessions.

use super::prelude::*;
use mapweld::model::LabelFilter;

// Sessions

pub(crate) async fn making_a_session_again_with_the_same_settings_answers_the_one_that_is_there(store: AnyStore) {
    let settings = SessionSettings::default();
    let first = store
        .create_session(&session("ward"), &settings, at(0))
        .await
        .expect("is made");
    assert!(first.created);
    push(&store, &session("ward"), "r1", 1, at(1)).await;
    let again = store
        .create_session(&session("ward"), &settings, at(2))
        .await
        .expect("is there");
    assert!(
        !again.created,
        "an anchor that the first push chose is no other setting"
    );
    assert_eq!(again.value.created_at, at(0));
    assert_eq!(
        again.value,
        store.get_session(&session("ward")).await.expect("is there")
    );
}

pub(crate) async fn making_a_session_again_with_other_settings_is_refused(store: AnyStore) {
    quiet_session(&store, "ward").await;
    let answer = store
        .create_session(&session("ward"), &SessionSettings::default(), at(1))
        .await;
    assert!(matches!(answer, Err(StoreError::SessionExists(id)) if id == session("ward")));
}

pub(crate) async fn a_session_that_is_not_there_is_not_found_by_any_door(store: AnyStore) {
    let id = session("nowhere");
    let missing = |error: StoreError| matches!(error, StoreError::NotFound(Missing::Session(_)));
    assert!(missing(store.get_session(&id).await.expect_err("no session")));
    let patch = SessionPatch::default();
    assert!(missing(
        store.patch_session(&id, patch, at(0)).await.expect_err("no session")
    ));
    assert!(missing(store.delete_session(&id).await.expect_err("no session")));
    assert!(missing(store.list_robots(&id).await.expect_err("no session")));
    assert!(missing(
        store
            .list_maps(&id, None, &Page::first(9))
            .await
            .expect_err("no session")
    ));
    assert!(missing(store.newest_maps(&id).await.expect_err("no session")));
    assert!(missing(
        store.list_jobs(&id, &Page::first(9)).await.expect_err("no session")
    ));
    assert!(missing(
        store.list_versions(&id, &Page::first(9)).await.expect_err("no session")
    ));
    let latest = store.get_version(&id, VersionSelector::Latest).await;
    assert!(missing(latest.expect_err("no session")));
    let merge = store.enqueue_merge(&id, job_id(), AskedMerge::default(), at(0)).await;
    assert!(missing(merge.expect_err("no session")));
    assert!(matches!(
        store.get_job(job_id()).await,
        Err(StoreError::NotFound(Missing::Job(_)))
    ));
    assert!(matches!(
        store.cancel_job(job_id(), at(0)).await,
        Err(StoreError::NotFound(Missing::Job(_)))
    ));
}

pub(crate) async fn a_patch_changes_what_it_names_and_when_the_session_changed(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let patch: SessionPatch =
        serde_json::from_str(r#"{"title":"Ward 3","labels":{"floor":"2"},"resolution":0.1,"anchor":"r7"}"#)
            .expect("a patch");
    let patched = store.patch_session(&id, patch, at(5)).await.expect("is patched");
    assert_eq!(patched.settings.anchor, Some(robot("r7")));
    assert!(!patched.settings.auto_merge, "what is not named stays");
    assert_eq!((patched.created_at, patched.updated_at), (at(0), at(5)));
    assert_eq!(store.get_session(&id).await.expect("is there"), patched);
}

pub(crate) async fn sessions_are_listed_by_name_page_after_page(store: AnyStore) {
    for name in ["c", "a", "b"] {
        quiet_session(&store, name).await;
    }
    let names = |page: Vec<Session>| page.into_iter().map(|s| s.id.to_string()).collect::<Vec<_>>();
    let first = store
        .list_sessions(&LabelFilter::default(), &Page::first(2))
        .await
        .expect("a list");
    assert_eq!(names(first), ["a", "b"]);
    let page = Page {
        after: Some(session("b")),
        size: 2,
    };
    assert_eq!(
        names(
            store
                .list_sessions(&LabelFilter::default(), &page)
                .await
                .expect("a list")
        ),
        ["c"]
    );
}

pub(crate) async fn names_are_ordered_byte_by_byte_whatever_the_database_thinks_of_hyphens(store: AnyStore) {
    for name in ["ab", "a-c", "a", "a1"] {
        quiet_session(&store, name).await;
    }
    let mut seen = Vec::new();
    let mut after = None;
    loop {
        let page = Page { after, size: 1 };
        let Some(next) = store
            .list_sessions(&LabelFilter::default(), &page)
            .await
            .expect("a list")
            .pop()
        else {
            break;
        };
        seen.push(next.id.to_string());
        after = Some(next.id);
    }
    assert_eq!(seen, ["a", "a-c", "a1", "ab"]);
}

pub(crate) async fn a_deleted_session_takes_everything_with_it_and_its_runner_loses_the_lease(store: AnyStore) {
    let id = session("ward");
    let map = push(&store, &id, "r1", 1, at(0)).await.map;
    let first = claim(&store, at(0)).await;
    store
        .publish_version(&first.lease, new_version(&[map]), at(1))
        .await
        .expect("is published");
    push(&store, &id, "r1", 2, at(2)).await;
    let second = claim(&store, at(2)).await;
    store.delete_session(&id).await.expect("is deleted");
    is_lost(
        store.publish_version(&second.lease, new_version(&[]), at(3)).await,
        &second.lease,
    );
    let renewed = store
        .renew_lease(&second.lease, LEASE, &ProgressReport::default(), at(3))
        .await;
    is_lost(renewed, &second.lease);
    assert!(store.get_job(first.job.id).await.is_err());
    push(&store, &id, "r2", 1, at(4)).await;
    assert_eq!(
        store.list_maps(&id, None, &Page::first(9)).await.expect("a list").len(),
        1
    );
    assert_eq!(store.list_versions(&id, &Page::first(9)).await.expect("a list"), []);
}
