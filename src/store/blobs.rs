//! Blobs: bytes kept under their own digest, for good.

use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use object_store::local::LocalFileSystem;
use object_store::{ObjectStore, ObjectStoreExt, PutPayload, path};

use super::error::Part;
use super::{Missing, StoreError, s3};
use crate::model::BlobKey;

/// Where blobs are kept: immutable, each under the SHA-256 of its bytes, checked when it is read.
#[derive(Debug, Clone)]
pub struct Blobs {
    pub(super) objects: Arc<dyn ObjectStore>,
}

impl Blobs {
    /// Blobs in a folder, which is made if it is not there.
    ///
    /// # Errors
    /// When the folder cannot be made.
    pub fn open_folder(folder: &Path) -> Result<Self, StoreError> {
        std::fs::create_dir_all(folder).map_err(|error| Part::Blobs.unavailable(error))?;
        let files = LocalFileSystem::new_with_prefix(folder)
            .map_err(|error| Part::Blobs.unavailable(error))?
            .with_fsync(true);
        Ok(Self::over(Arc::new(files)))
    }

    /// Blobs in an S3 bucket, under keys that begin with `prefix` (may be empty). `settings` are the usual variables by
    /// their names: `AWS_ENDPOINT_URL`, `AWS_REGION`, `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY` and others.
    ///
    /// # Errors
    /// When the settings do not fit together.
    pub fn open_bucket(
        bucket: &str,
        prefix: &str,
        settings: impl IntoIterator<Item = (String, String)>,
    ) -> Result<Self, StoreError> {
        Ok(Self::over(s3::bucket(bucket, prefix, settings)?))
    }

    /// Blobs in any object store that is durable when it says so.
    pub fn over(objects: Arc<dyn ObjectStore>) -> Self {
        Self { objects }
    }

    /// Keeps these bytes. They are durable when this returns.
    ///
    /// Bytes that are there already are written again: whoever wrote them may not have come to its fsync yet.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    pub async fn put(&self, bytes: Bytes) -> Result<BlobKey, StoreError> {
        let (key, bytes) = hashed(bytes).await?;
        self.put_hashed(key, bytes).await?;
        Ok(key)
    }

    /// Keeps bytes whose digest is known.
    pub(super) async fn put_hashed(&self, key: BlobKey, bytes: Bytes) -> Result<(), StoreError> {
        self.objects
            .put(&place(key), PutPayload::from_bytes(bytes))
            .await
            .map_err(|error| Part::Blobs.unavailable(error))?;
        Ok(())
    }

    /// The bytes that were kept under this key.
    ///
    /// # Errors
    /// [`StoreError::NotFound`], [`StoreError::Damaged`] when the bytes are not those that were kept, or
    /// [`StoreError::Unavailable`].
    pub async fn get(&self, key: BlobKey) -> Result<Bytes, StoreError> {
        let failed = |error: object_store::Error| match error {
            object_store::Error::NotFound { .. } => StoreError::NotFound(Missing::Blob(key)),
            error => Part::Blobs.unavailable(error),
        };
        let object = self.objects.get(&place(key)).await.map_err(failed)?;
        let (found, bytes) = hashed(object.bytes().await.map_err(failed)?).await?;
        if found != key {
            return Err(Part::Blobs.damaged(format!("blob {key} has the content of {found}")));
        }
        Ok(bytes)
    }
}

pub(super) fn place(key: BlobKey) -> path::Path {
    path::Path::from(key.to_string())
}

/// Megabytes are not hashed on a thread that serves requests.
pub(super) async fn hashed(bytes: Bytes) -> Result<(BlobKey, Bytes), StoreError> {
    tokio::task::spawn_blocking(move || (BlobKey::of(&bytes), bytes))
        .await
        .map_err(|error| Part::Blobs.unavailable(error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_blob_is_read_back_under_the_digest_of_its_bytes() {
        let folder = tempfile::tempdir().expect("a folder");
        let key = Blobs::open_folder(folder.path())
            .expect("opens")
            .put(Bytes::from_static(b"abc"))
            .await
            .expect("is kept");
        assert_eq!(key, BlobKey::of(b"abc"));
        let again = Blobs::open_folder(folder.path()).expect("opens again");
        assert_eq!(again.put(Bytes::from_static(b"abc")).await.expect("is kept again"), key);
        assert_eq!(again.get(key).await.expect("is there"), "abc");
    }

    #[tokio::test]
    async fn a_blob_that_was_changed_on_disk_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let blobs = Blobs::open_folder(folder.path()).expect("opens");
        let key = blobs.put(Bytes::from_static(b"abc")).await.expect("is kept");
        std::fs::write(folder.path().join(key.to_string()), b"abd").expect("is changed");
        assert!(matches!(blobs.get(key).await, Err(StoreError::Damaged(_))));
    }

    #[tokio::test]
    async fn a_blob_that_was_never_kept_is_not_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let blobs = Blobs::open_folder(folder.path()).expect("opens");
        let key = BlobKey::of(b"nothing");
        assert!(matches!(blobs.get(key).await, Err(StoreError::NotFound(Missing::Blob(missing))) if missing == key));
    }
}
