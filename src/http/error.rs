//! The one error of the handlers, and how it becomes a problem+json answer.

use std::fmt;
use std::time::Duration;

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

use crate::api::{FieldError, Problem, ProblemCode};

/// Why a request is refused. The middleware adds the request id and the path, and writes the cause to the log.
///
/// Boxed: answers that succeed do not carry its size along.
#[derive(Debug)]
pub(crate) struct ApiError(Box<Parts>);

#[derive(Debug)]
struct Parts {
    problem: Problem,
    retry_after: Option<Duration>,
    /// What went wrong inside: for the log, never for the caller.
    cause: Option<String>,
}

/// How a key may be shown: by programs, and by browsers that ask their user for it.
const CHALLENGES: [&str; 2] = ["Bearer realm=\"mapweld\"", "Basic realm=\"mapweld\", charset=\"UTF-8\""];

/// What a handler answers.
pub(crate) type ApiResult<T> = Result<T, ApiError>;

/// What the middleware finds in the extensions of a refusal's response.
#[derive(Debug, Clone)]
pub(super) struct Refusal {
    pub(super) problem: Problem,
    pub(super) cause: Option<String>,
}

impl ApiError {
    /// A refusal of this kind with a sentence about this occurrence.
    pub(crate) fn new(code: ProblemCode, detail: impl Into<String>) -> Self {
        Self(Box::new(Parts {
            problem: Problem::new(code, detail),
            retry_after: match code {
                ProblemCode::QueueFull
                | ProblemCode::RateLimited
                | ProblemCode::Overloaded
                | ProblemCode::StorageUnavailable
                | ProblemCode::IdempotencyKeyInUse => Some(Duration::from_secs(1)),
                ProblemCode::ShuttingDown => Some(Duration::from_secs(5)),
                _ => None,
            },
            cause: None,
        }))
    }

    /// A value that is not allowed: names the field, the value and the limit.
    pub(crate) fn invalid(field: &str, value: impl Into<String>, limit: &str) -> Self {
        let error = FieldError::new(field, value, limit);
        let shown = error.value.as_deref().unwrap_or_default();
        Self::new(
            ProblemCode::InvalidRequest,
            format!("{field} is {shown:?}; it must be {limit}"),
        )
        .field(error)
    }

    /// A bug of ours or of the machine: the caller learns no more than the request id.
    pub(crate) fn internal(cause: impl fmt::Display) -> Self {
        let mut error = Self::new(
            ProblemCode::Internal,
            "the server failed; its log tells more under this request id",
        );
        error.0.cause = Some(cause.to_string());
        error
    }

    /// The database or the blob store does not answer.
    pub(crate) fn storage(cause: impl fmt::Display) -> Self {
        let mut error = Self::new(
            ProblemCode::StorageUnavailable,
            "the storage does not answer; send it again: a map that was stored all the same is not stored twice",
        );
        error.0.cause = Some(cause.to_string());
        error
    }

    /// When the same request may be answered otherwise.
    #[must_use]
    pub(crate) fn retry_after(mut self, wait: Duration) -> Self {
        self.0.retry_after = Some(wait);
        self
    }

    /// Adds a field that was wrong.
    #[must_use]
    pub(crate) fn field(mut self, error: FieldError) -> Self {
        self.0.problem.errors.push(error);
        self
    }
}

impl fmt::Display for ApiError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.problem.detail)
    }
}

impl std::error::Error for ApiError {}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let Parts {
            problem,
            retry_after,
            cause,
        } = *self.0;
        let status = StatusCode::from_u16(problem.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let mut response = status.into_response();
        if let Some(after) = retry_after {
            // whole seconds, and not too early
            let seconds = after.as_secs() + u64::from(after.subsec_nanos() > 0);
            let seconds = HeaderValue::from(seconds.max(1));
            response.headers_mut().insert(header::RETRY_AFTER, seconds);
        }
        if status == StatusCode::UNAUTHORIZED {
            for scheme in CHALLENGES {
                let challenge = HeaderValue::from_static(scheme);
                response.headers_mut().append(header::WWW_AUTHENTICATE, challenge);
            }
        }
        response.extensions_mut().insert(Refusal { problem, cause });
        response
    }
}

/// The refusal that stands for an error answer which none of our handlers made: the router's 404 and 405, a panic.
pub(super) fn refusal_of_status(status: StatusCode) -> Refusal {
    let (code, detail) = match status {
        StatusCode::NOT_FOUND => (ProblemCode::NotFound, "there is nothing at this path"),
        StatusCode::METHOD_NOT_ALLOWED => (
            ProblemCode::MethodNotAllowed,
            "this path does not take this method; the header Allow names those that it takes",
        ),
        StatusCode::NOT_ACCEPTABLE => (ProblemCode::NotAcceptable, "no acceptable representation"),
        StatusCode::REQUEST_TIMEOUT => (ProblemCode::BodyTimeout, "the request did not arrive in time"),
        StatusCode::PAYLOAD_TOO_LARGE => (ProblemCode::BodyTooLarge, "the body is too large"),
        StatusCode::UNSUPPORTED_MEDIA_TYPE => (
            ProblemCode::UnsupportedMediaType,
            "this path does not take a body of this media type",
        ),
        status if status.is_client_error() => (ProblemCode::BadRequest, "the request is malformed"),
        _ => (
            ProblemCode::Internal,
            "the server failed; its log tells more under this request id",
        ),
    };
    let mut problem = Problem::new(code, detail);
    problem.status = status.as_u16();
    Refusal { problem, cause: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_that_passes_by_itself_says_when_to_try_again() {
        let response = ApiError::new(ProblemCode::QueueFull, "full").into_response();
        assert_eq!(response.status(), StatusCode::TOO_MANY_REQUESTS);
        assert_eq!(response.headers()[header::RETRY_AFTER], "1");
    }

    #[test]
    fn the_wait_that_is_told_is_never_too_short() {
        let refusal = ApiError::new(ProblemCode::RateLimited, "often").retry_after(Duration::from_millis(1200));
        assert_eq!(refusal.into_response().headers()[header::RETRY_AFTER], "2");
    }

    #[test]
    fn an_internal_error_keeps_its_cause_to_the_log() {
        let response = ApiError::internal("the secret cause").into_response();
        let refusal = response
            .extensions()
            .get::<Refusal>()
            .expect("a refusal carries its problem");
        assert_eq!(refusal.cause.as_deref(), Some("the secret cause"));
        assert!(!refusal.problem.detail.contains("secret"));
    }
}
