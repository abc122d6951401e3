//! `Idempotency-Key`: a change that its caller has named takes effect once, however often it is asked for.
//!
//! After the caller is known and before the handler: the body is read, the request is entered with its digest, and the
//! handler is given the id of what it shall make ([`NewId`]). An answer that tells of success is kept and given again; a
//! refusal gives the name back. See [`crate::store::CallStore`] for why nothing is made twice.

use std::time::Duration;

use axum::body::Body;
use axum::extract::{FromRequestParts, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use bytes::Bytes;
use jiff::SignedDuration;
use sha2::{Digest as _, Sha256};
use tracing::Instrument as _;
use uuid::Uuid;

use super::auth::{Caller, Route};
use super::error::{ApiError, ApiResult};
use super::extract::{ReadUpload, UploadBody, media_type, read_json, read_parts};
use super::state::AppState;
use crate::api::{FieldError, Job, ProblemCode};
use crate::failpoint::{self, Point};
use crate::meters;
use crate::model::{CallName, Digest};
use crate::store::{Attempt, Begun, Call, CallEnd, KeptAnswer, KeptHeader, StoreError};

/// The header that names a change.
pub(super) const IDEMPOTENCY_KEY: HeaderName = HeaderName::from_static("idempotency-key");
/// The header that says that an answer was given before.
pub(super) const IDEMPOTENCY_REPLAYED: HeaderName = HeaderName::from_static("idempotency-replayed");

/// The operations that can be named: all that POST something and change something by it.
const NAMED: [&str; 5] = ["create_session", "push_map", "merge", "add_constraint", "cancel_job"];

/// How long an attempt of which nothing is heard holds its name. Longer than anything takes between the body's last byte
/// and the answer, and no harm if it does not: both attempts make the same.
const LEASE: Duration = Duration::from_mins(1);
/// The longest answer that is kept; those of named operations are far shorter.
const ANSWER_BYTES_MAX: usize = 4 << 20;

/// Whether an operation's requests can be named.
pub(super) fn can_be_named(operation: &str) -> bool {
    NAMED.contains(&operation)
}

/// The id of what a request makes: that of an earlier attempt, or a new one.
pub(super) struct NewId(pub(super) Uuid);

/// In the extensions of a named request.
#[derive(Debug, Clone, Copy)]
struct Makes(Uuid);

impl FromRequestParts<AppState> for NewId {
    type Rejection = std::convert::Infallible;

    async fn from_request_parts(parts: &mut Parts, state: &AppState) -> Result<Self, Self::Rejection> {
        let makes = parts.extensions.get::<Makes>();
        Ok(Self(makes.map_or_else(|| state.ids.next(), |Makes(id)| *id)))
    }
}

/// Lets a named request take effect once.
pub(super) async fn once(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let operation = request.extensions().get::<Route>().map(|route| route.operation);
    let named = match operation {
        Some(operation) if can_be_named(operation) => name_of(request.headers()),
        _ => Ok(None),
    };
    match named {
        Ok(None) => next.run(request).await,
        Ok(Some(name)) => named_call(state, name, request, next)
            .await
            .unwrap_or_else(ApiError::into_response),
        Err(refusal) => refusal.into_response(),
    }
}

fn name_of(headers: &HeaderMap) -> ApiResult<Option<CallName>> {
    let mut values = headers.get_all(IDEMPOTENCY_KEY).iter();
    let Some(value) = values.next() else { return Ok(None) };
    let text = value.to_str().unwrap_or_default().trim();
    match (CallName::parse(text), values.next()) {
        (Ok(name), None) => Ok(Some(name)),
        (named, _) => {
            let limit = named.err().map_or_else(|| "there once".to_owned(), |error| error.limit);
            let header = IDEMPOTENCY_KEY;
            let field = header.as_str();
            Err(ApiError::new(
                ProblemCode::BadRequest,
                format!("{field} is {text:?}; it must be {limit}"),
            )
            .field(FieldError::new(field, text, limit)))
        }
    }
}

async fn named_call(state: AppState, name: CallName, request: Request, next: Next) -> ApiResult<Response> {
    let (request, digest) = read_whole(&state, request).await?;
    let owner = request.extensions().get::<Caller>().and_then(Caller::key);
    let now = state.clock.now();
    let after = |time: Duration| {
        let time = SignedDuration::try_from(time).unwrap_or(SignedDuration::MAX);
        now.saturating_add(time).unwrap_or(now)
    };
    let call = Call {
        owner: owner.map_or_else(|| "anyone".to_owned(), |key| key.id.to_string()),
        name,
        target: format!("{} {}", request.method(), request.uri()),
        digest,
        makes: state.ids.next(),
        lease_until: after(LEASE),
        expires_at: after(state.limits.keep_answers),
    };
    // In a task of its own, and from here on: a caller who hangs up now and comes again is told the answer, and his name is
    // not held for the length of a lease because nobody is left who could end the attempt.
    tokio::spawn(attempt_at(state, call, request, next).in_current_span())
        .await
        .map_err(ApiError::internal)?
}

/// Enters the call, or tells what became of it before.
async fn attempt_at(state: AppState, call: Call, mut request: Request, next: Next) -> ApiResult<Response> {
    let begun = state.store.begin_call(&call, state.clock.now()).await?;
    let attempt = match begun {
        Begun::Now(attempt) => {
            meters::named("begun");
            attempt
        }
        Begun::Answered(kept) => return again(&state, &call.name, kept).await,
        Begun::UnderWay => {
            meters::named("under_way");
            return Err(under_way(&call.name));
        }
        Begun::OtherRequest => {
            meters::named("other_request");
            return Err(other_request(&call.name));
        }
    };
    request.extensions_mut().insert(Makes(attempt.makes));
    let answer = next.run(request).await;
    finish(&state, &attempt, answer).await
}

/// The request with its body read, within the limits of its operation, and the digest of what it says.
async fn read_whole(state: &AppState, request: Request) -> ApiResult<(Request, Digest)> {
    let is_upload = request
        .extensions()
        .get::<Route>()
        .is_some_and(|route| route.operation == "push_map");
    let (parts, body) = request.into_parts();
    if is_upload {
        let upload = UploadBody::read(&parts.headers, body, state).await?;
        let digest = digest_of(&upload.content_type, &upload.bytes).await?;
        let mut request = Request::from_parts(parts, Body::empty());
        request.extensions_mut().insert(ReadUpload::new(upload));
        return Ok((request, digest));
    }
    let bytes = read_json(&parts.headers, body, state).await?;
    let digest = digest_of("application/json", &bytes).await?;
    Ok((Request::from_parts(parts, Body::from(bytes)), digest))
}

/// The digest of a body. Each time that a form is sent there are other boundaries between its parts, so the parts count,
/// not the bytes.
async fn digest_of(content_type: &str, bytes: &Bytes) -> ApiResult<Digest> {
    let media_type = media_type(content_type);
    let parts = if media_type == "multipart/form-data" {
        read_parts(content_type, bytes.clone()).await?
    } else {
        Vec::new()
    };
    let whole = if parts.is_empty() { bytes.clone() } else { Bytes::new() };
    // megabytes are not hashed on a thread that serves requests
    let hashed = tokio::task::spawn_blocking(move || {
        let mut hash = Sha256::new();
        let mut add = |bytes: &[u8]| {
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        };
        add(media_type.as_bytes());
        add(&whole);
        for part in &parts {
            add(part.name.as_bytes());
            add(part.file_name.as_deref().unwrap_or_default().as_bytes());
            add(&part.bytes);
        }
        <[u8; 32]>::from(hash.finalize())
    });
    let hashed = hashed.await.map_err(ApiError::internal)?;
    Digest::from_slice(&hashed).ok_or_else(|| ApiError::internal("a SHA-256 has 32 bytes"))
}

/// Keeps an answer that tells of success; ends the attempt otherwise.
async fn finish(state: &AppState, attempt: &Attempt, answer: Response) -> ApiResult<Response> {
    let status = answer.status();
    if !status.is_success() {
        let end = if status.is_server_error() {
            CallEnd::Unknown
        } else {
            CallEnd::Refused
        };
        if let Err(error) = state.store.end_call(attempt, end, state.clock.now()).await {
            tracing::warn!(%error, "a name is held until its lease expires");
        }
        return Ok(answer);
    }
    let (parts, body) = answer.into_parts();
    let body = axum::body::to_bytes(body, ANSWER_BYTES_MAX)
        .await
        .map_err(ApiError::internal)?;
    let headers = parts.headers.iter().filter_map(|(name, value)| {
        let value = value.to_str().ok()?;
        Some(KeptHeader(name.as_str().to_owned(), value.to_owned()))
    });
    let kept = KeptAnswer {
        status: status.as_u16(),
        headers: headers.collect(),
        body: String::from_utf8(body.to_vec()).map_err(ApiError::internal)?,
    };
    failpoint::reach(Point::BeforeAnswer);
    if let Err(error) = state.store.keep_answer(attempt, &kept).await {
        // it has taken effect: an attempt after the lease finds what was made
        tracing::warn!(%error, "an answer is not kept");
    }
    Ok(Response::from_parts(parts, Body::from(body)))
}

/// Where that stands of which a kept answer tells: what the request made, or the job that it cancelled.
fn place_of(kept: &KeptAnswer) -> ApiResult<String> {
    if let Some(KeptHeader(_, location)) = kept.headers.iter().find(|header| header.0 == header::LOCATION.as_str()) {
        return Ok(location.clone());
    }
    let job: Job = serde_json::from_str(&kept.body).map_err(ApiError::internal)?;
    Ok(format!("/v1/jobs/{}", job.id))
}

/// The answer as it was given first, unless what it tells of has been deleted since: nobody is to look for it.
///
/// # Errors
/// [`ProblemCode::Gone`].
async fn again(state: &AppState, name: &CallName, kept: KeptAnswer) -> ApiResult<Response> {
    let place = place_of(&kept)?;
    if is_there(state, &place).await? {
        meters::named("replayed");
        replayed(kept)
    } else {
        meters::named("gone");
        Err(gone(name, &place))
    }
}

/// Whether there is a resource at this path.
async fn is_there(state: &AppState, place: &str) -> ApiResult<bool> {
    let mut words = place.trim_start_matches('/').split('/').skip(1);
    let mut word = || words.next().unwrap_or_default();
    let store = &state.store;
    let found = match (word(), word(), word(), word()) {
        ("jobs", job, "", "") => store.get_job(job.parse()?).await.map(drop),
        ("sessions", session, "", "") => store.get_session(&session.parse()?).await.map(drop),
        ("sessions", session, "maps", map) => store.get_map(&session.parse()?, map.parse()?).await.map(drop),
        ("sessions", session, "constraints", constraint) => store
            .get_constraint(&session.parse()?, constraint.parse()?)
            .await
            .map(drop),
        _ => return Err(ApiError::internal(format!("a kept answer tells of {place:?}"))),
    };
    match found {
        Ok(()) => Ok(true),
        Err(StoreError::NotFound(_)) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

fn replayed(kept: KeptAnswer) -> ApiResult<Response> {
    let mut answer = Response::new(Body::from(kept.body));
    *answer.status_mut() = StatusCode::from_u16(kept.status).map_err(ApiError::internal)?;
    for KeptHeader(name, value) in kept.headers {
        let name = HeaderName::try_from(name).map_err(ApiError::internal)?;
        let value = HeaderValue::try_from(value).map_err(ApiError::internal)?;
        answer.headers_mut().append(name, value);
    }
    answer.headers_mut().remove(header::CONTENT_LENGTH);
    answer
        .headers_mut()
        .insert(IDEMPOTENCY_REPLAYED, HeaderValue::from_static("true"));
    Ok(answer)
}

fn under_way(name: &CallName) -> ApiError {
    ApiError::new(
        ProblemCode::IdempotencyKeyInUse,
        format!("the request of idempotency-key {name} is being answered; ask again"),
    )
    .field(FieldError::new(
        IDEMPOTENCY_KEY.as_str(),
        name.as_str(),
        "one at a time",
    ))
}

fn gone(name: &CallName, place: &str) -> ApiError {
    ApiError::new(
        ProblemCode::Gone,
        format!("{place}, of which the answer to idempotency-key {name} tells, has been deleted since"),
    )
    .field(FieldError::new(
        IDEMPOTENCY_KEY.as_str(),
        name.as_str(),
        "a new key for a new request",
    ))
}

fn other_request(name: &CallName) -> ApiError {
    ApiError::new(
        ProblemCode::IdempotencyKeyReused,
        format!("idempotency-key {name} stands for another request; each request has a key of its own"),
    )
    .field(FieldError::new(
        IDEMPOTENCY_KEY.as_str(),
        name.as_str(),
        "the same path, query and body as before, or a new key",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    async fn digest(content_type: &str, body: &str) -> Digest {
        let bytes = Bytes::from(body.to_owned());
        digest_of(content_type, &bytes).await.expect("a digest")
    }

    fn form(boundary: &str, content: &str) -> String {
        format!(
            "--{boundary}\r\nContent-Disposition: form-data; name=\"map\"; filename=\"a.yaml\"\r\n\r\n{content}\r\n\
             --{boundary}--\r\n"
        )
    }

    #[tokio::test]
    async fn the_same_form_with_other_boundaries_has_the_same_digest_and_another_form_has_not() {
        let one = digest("multipart/form-data; boundary=x", &form("x", "image: a.pgm")).await;
        let again = digest("multipart/form-data; boundary=yy", &form("yy", "image: a.pgm")).await;
        let other = digest("multipart/form-data; boundary=x", &form("x", "image: b.pgm")).await;
        assert_eq!(one, again);
        assert_ne!(one, other);
        assert_ne!(
            digest("image/png", "a").await,
            digest("image/x-portable-graymap", "a").await
        );
    }

    #[test]
    fn every_operation_that_posts_can_be_named_unless_it_keeps_nothing() {
        let document = crate::http::openapi();
        for (path, item) in &document.paths.paths {
            let Some(operation) = &item.post else { continue };
            let id = operation.operation_id.as_deref().unwrap_or_default();
            assert_eq!(can_be_named(id), id != "merge_now", "{path}");
        }
    }

    #[test]
    fn a_name_that_is_not_one_is_refused() {
        let of = |values: &[&str]| {
            let values = values
                .iter()
                .map(|value| HeaderValue::from_str(value).expect("a header"));
            name_of(&values.map(|value| (IDEMPOTENCY_KEY, value)).fold(
                HeaderMap::new(),
                |mut headers, (name, value)| {
                    headers.append(name, value);
                    headers
                },
            ))
        };
        assert_eq!(of(&[]).expect("none"), None);
        assert_eq!(of(&[" a-7 "]).expect("one").expect("a name").as_str(), "a-7");
        for bad in [&["a", "b"][..], &["two words"], &[""]] {
            let refused = of(bad).expect_err("refused");
            assert!(refused.to_string().contains("idempotency-key"), "{refused}");
        }
    }
}
