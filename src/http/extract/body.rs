//! Bodies, read whole, within their limits of size and time.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::body::{Body, HttpBody as _};
use axum::extract::{FromRequest, Request};
use axum::http::{HeaderMap, header};
use bytes::Bytes;
use futures_util::StreamExt;

use super::digest::ToldDigests;
use crate::api::{FieldError, ProblemCode};
use crate::http::error::{ApiError, ApiResult};
use crate::http::state::AppState;
use crate::meters;

/// The most that a body may be, and the longest that it may take to arrive.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyLimits {
    pub(super) bytes: u64,
    pub(super) time: Duration,
}

/// The body of an upload with its media type; counted against the bodies that the server holds at one time.
pub(in crate::http) struct UploadBody {
    pub(in crate::http) content_type: String,
    pub(in crate::http) bytes: Bytes,
    /// Frees the place of this upload when it is dropped: keep it until the upload is decoded.
    pub(in crate::http) place: tokio::sync::OwnedSemaphorePermit,
}

impl FromRequest<AppState> for UploadBody {
    type Rejection = ApiError;

    async fn from_request(mut request: Request, state: &AppState) -> ApiResult<Self> {
        if let Some(read) = request.extensions_mut().remove::<ReadUpload>() {
            return read.take();
        }
        let (parts, body) = request.into_parts();
        Self::read(&parts.headers, body, state).await
    }
}

impl UploadBody {
    /// Reads the body of a request with these headers.
    pub(in crate::http) async fn read(headers: &HeaderMap, body: Body, state: &AppState) -> ApiResult<Self> {
        let content_type = headers
            .get(header::CONTENT_TYPE)
            .and_then(|value| value.to_str().ok())
            .unwrap_or_default()
            .to_owned();
        let limits = BodyLimits {
            bytes: state.limits.body_bytes,
            time: state.limits.body_time,
        };
        refuse_encoded(headers)?;
        refuse_by_length(headers, limits.bytes)?;
        let digests = ToldDigests::of(headers)?;
        let place = state.uploads.clone().try_acquire_owned().map_err(|_| {
            meters::shed("uploads");
            ApiError::new(ProblemCode::Overloaded, "too many uploads at one time; try again")
        })?;
        let bytes = read_body(body, limits).await?;
        meters::upload_bytes(bytes.len());
        digests.check(&bytes).await?;
        Ok(Self {
            content_type,
            bytes,
            place,
        })
    }
}

/// An upload that was read before its handler's turn came: in the extensions of its request.
#[derive(Clone)]
pub(in crate::http) struct ReadUpload(Arc<Mutex<Option<UploadBody>>>);

impl ReadUpload {
    pub(in crate::http) fn new(upload: UploadBody) -> Self {
        Self(Arc::new(Mutex::new(Some(upload))))
    }

    fn take(self) -> ApiResult<UploadBody> {
        let mut upload = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        upload
            .take()
            .ok_or_else(|| ApiError::internal("an upload is taken twice"))
    }
}

/// The media type without its parameters, in lower case.
pub(in crate::http) fn media_type(content_type: &str) -> String {
    content_type
        .split(';')
        .next()
        .unwrap_or_default()
        .trim()
        .to_ascii_lowercase()
}

/// Refuses a body that says that it is compressed: none is unpacked, so none can unpack to more than it is.
pub(super) fn refuse_encoded(headers: &HeaderMap) -> ApiResult<()> {
    for value in headers.get_all(header::CONTENT_ENCODING) {
        let sent = value.to_str().unwrap_or("\u{fffd}");
        if !sent.trim().eq_ignore_ascii_case("identity") {
            let limit = "absent or identity; send the body as it is, pictures are compressed already";
            return Err(ApiError::new(
                ProblemCode::UnsupportedMediaType,
                format!("content-encoding is {sent:?}; it must be {limit}"),
            )
            .field(FieldError::new("content-encoding", sent, limit)));
        }
    }
    Ok(())
}

