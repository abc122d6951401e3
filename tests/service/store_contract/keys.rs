//! Keys of callers.

use mapweld::model::{ApiKey, KeyId, KeyName, Scope, ShownKey};

use super::prelude::*;
use mapweld::clock::{Ids, SystemIds};

pub(crate) fn new_key(scope: Scope, created_at: Timestamp) -> (ShownKey, ApiKey) {
    let id = KeyId::new(SystemIds.next());
    let mut secret = [0; 32];
    secret[..16].copy_from_slice(id.uuid().as_bytes());
    let shown = ShownKey::new(id, secret);
    let kept = ApiKey {
        id,
        name: KeyName::parse("crane 7").expect("a name"),
        scope,
        digest: shown.digest(),
        created_at,
        expires_at: None,
        revoked_at: None,
    };
    (shown, kept)
}

async fn add(store: &AnyStore, scope: Scope) -> ApiKey {
    let (_, key) = new_key(scope, at(0));
    store.add_key(&key).await.expect("is kept");
    key
}

pub(crate) async fn a_key_is_found_by_its_id_as_it_was_made(store: AnyStore) {
    let robots = Scope::Robot {
        session: session("ward"),
        robot: robot("r1"),
    };
    for scope in [Scope::Admin, Scope::Operator, robots, Scope::Read] {
        let (_, mut key) = new_key(scope, at(1));
        key.expires_at = Some(at(50));
        store.add_key(&key).await.expect("is kept");
        assert_eq!(store.find_key(key.id).await.expect("answers"), Some(key));
    }
}

pub(crate) async fn a_key_that_is_not_there_is_not_found_and_not_revoked(store: AnyStore) {
    let (_, key) = new_key(Scope::Read, at(0));
    assert_eq!(store.find_key(key.id).await.expect("answers"), None);
    match store.revoke_key(key.id, at(1)).await {
        Err(StoreError::NotFound(Missing::Key(id))) => assert_eq!(id, key.id),
        other => panic!("it is not there, but the answer was {other:?}"),
    }
}

pub(crate) async fn keys_are_listed_oldest_first_page_after_page(store: AnyStore) {
    let mut made = Vec::new();
    for _ in 0..3 {
        made.push(add(&store, Scope::Read).await);
    }
    let first = store.list_keys(&Page::first(2)).await.expect("a list");
    assert_eq!(first, made[..2]);
    let rest = Page {
        after: Some(made[1].id),
        size: 2,
    };
    assert_eq!(store.list_keys(&rest).await.expect("a list"), made[2..]);
}

pub(crate) async fn a_revoked_key_is_kept_and_stays_revoked_since_the_first_time(store: AnyStore) {
    let key = add(&store, Scope::Operator).await;
    let first = store.revoke_key(key.id, at(5)).await.expect("is revoked");
    assert_eq!(first.revoked_at, Some(at(5)));
    let again = store.revoke_key(key.id, at(9)).await.expect("is revoked");
    assert_eq!(again, first);
    assert_eq!(store.find_key(key.id).await.expect("answers"), Some(first));
}

pub(crate) async fn a_store_has_keys_from_the_first_one_on_also_when_all_are_revoked(store: AnyStore) {
    assert!(!store.has_keys().await.expect("answers"));
    let key = add(&store, Scope::Admin).await;
    assert!(store.has_keys().await.expect("answers"));
    store.revoke_key(key.id, at(1)).await.expect("is revoked");
    assert!(store.has_keys().await.expect("answers"));
}
