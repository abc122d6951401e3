//! Named changes: they take effect once.

use mapweld::model::CallName;
use mapweld::store::{Attempt, Begun, Call, CallEnd, KeptAnswer, KeptHeader};

use super::prelude::*;
use mapweld::clock::{Ids, SystemIds};

/// A request under `name` with this body, entered at `now` seconds: the name is held for 60 s and kept for a day.
fn call(owner: &str, name: &str, body: &str, now: i64) -> Call {
    Call {
        owner: owner.to_owned(),
        name: CallName::parse(name).expect("a name"),
        target: "POST /v1/sessions/ward/merges".to_owned(),
        digest: Digest::of_bytes(body.as_bytes()),
        makes: SystemIds.next(),
        lease_until: at(now + 60),
        expires_at: at(now + 86_400),
    }
}

fn answer() -> KeptAnswer {
    KeptAnswer {
        status: 202,
        headers: vec![KeptHeader("location".to_owned(), "/v1/jobs/7".to_owned())],
        body: r#"{"id":"7","title":"Süd \u0000"}"#.to_owned(),
    }
}

async fn begin(store: &AnyStore, call: &Call, now: i64) -> Begun {
    store.begin_call(call, at(now)).await.expect("the store answers")
}

async fn begun(store: &AnyStore, call: &Call, now: i64) -> Attempt {
    match begin(store, call, now).await {
        Begun::Now(attempt) => attempt,
        other => panic!("it shall take effect, but the answer was {other:?}"),
    }
}

pub(crate) async fn a_named_change_takes_effect_once_and_its_answer_is_given_again(store: AnyStore) {
    let first = call("anyone", "a", "{}", 0);
    let attempt = begun(&store, &first, 0).await;
    assert_eq!(attempt.makes, first.makes);
    store.keep_answer(&attempt, &answer()).await.expect("is kept");
    for now in [1, 90, 86_399] {
        let again = begin(&store, &call("anyone", "a", "{}", now), now).await;
        assert_eq!(again, Begun::Answered(answer()), "after {now} s");
    }
}

pub(crate) async fn a_name_stands_for_one_request_while_it_is_under_way_and_after(store: AnyStore) {
    let attempt = begun(&store, &call("anyone", "a", "{}", 0), 0).await;
    let elsewhere = Call {
        target: "POST /v1/sessions/hall/merges".to_owned(),
        ..call("anyone", "a", "{}", 1)
    };
    for answered in [false, true] {
        if answered {
            store.keep_answer(&attempt, &answer()).await.expect("is kept");
        } else {
            let same = begin(&store, &call("anyone", "a", "{}", 1), 1).await;
            assert_eq!(same, Begun::UnderWay);
        }
        let other = begin(&store, &call("anyone", "a", "[]", 1), 1).await;
        assert_eq!(other, Begun::OtherRequest);
        assert_eq!(begin(&store, &elsewhere, 1).await, Begun::OtherRequest);
    }
}

pub(crate) async fn names_are_each_owners_own(store: AnyStore) {
    let mine = begun(&store, &call("anyone", "a", "{}", 0), 0).await;
    let theirs = begun(&store, &call("0193", "a", "[]", 0), 0).await;
    store.keep_answer(&mine, &answer()).await.expect("is kept");
    let again = begin(&store, &call("0193", "a", "[]", 1), 1).await;
    assert_eq!(again, Begun::UnderWay, "of {theirs:?}");
}

pub(crate) async fn an_attempt_that_was_lost_is_followed_by_one_that_makes_the_same(store: AnyStore) {
    let lost = begun(&store, &call("anyone", "a", "{}", 0), 0).await;
    assert_eq!(begin(&store, &call("anyone", "a", "{}", 59), 59).await, Begun::UnderWay);
    let next = begun(&store, &call("anyone", "a", "{}", 60), 60).await;
    assert_eq!(next.makes, lost.makes);
    assert!(next.token > lost.token);
    // the lost one was only slow: it takes nothing away, and its answer is as good
    store
        .end_call(&lost, CallEnd::Refused, at(61))
        .await
        .expect("the store answers");
    assert_eq!(begin(&store, &call("anyone", "a", "{}", 61), 61).await, Begun::UnderWay);
    store.keep_answer(&lost, &answer()).await.expect("is kept");
    let other = KeptAnswer {
        status: 200,
        ..answer()
    };
    store.keep_answer(&next, &other).await.expect("the store answers");
    let again = begin(&store, &call("anyone", "a", "{}", 62), 62).await;
    assert_eq!(again, Begun::Answered(answer()), "the first one stays");
}

