//! Keys, kept.

use async_trait::async_trait;

use super::{Page, StoreError};
use crate::model::{ApiKey, KeyId, Timestamp};

/// Where keys are kept: beside the other records, so that every replica knows them.
#[async_trait]
pub trait KeyStore: Send + Sync {
    /// Keeps a new key.
    async fn add_key(&self, key: &ApiKey) -> Result<(), StoreError>;

    /// The key of this id, good or not; `None` when there is none.
    async fn find_key(&self, id: KeyId) -> Result<Option<ApiKey>, StoreError>;

    /// All keys, good or not, the oldest first.
    async fn list_keys(&self, page: &Page<KeyId>) -> Result<Vec<ApiKey>, StoreError>;

    /// Takes a key back, from `now` on. One that was taken back before stays as it is.
    async fn revoke_key(&self, id: KeyId, now: Timestamp) -> Result<ApiKey, StoreError>;

    /// Whether a key was ever made, good or not.
    async fn has_keys(&self) -> Result<bool, StoreError>;
}
