//! An S3 bucket as the place of blobs.

use std::sync::Arc;
use std::time::Duration;

use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::prefix::PrefixStore;
use object_store::{BackoffConfig, ClientConfigKey, ClientOptions, ObjectStore, RetryConfig};

use super::error::Part;
use crate::store::StoreError;

/// Longest time for a connection to be made.
const CONNECT: Duration = Duration::from_secs(3);
/// Longest time without a byte of an answer.
const SILENCE: Duration = Duration::from_secs(10);
/// Longest time for one blob to be written or read: the largest maps are some hundred megabytes.
const WHOLE: Duration = Duration::from_mins(2);
/// A request is sent again within this time, so that a hiccup of the bucket is no refusal of ours, and an outage is soon.
const RETRY: Duration = Duration::from_secs(4);

/// The bucket, with keys that begin with `prefix` (may be empty). `settings` are the usual variables by their names:
/// `AWS_ENDPOINT_URL`, `AWS_REGION`, `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY` and the others that `object_store`
/// knows; what it does not know is left alone, because other programs' settings begin with `AWS_` too.
///
/// # Errors
/// [`StoreError::Unavailable`] when the settings do not fit together.
pub(super) fn bucket(
    bucket: &str,
    prefix: &str,
    settings: impl IntoIterator<Item = (String, String)>,
) -> Result<Arc<dyn ObjectStore>, StoreError> {
    let mut options = ClientOptions::new()
        .with_connect_timeout(CONNECT)
        .with_read_timeout(SILENCE)
        .with_timeout(WHOLE);
    let mut builder = AmazonS3Builder::new();
    for (name, value) in settings {
        let Ok(key) = name.to_ascii_lowercase().parse::<AmazonS3ConfigKey>() else {
            continue;
        };
        let endpoint = matches!(key, AmazonS3ConfigKey::Endpoint | AmazonS3ConfigKey::S3Endpoint);
        if endpoint && value.starts_with("http://") {
            // who writes http:// has said it
            options = options.with_allow_http(true);
        }
        match key {
            AmazonS3ConfigKey::Client(ClientConfigKey::AllowHttp) if value != "true" => {}
            AmazonS3ConfigKey::Client(key) => options = options.with_config(key, value),
            // the place names the bucket
            AmazonS3ConfigKey::Bucket => {}
            key => builder = builder.with_config(key, value),
        }
    }
    let objects = builder
        .with_bucket_name(bucket)
        .with_client_options(options)
        .with_retry(RetryConfig {
            backoff: BackoffConfig {
                init_backoff: Duration::from_millis(100),
                max_backoff: Duration::from_secs(1),
                base: 2.0,
            },
            max_retries: 5,
            retry_timeout: RETRY,
        })
        .build()
        .map_err(|error| Part::Blobs.unavailable(error))?;
    Ok(if prefix.is_empty() {
        Arc::new(objects)
    } else {
        Arc::new(PrefixStore::new(objects, prefix))
    })
}
