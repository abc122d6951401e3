//! JSON bodies.

use axum::body::Body;
use axum::extract::{FromRequest, Request};
use axum::http::{HeaderMap, header};
use bytes::Bytes;
use serde::de::DeserializeOwned;

use super::body::{BodyLimits, media_type, read_body, refuse_by_length, refuse_encoded};
use super::digest::ToldDigests;
use crate::api::{FieldError, ProblemCode};
use crate::http::error::{ApiError, ApiResult};
use crate::http::state::AppState;

/// The most bytes of a JSON body that is no map: settings and requests are small.
const JSON_BYTES_MAX: u64 = 1 << 20;

/// A JSON body. An empty one stands for `{}`, so that `curl -X POST` does what it says.
pub(in crate::http) struct JsonBody<T>(pub(in crate::http) T);

impl<T: DeserializeOwned> FromRequest<AppState> for JsonBody<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &AppState) -> ApiResult<Self> {
        let content_type = request
            .headers()
            .get(header::CONTENT_TYPE)
            .map(|value| value.to_str().unwrap_or_default().to_owned());
        let (parts, body) = request.into_parts();
        let bytes = read_json(&parts.headers, body, state).await?;
        if bytes.is_empty() {
            return parse_json(b"{}").map(Self);
        }
        match content_type {
            Some(content_type) if is_json(&content_type) => parse_json(&bytes).map(Self),
            other => Err(unsupported(other.as_deref(), "application/json")),
        }
    }
}

/// The bytes of a JSON body that is no map, of a request with these headers.
pub(in crate::http) async fn read_json(headers: &HeaderMap, body: Body, state: &AppState) -> ApiResult<Bytes> {
    let limits = BodyLimits {
        bytes: state.limits.body_bytes.min(JSON_BYTES_MAX),
        time: state.limits.body_time,
    };
    refuse_encoded(headers)?;
    refuse_by_length(headers, limits.bytes)?;
    let digests = ToldDigests::of(headers)?;
    let bytes = read_body(body, limits).await?;
    digests.check(&bytes).await?;
    Ok(bytes)
}

fn is_json(content_type: &str) -> bool {
    let media_type = media_type(content_type);
    media_type == "application/json" || (media_type.starts_with("application/") && media_type.ends_with("+json"))
}

/// The refusal of a media type.
pub(in crate::http) fn unsupported(content_type: Option<&str>, expected: &str) -> ApiError {
    let field = match content_type {
        Some(sent) => FieldError::new("content-type", sent, expected),
        None => FieldError::missing("content-type", expected),
    };
    ApiError::new(
        ProblemCode::UnsupportedMediaType,
        format!(
            "the body's media type is {}; this path takes {expected}",
            content_type.unwrap_or("not told")
        ),
    )
    .field(field)
}

/// Parses JSON; the error names the member.
pub(in crate::http) fn parse_json<T: DeserializeOwned>(bytes: &[u8]) -> ApiResult<T> {
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let value = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let path = error.path().to_string();
        refusal(&path, error.inner())
    })?;
    deserializer.end().map_err(|error| refusal(".", &error))?;
    Ok(value)
}

fn refusal(path: &str, error: &serde_json::Error) -> ApiError {
    if error.is_data() {
        let detail = if path == "." {
            error.to_string()
        } else {
            format!("{path}: {error}")
        };
        let field = if path == "." { "body" } else { path };
        return ApiError::new(ProblemCode::InvalidRequest, detail).field(FieldError::missing(field, error.to_string()));
    }
    ApiError::new(ProblemCode::MalformedJson, error.to_string())
        .field(FieldError::missing("body", "a JSON text (RFC 8259)"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    struct Settings {
        #[expect(dead_code, reason = "only its parsing is looked at")]
        resolution: f64,
    }

    #[test]
    fn text_that_is_no_json_and_json_of_the_wrong_shape_are_told_apart() {
        let malformed = parse_json::<Settings>(b"{\"resolution\": ").expect_err("cut off");
        assert!(format!("{malformed:?}").contains("MalformedJson"));
        let wrong = parse_json::<Settings>(br#"{"resolution": "fine"}"#).expect_err("a string");
        let wrong = format!("{wrong:?}");
        assert!(
            wrong.contains("InvalidRequest") && wrong.contains("resolution"),
            "{wrong}"
        );
    }

    #[test]
    fn text_after_the_json_is_refused() {
        assert!(parse_json::<Settings>(br#"{"resolution": 1} x"#).is_err());
    }
}
