//! Parameters of the path and of the query.

use std::fmt::Display;
use std::str::FromStr;

use axum::extract::path::ErrorKind;
use axum::extract::rejection::PathRejection;
use axum::extract::{FromRequestParts, RawPathParams};
use axum::http::request::Parts;
use serde::Deserialize as _;
use serde::de::{DeserializeOwned, Deserializer};

use crate::api::{FieldError, ProblemCode};
use crate::http::error::{ApiError, ApiResult};
use crate::http::state::AppState;

/// The parameters of the path, parsed.
pub(in crate::http) struct Path<T>(pub(in crate::http) T);

impl<T: DeserializeOwned + Send> FromRequestParts<AppState> for Path<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &AppState) -> ApiResult<Self> {
        match axum::extract::Path::<T>::from_request_parts(parts, state).await {
            Ok(axum::extract::Path(value)) => Ok(Self(value)),
            Err(PathRejection::FailedToDeserializePathParams(error)) => match error.into_kind() {
                ErrorKind::Message(message) => Err(refused_parameter(parts, state, message).await),
                kind => Err(path_refusal(kind)),
            },
            Err(other) => Err(ApiError::internal(other)),
        }
    }
}

/// A parameter that is text but not what it must be. Which one is told by the first word of the message.
async fn refused_parameter(parts: &mut Parts, state: &AppState, message: String) -> ApiError {
    let all = RawPathParams::from_request_parts(parts, state).await;
    let all = all.as_ref().map(|all| all.iter().collect()).unwrap_or_default();
    let named: Vec<(&str, &str)> = all;
    match named.into_iter().find(|(key, _)| message.starts_with(key)) {
        Some((key, value)) => path_refusal(ErrorKind::DeserializeError {
            key: key.to_owned(),
            value: value.to_owned(),
            message,
        }),
        None => path_refusal(ErrorKind::Message(message)),
    }
}

fn path_refusal(kind: ErrorKind) -> ApiError {
    let (field, limit) = match kind {
        ErrorKind::ParseErrorAtKey {
            key,
            value,
            expected_type,
        } => (FieldError::new(&key, value, expected_type), expected_type.to_owned()),
        ErrorKind::DeserializeError { key, value, message } => {
            let limit = limit_of(&message);
            (FieldError::new(&key, value, limit), format!("it must be {limit}"))
        }
        ErrorKind::InvalidUtf8InPathParam { key } => {
            let limit = "UTF-8 once percent-decoded";
            (FieldError::missing(&key, limit), limit.to_owned())
        }
        other => (FieldError::missing("path", "the documented form"), other.to_string()),
    };
    ApiError::new(ProblemCode::InvalidPath, format!("{}: {limit}", field.field)).field(field)
}

/// What would have been allowed, out of a message that ends with it.
fn limit_of(message: &str) -> &str {
    message.rsplit_once("it must be ").map_or(message, |(_, limit)| limit)
}

/// Deserialises by parsing, whose errors name the limit.
pub(in crate::http) fn parsed<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: FromStr,
    T::Err: Display,
{
    let text = String::deserialize(deserializer)?;
    text.parse().map_err(serde::de::Error::custom)
}

/// The parameters of the query, parsed; unknown ones are refused when `T` refuses them.
pub(in crate::http) struct Query<T>(pub(in crate::http) T);

impl<T: DeserializeOwned> FromRequestParts<AppState> for Query<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &AppState) -> ApiResult<Self> {
        parse_query(parts.uri.query().unwrap_or_default()).map(Self)
    }
}

pub(in crate::http) fn parse_query<T: DeserializeOwned>(query: &str) -> ApiResult<T> {
    let pairs: Vec<(String, String)> = serde_urlencoded::from_str(query)
        .map_err(|error| ApiError::new(ProblemCode::InvalidQuery, format!("the query cannot be read: {error}")))?;
    let deserializer = serde_urlencoded::Deserializer::new(form_urlencoded(query));
    serde_path_to_error::deserialize(deserializer).map_err(|error| {
        let (name, reason) = (error.path().to_string(), error.inner().to_string());
        let known = pairs.iter().find(|(key, _)| *key == name);
        let field = match known {
            Some((key, value)) => FieldError::new(key, value, limit_of(&reason)),
            None => FieldError::missing("query", &reason),
        };
        let detail = if known.is_some() {
            format!("{name}: {reason}")
        } else {
            reason
        };
        ApiError::new(ProblemCode::InvalidQuery, detail).field(field)
    })
}

/// The values of a parameter that may be there more than once, and the query without it.
pub(in crate::http) fn take_repeated(query: &str, name: &str) -> (Vec<String>, String) {
    let (taken, rest): (Vec<_>, Vec<_>) = form_urlencoded(query).partition(|(key, _)| key == name);
    let mut without = form_urlencoded::Serializer::new(String::new());
    without.extend_pairs(rest);
    (
        taken.into_iter().map(|(_, value)| value.into_owned()).collect(),
        without.finish(),
    )
}

fn form_urlencoded(query: &str) -> form_urlencoded::Parse<'_> {
    form_urlencoded::parse(query.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Placement {
        resolution: f64,
        #[serde(default)]
        negate: bool,
    }

    #[test]
    fn a_query_is_parsed_by_name() {
        let query: Placement = parse_query("negate=true&resolution=0.05").expect("both");
        assert!(query.negate && (query.resolution - 0.05).abs() < 1e-12);
    }

    #[test]
    fn a_parameter_that_is_there_more_than_once_is_taken_out() {
        let (taken, rest) = take_repeated("a=1&label=x%3D%26&label=y&b=%2B", "label");
        assert_eq!(
            (taken, rest.as_str()),
            (vec!["x=&".to_owned(), "y".to_owned()], "a=1&b=%2B")
        );
    }

    #[test]
    fn a_parameter_that_cannot_be_read_is_named_with_its_value() {
        let error = parse_query::<Placement>("resolution=fine").expect_err("no number");
        let text = format!("{error:?}");
        assert!(text.contains("resolution") && text.contains("fine"), "{text}");
    }

    #[test]
    fn parameters_that_are_missing_or_unknown_are_refused_by_name() {
        let missing = parse_query::<Placement>("").expect_err("no resolution");
        assert!(missing.to_string().contains("resolution"), "{missing}");
        let unknown = parse_query::<Placement>("resolution=1&colour=red").expect_err("no such parameter");
        assert!(unknown.to_string().contains("colour"), "{unknown}");
    }
}
