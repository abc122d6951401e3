//! Errors on the wire: RFC 9457 problem details.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The media type of a [`Problem`].
pub const PROBLEM_JSON: &str = "application/problem+json";

/// Every answer with a status of 400 or more, as `application/problem+json` (RFC 9457).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[schema(example = json!({
    "type": "about:blank",
    "title": "The request has a value that is not allowed",
    "status": 422,
    "detail": "resolution must lie within 0.001 and 100 m/cell",
    "instance": "/v1/sessions/warehouse/robots/r1/maps",
    "code": "invalid_request",
    "request_id": "01939f3e-7a52-7c1e-b5e6-3d8f0f6f2a10",
    "errors": [{ "field": "resolution", "value": "0", "limit": "0.001 to 100 m/cell" }]
}))]
pub struct Problem {
    /// A URI of the kind of problem; always `about:blank`: `code` tells the kinds apart.
    #[serde(rename = "type")]
    pub kind: String,
    /// The kind of problem in words; the same for the same `code`.
    pub title: String,
    /// The HTTP status.
    pub status: u16,
    /// This occurrence in words.
    pub detail: String,
    /// The path that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instance: Option<String>,
    /// The kind of problem for programs; stable.
    pub code: ProblemCode,
    /// The id of the request, as in the header `x-request-id` and in the server's log.
    #[serde(default)]
    pub request_id: String,
    /// Which fields were wrong.
    #[serde(default)]
    pub errors: Vec<FieldError>,
}

/// A field that was wrong.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FieldError {
    /// Name of the query or path parameter, header, multipart part, or path to the JSON member.
    pub field: String,
    /// The value that was sent, shortened; absent when the field was missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<String>,
    /// What would have been allowed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<String>,
}

impl FieldError {
    /// The longest value that is repeated to the caller, in characters.
    pub const VALUE_MAX: usize = 120;

    /// The longest name of a field, and the longest limit, in characters. Both may quote what was sent.
    pub const WORDS_MAX: usize = 1000;

    /// A field with the value that it had and what is allowed.
    pub fn new(field: impl Into<String>, value: impl Into<String>, limit: impl Into<String>) -> Self {
        Self {
            value: Some(shortened(value.into(), Self::VALUE_MAX)),
            ..Self::missing(field, limit)
        }
    }

    /// A field that is missing, and what is expected of it.
    pub fn missing(field: impl Into<String>, limit: impl Into<String>) -> Self {
        Self {
            field: shortened(field.into(), Self::WORDS_MAX),
            value: None,
            limit: Some(shortened(limit.into(), Self::WORDS_MAX)),
        }
    }
}

/// The text, without what goes beyond so many characters: an answer does not grow with what was sent.
fn shortened(mut text: String, characters_max: usize) -> String {
    if let Some((cut, _)) = text.char_indices().nth(characters_max) {
        text.truncate(cut);
        text.shrink_to_fit();
    }
    text
}