/// Refuses a body that announces itself as too long, before a byte of it is read.
pub(super) fn refuse_by_length(headers: &HeaderMap, limit: u64) -> ApiResult<()> {
    let announced = headers
        .get(header::CONTENT_LENGTH)
        .and_then(|value| value.to_str().ok()?.parse::<u64>().ok());
    match announced {
        Some(bytes) if bytes > limit => Err(too_large(bytes, limit)),
        _ => Ok(()),
    }
}

/// The whole body.
pub(super) async fn read_body(body: Body, limits: BodyLimits) -> ApiResult<Bytes> {
    tokio::time::timeout(limits.time, collect(body, limits.bytes))
        .await
        .map_err(|_| {
            let limit = format!("{} s", limits.time.as_secs_f64());
            ApiError::new(
                ProblemCode::BodyTimeout,
                format!("the body did not arrive within {limit}"),
            )
            .field(FieldError::missing("body", limit))
        })?
}

async fn collect(body: Body, limit: u64) -> ApiResult<Bytes> {
    let mut whole = Vec::new();
    // All at once where the length is known: a block that grows is copied, and is there twice meanwhile.
    let known = body.size_hint().lower().min(limit);
    usize::try_from(known)
        .ok()
        .and_then(|bytes| whole.try_reserve_exact(bytes).ok())
        .ok_or_else(|| {
            ApiError::new(
                ProblemCode::Overloaded,
                format!("there is no memory for a body of {known} bytes at present; try again"),
            )
        })?;
    let mut stream = body.into_data_stream();
    while let Some(chunk) = stream.next().await {
        let chunk = chunk.map_err(|error| {
            ApiError::new(
                ProblemCode::BadRequest,
                format!("the body breaks off or cannot be read: {error}"),
            )
        })?;
        let bytes = whole.len() as u64 + chunk.len() as u64;
        if bytes > limit {
            return Err(too_large(bytes, limit));
        }
        whole.extend_from_slice(&chunk);
    }
    Ok(whole.into())
}

fn too_large(bytes: u64, limit: u64) -> ApiError {
    let limit = format!("at most {limit} bytes");
    ApiError::new(
        ProblemCode::BodyTooLarge,
        format!("the body has {bytes} bytes or more; allowed are {limit}"),
    )
    .field(FieldError::new("body", format!("{bytes} bytes or more"), limit))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: BodyLimits = BodyLimits {
        bytes: 4,
        time: Duration::from_secs(5),
    };

    #[tokio::test]
    async fn a_body_of_the_limit_is_taken_and_one_byte_more_is_refused() {
        let read = read_body(Body::from("1234"), LIMITS).await.expect("four bytes");
        assert_eq!(&read[..], b"1234");
        assert!(read_body(Body::from("12345"), LIMITS).await.is_err());
    }

    #[tokio::test]
    async fn a_body_that_never_ends_is_given_up() {
        let never = Body::from_stream(futures_util::stream::pending::<Result<Bytes, std::io::Error>>());
        let limits = BodyLimits {
            time: Duration::from_millis(5),
            ..LIMITS
        };
        let error = read_body(never, limits).await.expect_err("a deadline");
        assert!(error.to_string().contains("did not arrive"));
    }

    #[test]
    fn a_compressed_body_is_refused_by_its_header() {
        let with = |encoding: &'static str| {
            let value = axum::http::HeaderValue::from_static(encoding);
            refuse_encoded(&HeaderMap::from_iter([(header::CONTENT_ENCODING, value)]))
        };
        assert!(with("Identity").is_ok() && refuse_encoded(&HeaderMap::new()).is_ok());
        for encoding in ["gzip", "identity, gzip", "br", ""] {
            let refused = with(encoding).expect_err(encoding).to_string();
            assert!(refused.contains("content-encoding"), "{refused}");
        }
    }

    #[test]
    fn parameters_of_a_media_type_do_not_count() {
        assert_eq!(media_type("Multipart/Form-Data; boundary=x"), "multipart/form-data");
    }
}
