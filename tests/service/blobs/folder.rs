//! A folder keeps the contract, and what only a folder promises.

use bytes::Bytes;
use mapweld::store::{Blobs, StoreError};

use super::{Place, contract};

async fn fresh() -> Place {
    let folder = tempfile::tempdir().expect("a folder");
    Place {
        blobs: Blobs::open_folder(folder.path()).expect("opens"),
        behind: folder.path().to_owned(),
        _keep: Box::new(folder),
    }
}

contract!(fresh);

#[tokio::test]
async fn a_folder_that_cannot_be_written_to_is_unavailable() {
    let place = fresh().await;
    let bytes = Bytes::from_static(b"cells");
    // a file stands where the folder of the blob would be made
    std::fs::write(place.behind.join("sha256"), b"in the way").expect("is written");
    let answer = place.blobs.put(bytes.clone()).await;
    assert!(matches!(answer, Err(StoreError::Unavailable(_))), "{answer:?}");
    std::fs::remove_file(place.behind.join("sha256")).expect("is removed");
    place.blobs.put(bytes).await.expect("is kept");
}