macro_rules! problem_codes {
    ($($(#[$doc:meta])* $name:ident = $status:literal, $title:literal;)*) => {
        /// The kinds of problem.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum ProblemCode {
            $($(#[$doc])* $name,)*
            /// A kind that this version of the client does not know.
            #[serde(other)]
            Unknown,
        }

        impl ProblemCode {
            /// Every kind that the server answers with.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// The HTTP status that goes with it.
            #[must_use]
            pub fn status(self) -> u16 {
                match self {
                    $(Self::$name => $status,)*
                    Self::Unknown => 500,
                }
            }

            /// It as it stands in JSON.
            #[must_use]
            pub fn as_str(self) -> String {
                let text = serde_json::to_string(&self).expect("invariant: a code serialises");
                text.trim_matches('"').to_owned()
            }

            /// It in words.
            #[must_use]
            pub fn title(self) -> &'static str {
                match self {
                    $(Self::$name => $title,)*
                    Self::Unknown => "An unknown problem",
                }
            }
        }
    };
}

problem_codes! {
    /// The request cannot be read as HTTP or breaks a rule that has no code of its own.
    BadRequest = 400, "The request is malformed";
    /// The body is no JSON.
    MalformedJson = 400, "The body is not JSON";
    /// The body is no multipart/form-data, or its parts do not belong together.
    MalformedMultipart = 400, "The multipart body is malformed";
    /// The body is not the one whose digest the request tells: it was changed or cut on its way.
    DigestMismatch = 400, "The body does not have its digest";
    /// The query has an unknown, missing or unreadable parameter.
    InvalidQuery = 400, "The query is not understood";
    /// A part of the path has not the form that it must have.
    InvalidPath = 400, "The path is not understood";
    /// The server asks for a key, and the request shows none that is good.
    Unauthorized = 401, "The request shows no good key";
    /// The key that the request shows is not good for this.
    Forbidden = 403, "The key is not good for this";
    /// There is nothing at this path.
    NotFound = 404, "There is nothing at this path";
    /// There is no such session.
    SessionNotFound = 404, "There is no such session";
    /// The session has no such map.
    MapNotFound = 404, "There is no such map";
    /// There is no such job.
    JobNotFound = 404, "There is no such job";
    /// The session has no such version.
    VersionNotFound = 404, "There is no such version";
    /// The session has no such constraint.
    ConstraintNotFound = 404, "There is no such constraint";
    /// The path exists, the method does not.
    MethodNotAllowed = 405, "The method is not allowed here";
    /// None of the media types in `Accept` can be made.
    NotAcceptable = 406, "No acceptable representation";
    /// The body did not arrive in time.
    BodyTimeout = 408, "The body did not arrive in time";
    /// It clashes with what is there.
    Conflict = 409, "The request conflicts with the present state";
    /// The session exists with other settings.
    SessionExists = 409, "The session exists with other settings";
    /// A request with this `Idempotency-Key` is being answered right now; `Retry-After` says when to ask again.
    IdempotencyKeyInUse = 409, "A request with this Idempotency-Key is under way";
    /// What the first request with this Idempotency-Key made has been deleted since.
    Gone = 410, "What the request has made is gone";
    /// The body has more bytes than the server takes.
    BodyTooLarge = 413, "The body is too large";
    /// The map has more cells than the server takes.
    MapTooLarge = 413, "The map is too large";
    /// The media type of the body is not one that this path takes.
    UnsupportedMediaType = 415, "The media type is not supported";
    /// The file ends before the part that is asked for.
    RangeNotSatisfiable = 416, "The range lies outside of the file";
    /// A value is not allowed.
    InvalidRequest = 422, "The request has a value that is not allowed";
    /// The `Idempotency-Key` stands for another request.
    IdempotencyKeyReused = 422, "The Idempotency-Key stands for another request";
    /// The upload cannot be read as a map.
    InvalidMap = 422, "The map cannot be read";
    /// The queue of jobs is full; `Retry-After` says when to try again.
    QueueFull = 429, "The queue is full";
    /// The key asks more often than it may; `Retry-After` says when to try again.
    RateLimited = 429, "The key asks too often";
    /// A bug of the server; the request id finds it in its log.
    Internal = 500, "Internal error";
    /// The server has as much to do as it can take; `Retry-After` says when to try again.
    Overloaded = 503, "The server is overloaded";
    /// The database or the blob store does not answer; `Retry-After` says when to try again.
    StorageUnavailable = 503, "The storage is unavailable";
    /// The server is about to stop; `Retry-After` says when to try again.
    ShuttingDown = 503, "The server is shutting down";
}

impl Problem {
    /// The longest `detail`, in characters; it may quote what was sent.
    pub const DETAIL_MAX: usize = 2000;

    /// A problem of this kind; the server adds the instance and the request id when it answers.
    pub fn new(code: ProblemCode, detail: impl Into<String>) -> Self {
        Self {
            kind: "about:blank".to_owned(),
            title: code.title().to_owned(),
            status: code.status(),
            detail: shortened(detail.into(), Self::DETAIL_MAX),
            instance: None,
            code,
            request_id: String::new(),
            errors: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_snake_case_and_unknown_ones_are_understood() {
        let text = serde_json::to_string(&ProblemCode::UnsupportedMediaType).expect("serialises");
        assert_eq!(text, "\"unsupported_media_type\"");
        let later: ProblemCode = serde_json::from_str("\"from_a_later_version\"").expect("parses");
        assert_eq!(later, ProblemCode::Unknown);
    }

    #[test]
    fn every_code_has_an_error_status() {
        for code in ProblemCode::ALL {
            assert!((400..=599).contains(&code.status()), "{code:?}");
        }
    }

    #[test]
    fn a_problem_does_not_grow_with_what_was_sent() {
        let sent = "\u{e9}".repeat(1 << 20);
        let length = |text: Option<String>| text.map(|text| text.chars().count());
        let error = FieldError::new(&sent, &sent, &sent);
        assert_eq!(length(Some(error.field)), Some(FieldError::WORDS_MAX));
        assert_eq!(length(error.value), Some(FieldError::VALUE_MAX));
        assert_eq!(length(error.limit), Some(FieldError::WORDS_MAX));
        let problem = Problem::new(ProblemCode::InvalidRequest, sent);
        assert_eq!(length(Some(problem.detail)), Some(Problem::DETAIL_MAX));
    }
}