pub(crate) async fn a_refused_change_gives_its_name_back_and_an_unsure_one_keeps_its_id(store: AnyStore) {
    let refused = begun(&store, &call("anyone", "a", "{}", 0), 0).await;
    store
        .end_call(&refused, CallEnd::Refused, at(1))
        .await
        .expect("the store answers");
    let other = call("anyone", "a", "[]", 1);
    let unsure = begun(&store, &other, 1).await;
    assert_eq!(unsure.makes, other.makes);
    store
        .end_call(&unsure, CallEnd::Unknown, at(2))
        .await
        .expect("the store answers");
    assert_eq!(
        begin(&store, &call("anyone", "a", "{}", 2), 2).await,
        Begun::OtherRequest
    );
    let next = begun(&store, &call("anyone", "a", "[]", 2), 2).await;
    assert_eq!(next.makes, unsure.makes);
}

pub(crate) async fn a_name_is_free_again_when_it_has_expired_swept_or_not(store: AnyStore) {
    for name in ["a", "b"] {
        let attempt = begun(&store, &call("anyone", name, "{}", 0), 0).await;
        store.keep_answer(&attempt, &answer()).await.expect("is kept");
    }
    // an answer does not wait for the lease of the attempt that gave it
    let brief = Call {
        expires_at: at(5),
        ..call("anyone", "c", "{}", 0)
    };
    let attempt = begun(&store, &brief, 0).await;
    assert_eq!(store.forget_calls(at(5)).await.expect("sweeps"), 0, "it is under way");
    store.keep_answer(&attempt, &answer()).await.expect("is kept");
    let anew = begun(&store, &call("anyone", "c", "[]", 5), 5).await;
    assert_ne!(anew.makes, attempt.makes);

    let other = call("anyone", "a", "[]", 86_400);
    let anew = begun(&store, &other, 86_400).await;
    assert_eq!(anew.makes, other.makes);
    assert_eq!(
        begin(&store, &call("anyone", "a", "[]", 86_401), 86_401).await,
        Begun::UnderWay,
        "nothing of the old answer is left"
    );
    assert_eq!(store.forget_calls(at(86_399)).await.expect("sweeps"), 0);
    assert_eq!(
        store.forget_calls(at(86_400)).await.expect("sweeps"),
        1,
        "b alone: a is under way, c new"
    );
    store.keep_answer(&anew, &answer()).await.expect("is kept");
    assert_eq!(
        begin(&store, &call("anyone", "a", "[]", 86_402), 86_402).await,
        Begun::Answered(answer())
    );
}

pub(crate) async fn of_many_that_come_at_once_under_one_name_one_takes_effect(store: AnyStore) {
    let mut tasks = tokio::task::JoinSet::new();
    for _ in 0..16 {
        let (store, call) = (Arc::clone(&store), call("anyone", "a", "{}", 0));
        tasks.spawn(async move { begin(&store, &call, 0).await });
    }
    let all = tasks.join_all().await;
    let now = all.iter().filter(|begun| matches!(begun, Begun::Now(_))).count();
    let under_way = all.iter().filter(|begun| **begun == Begun::UnderWay).count();
    assert_eq!((now, under_way), (1, 15), "{all:?}");
}

pub(crate) async fn a_job_or_a_constraint_that_is_made_again_is_the_one_that_is_there(store: AnyStore) {
    let ward = quiet_session(&store, "ward").await;
    let id = job_id();
    let first = store
        .enqueue_merge(&ward, id, AskedMerge::default(), at(1))
        .await
        .expect("is queued");
    let claimed = claim(&store, at(2)).await;
    let again = store
        .enqueue_merge(&ward, id, AskedMerge::default(), at(3))
        .await
        .expect("is there");
    assert_eq!((again.id, again.state), (first.id, JobState::Running));
    store
        .finish_cancelled(&claimed.lease, at(4))
        .await
        .expect("the lease holds");
    nothing_to_claim(&store, at(5)).await;

    let constraint = Constraint {
        id: ConstraintId::new(SystemIds.next()),
        session: ward.clone(),
        rule: Rule::Apart(Apart {
            robots: [robot("r1"), robot("r2")],
        }),
        author: None,
        note: None,
        created_at: at(1),
    };
    let made = store.add_constraint(constraint.clone()).await.expect("stands");
    let later = Constraint {
        created_at: at(9),
        ..constraint
    };
    assert_eq!(store.add_constraint(later).await.expect("stands"), made);
    let standing = store.list_constraints(&ward, &Page::first(9)).await.expect("a list");
    assert_eq!(standing, [made]);
}
