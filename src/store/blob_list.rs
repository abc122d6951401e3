//! All blobs, and the end of single ones.

use futures_util::stream::BoxStream;
use futures_util::{StreamExt, TryStreamExt};
use object_store::{ObjectMeta, ObjectStoreExt, path};

use super::blobs::place;
use super::error::Part;
use super::{Blobs, StoreError};
use crate::model::{BlobKey, Timestamp};

/// What lies where blobs are kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Kept {
    /// Its place.
    pub place: String,
    /// The blob that this is the place of; none for what is no blob of ours.
    pub key: Option<BlobKey>,
    /// Its size.
    pub bytes: u64,
    /// When it was last written.
    pub written_at: Timestamp,
}

impl Blobs {
    /// Everything that is kept, in no order.
    #[must_use]
    pub fn list(&self) -> BoxStream<'_, Result<Kept, StoreError>> {
        let all = self.objects.list(Some(&path::Path::from("sha256")));
        all.map_err(|error| Part::Blobs.unavailable(error))
            .map_ok(|object| kept(&object))
            .boxed()
    }

    /// Removes a blob; one that is gone already is no error.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    pub async fn remove(&self, key: BlobKey) -> Result<(), StoreError> {
        match self.objects.delete(&place(key)).await {
            Ok(()) | Err(object_store::Error::NotFound { .. }) => Ok(()),
            Err(error) => Err(Part::Blobs.unavailable(error)),
        }
    }
}

fn kept(object: &ObjectMeta) -> Kept {
    let place = object.location.to_string();
    Kept {
        key: BlobKey::at(&place),
        place,
        bytes: object.size,
        // out of the range of a time that can be told: as old as can be
        written_at: Timestamp::from_microsecond(object.last_modified.timestamp_micros()).unwrap_or(Timestamp::MIN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;

    #[tokio::test]
    async fn everything_that_is_kept_is_listed_and_single_blobs_go() {
        let folder = tempfile::tempdir().expect("a folder");
        let blobs = Blobs::open_folder(folder.path()).expect("opens");
        let mut keys = Vec::new();
        for bytes in ["abc", "de"] {
            keys.push(blobs.put(Bytes::from_static(bytes.as_bytes())).await.expect("is kept"));
        }
        std::fs::write(folder.path().join("sha256/stray"), b"x").expect("is written");
        let mut all: Vec<Kept> = blobs.list().try_collect().await.expect("a list");
        all.sort_by_key(|kept| kept.bytes);
        let found: Vec<_> = all.iter().map(|kept| (kept.key, kept.bytes)).collect();
        assert_eq!(found, [(None, 1), (Some(keys[1]), 2), (Some(keys[0]), 3)]);
        for _ in 0..2 {
            blobs.remove(keys[0]).await.expect("goes, and may be gone");
        }
        assert!(blobs.get(keys[0]).await.is_err() && blobs.get(keys[1]).await.is_ok());
    }
}
