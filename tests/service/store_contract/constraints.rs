//! What operators say: standing constraints, versions that are repeated, anchors that are moved.

use super::prelude::*;
use mapweld::clock::{Ids, SystemIds};
use mapweld::model::{Author, Note};

fn constraint(session: &SessionId, rule: Rule, now: Timestamp) -> Constraint {
    Constraint {
        id: ConstraintId::new(SystemIds.next()),
        session: session.clone(),
        rule,
        author: Some(Author::parse("Ada").expect("a name")),
        note: Some(Note::parse("seen on site").expect("a note")),
        created_at: now,
    }
}

fn fixed(robot_name: &str, base: &str) -> Rule {
    Rule::Fixed(Fixed {
        robot: robot(robot_name),
        relative_to: robot(base),
        pose: Pose {
            x: 1.25,
            y: -0.1,
            yaw: 0.3,
        },
        accepted: None,
    })
}

fn apart(a: &str, b: &str) -> Rule {
    Rule::Apart(Apart {
        robots: [robot(a), robot(b)],
    })
}

async fn add(store: &AnyStore, constraint: Constraint) -> Constraint {
    store.add_constraint(constraint).await.expect("stands")
}

async fn all(store: &AnyStore, id: &SessionId) -> Vec<Constraint> {
    store.list_constraints(id, &Page::first(999)).await.expect("a list")
}

pub(crate) async fn a_constraint_stands_until_it_is_removed(store: AnyStore) {
    let mut changes = store.changes();
    let id = quiet_session(&store, "ward").await;
    let other = quiet_session(&store, "yard").await;
    let first = add(&store, constraint(&id, fixed("r2", "r1"), at(1))).await;
    // What a store tells may come after the call that caused it has returned: the two sessions are told of first.
    for of in [&id, &other, &id] {
        let heard = tokio::time::timeout(Duration::from_secs(10), changes.recv()).await;
        assert_eq!(
            heard.expect("in time").expect("not lagging"),
            Change::Session(of.clone())
        );
    }
    let second = add(&store, constraint(&id, apart("r3", "r1"), at(2))).await;
    assert_eq!(all(&store, &id).await, [first.clone(), second.clone()]);
    let page = Page {
        after: Some(first.id),
        size: 1,
    };
    let rest = store.list_constraints(&id, &page).await.expect("a list");
    assert_eq!(rest, std::slice::from_ref(&second));
    assert_eq!(store.get_constraint(&id, first.id).await.expect("stands"), first);

    let missing = |error: StoreError| matches!(error, StoreError::NotFound(Missing::Constraint(..)));
    assert!(missing(
        store
            .get_constraint(&other, first.id)
            .await
            .expect_err("another session's")
    ));
    assert!(missing(
        store
            .remove_constraint(&other, first.id)
            .await
            .expect_err("another session's")
    ));
    store.remove_constraint(&id, first.id).await.expect("goes");
    assert!(missing(
        store.remove_constraint(&id, first.id).await.expect_err("is gone")
    ));
    assert_eq!(all(&store, &id).await, [second]);
}

pub(crate) async fn constraints_that_cannot_hold_at_once_are_refused_and_change_nothing(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let first = add(&store, constraint(&id, fixed("r2", "r1"), at(1))).await;
    let clash = |error: StoreError| match error {
        StoreError::Clash(clash) => clash,
        other => panic!("a clash, not {other:?}"),
    };
    let twice = store.add_constraint(constraint(&id, fixed("r1", "r2"), at(2))).await;
    assert_eq!(
        clash(twice.expect_err("refused")),
        Clash::FixedTwice(robot("r1"), robot("r2"))
    );
    let kept_apart = store.add_constraint(constraint(&id, apart("r1", "r2"), at(2))).await;
    assert_eq!(
        clash(kept_apart.expect_err("refused")),
        Clash::FixedAndApart(robot("r1"), robot("r2"))
    );
    assert_eq!(all(&store, &id).await, [first]);
}

pub(crate) async fn a_session_has_a_limited_number_of_constraints(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    for number in 0..Constraint::COUNT_MAX {
        add(&store, constraint(&id, apart("r1", &format!("x{number}")), at(1))).await;
    }
    let one_more = store.add_constraint(constraint(&id, apart("r1", "r2"), at(2))).await;
    assert!(matches!(
        one_more,
        Err(StoreError::TooManyConstraints {
            limit: Constraint::COUNT_MAX,
            ..
        })
    ));
}

pub(crate) async fn constraints_go_with_their_session(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let gone = add(&store, constraint(&id, apart("r1", "r2"), at(1))).await;
    store.delete_session(&id).await.expect("is deleted");
    let missing = store.list_constraints(&id, &Page::first(9)).await;
    assert!(matches!(missing, Err(StoreError::NotFound(Missing::Session(_)))));
    quiet_session(&store, "ward").await;
    assert_eq!(all(&store, &id).await, []);
    assert!(store.get_constraint(&id, gone.id).await.is_err());
    let nowhere = store
        .add_constraint(constraint(&session("nowhere"), apart("r1", "r2"), at(1)))
        .await;
    assert!(matches!(nowhere, Err(StoreError::NotFound(Missing::Session(_)))));
}

pub(crate) async fn a_version_that_repeats_an_earlier_one_says_which(store: AnyStore) {
    let id = quiet_session(&store, "ward").await;
    let mut published = Vec::new();
    for restored_from in [None, VersionNumber::new(1)] {
        enqueue(&store, &id, at(0)).await;
        let held = claim(&store, at(0)).await;
        let new = mapweld::store::NewVersion {
            restored_from,
            ..new_version(&[])
        };
        published.push(
            store
                .publish_version(&held.lease, new, at(1))
                .await
                .expect("is published"),
        );
    }
    assert_eq!(published[0].restored_from, None);
    assert_eq!(published[1].restored_from, VersionNumber::new(1));
    let latest = store.get_version(&id, VersionSelector::Latest).await.expect("is there");
    assert_eq!(latest, published[1]);
}

pub(crate) async fn a_version_that_moves_the_anchor_moves_that_of_its_session_in_one_step(store: AnyStore) {
    let id = session("ward");
    push(&store, &id, "r1", 1, at(0)).await;
    let held = claim(&store, at(0)).await;
    let new = || NewVersion {
        anchor: robot("r2"),
        reanchors: true,
        ..new_version(&[])
    };
    let lost = Lease {
        token: held.lease.token + 1,
        ..held.lease
    };
    is_lost(store.publish_version(&lost, new(), at(1)).await, &lost);
    let anchor = |session: Session| session.settings.anchor;
    let before = store.get_session(&id).await.expect("is there");
    assert_eq!(anchor(before), Some(robot("r1")));
    store
        .publish_version(&held.lease, new(), at(1))
        .await
        .expect("is published");
    let after = store.get_session(&id).await.expect("is there");
    assert_eq!((after.updated_at, anchor(after)), (at(1), Some(robot("r2"))));
}
