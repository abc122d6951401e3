//! What every place of blobs promises, kept by a folder and by an S3 bucket. Each clause is a plain function of a fresh
//! place.

pub(crate) mod bucket;
mod folder;

use std::any::Any;
use std::path::PathBuf;

use bytes::Bytes;
use mapweld::model::BlobKey;
use mapweld::store::{Blobs, Missing, StoreError};
use tokio::task::JoinSet;

/// A place of blobs, and the folder in which whoever keeps them keeps them.
pub(crate) struct Place {
    pub(crate) blobs: Blobs,
    /// Below it a file under each blob's key.
    pub(crate) behind: PathBuf,
    pub(crate) _keep: Box<dyn Any + Send>,
}

/// A test of every clause, each on a place of its own that `$fresh` makes: `async fn() -> Place`.
macro_rules! contract {
    ($fresh:path) => {
        contract!(@ $fresh,
            a_blob_is_read_back_as_it_was_kept_under_the_digest_of_its_bytes,
            the_same_bytes_again_are_the_same_blob,
            a_blob_that_was_never_kept_is_not_found,
            a_blob_that_was_changed_or_cut_short_behind_our_back_is_refused,
            a_blob_that_was_damaged_is_whole_again_when_it_is_kept_again,
            many_at_once_keep_the_same_and_different_blobs,
        );
    };
    (@ $fresh:path, $($clause:ident,)*) => {
        $(
            #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $clause() {
                $crate::blobs::$clause($fresh().await).await;
            }
        )*
    };
}
pub(crate) use contract;

pub(crate) async fn a_blob_is_read_back_as_it_was_kept_under_the_digest_of_its_bytes(place: Place) {
    let large: Vec<u8> = (0..6_000_000_u32)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect();
    for bytes in [Bytes::new(), Bytes::from_static(b"cells"), Bytes::from(large)] {
        let key = place.blobs.put(bytes.clone()).await.expect("is kept");
        assert_eq!(key, BlobKey::of(&bytes));
        assert_eq!(place.blobs.get(key).await.expect("is there"), bytes);
        let file = std::fs::read(place.behind.join(key.to_string())).expect("a file under its key");
        assert_eq!(file, bytes, "kept as it is");
    }
}

pub(crate) async fn the_same_bytes_again_are_the_same_blob(place: Place) {
    let bytes = Bytes::from_static(b"cells");
    let first = place.blobs.put(bytes.clone()).await.expect("is kept");
    assert_eq!(place.blobs.put(bytes.clone()).await.expect("is kept again"), first);
    assert_eq!(place.blobs.get(first).await.expect("is there"), bytes);
}

pub(crate) async fn a_blob_that_was_never_kept_is_not_found(place: Place) {
    let key = BlobKey::of(b"nothing");
    let answer = place.blobs.get(key).await;
    assert!(matches!(answer, Err(StoreError::NotFound(Missing::Blob(missing))) if missing == key));
}

pub(crate) async fn a_blob_that_was_changed_or_cut_short_behind_our_back_is_refused(place: Place) {
    let key = place.blobs.put(Bytes::from_static(b"cells")).await.expect("is kept");
    for spoiled in [&b"cellt"[..], b"cell", b""] {
        std::fs::write(place.behind.join(key.to_string()), spoiled).expect("is spoiled");
        let answer = place.blobs.get(key).await;
        assert!(matches!(answer, Err(StoreError::Damaged(_))), "{answer:?}");
    }
}

pub(crate) async fn a_blob_that_was_damaged_is_whole_again_when_it_is_kept_again(place: Place) {
    let bytes = Bytes::from_static(b"cells");
    let key = place.blobs.put(bytes.clone()).await.expect("is kept");
    std::fs::write(place.behind.join(key.to_string()), b"cellt").expect("is spoiled");
    place.blobs.put(bytes.clone()).await.expect("is kept again");
    assert_eq!(place.blobs.get(key).await.expect("is there"), bytes);
}

pub(crate) async fn many_at_once_keep_the_same_and_different_blobs(place: Place) {
    let mut tasks = JoinSet::new();
    for number in 0..48_u8 {
        let blobs = place.blobs.clone();
        tasks.spawn(async move {
            let bytes = Bytes::from(vec![number / 3; 40_000]);
            let key = blobs.put(bytes.clone()).await.expect("is kept");
            assert_eq!(blobs.get(key).await.expect("is there"), bytes);
            key
        });
    }
    let keys: std::collections::BTreeSet<_> = tasks.join_all().await.into_iter().collect();
    assert_eq!(keys.len(), 16);
}
