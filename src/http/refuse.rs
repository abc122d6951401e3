//! Which refusal an error of another room becomes. Each match is exhaustive: a new error is given its status here.

use super::error::ApiError;
use crate::api::{FieldError, ProblemCode};
use crate::codec::CodecError;
use crate::meters;
use crate::model::Invalid;
use crate::store::{Missing, StoreError};

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        let text = error.to_string();
        match error {
            StoreError::NotFound(Missing::Session(_)) => Self::new(ProblemCode::SessionNotFound, text),
            StoreError::NotFound(Missing::Map(..)) => Self::new(ProblemCode::MapNotFound, text),
            StoreError::NotFound(Missing::Job(_)) => Self::new(ProblemCode::JobNotFound, text),
            StoreError::NotFound(Missing::Version(..)) => Self::new(ProblemCode::VersionNotFound, text),
            StoreError::NotFound(Missing::Constraint(..)) => Self::new(ProblemCode::ConstraintNotFound, text),
            StoreError::Clash(_) => Self::new(ProblemCode::Conflict, text),
            StoreError::TooManyConstraints { limit, .. } => Self::new(ProblemCode::Conflict, text).field(
                FieldError::new("constraints", format!("{limit} stand"), format!("at most {limit}")),
            ),
            StoreError::SessionExists(_) => Self::new(ProblemCode::SessionExists, text),
            StoreError::QueueFull { queued, limit, .. } => {
                meters::shed("queue");
                let field = FieldError::new("queue", format!("{queued} jobs wait"), format!("at most {limit}"));
                Self::new(ProblemCode::QueueFull, text).field(field)
            }
            StoreError::Unavailable(_) | StoreError::BlobBusy(_) | StoreError::BlobRemoved(_) => Self::storage(text),
            StoreError::NotFound(Missing::Blob(_) | Missing::Key(_))
            | StoreError::LeaseLost(_)
            | StoreError::InUse { .. }
            | StoreError::Damaged(_) => Self::internal(text),
        }
    }
}

impl From<CodecError> for ApiError {
    fn from(error: CodecError) -> Self {
        Self::bad_map("body", &error)
    }
}

impl ApiError {
    /// A part of the request, named `part`, that cannot be read as a map.
    pub(crate) fn bad_map(part: &str, error: &CodecError) -> Self {
        let code = if error.is_over_limit() {
            ProblemCode::MapTooLarge
        } else {
            ProblemCode::InvalidMap
        };
        let field = match error {
            CodecError::Missing { field, expected } => FieldError::missing(format!("{part}.{field}"), *expected),
            CodecError::BadField { field, value, expected } => {
                FieldError::new(format!("{part}.{field}"), value, expected)
            }
            CodecError::BadCell { index, value, expected } => {
                FieldError::new(format!("{part}.data[{index}]"), value.to_string(), *expected)
            }
            CodecError::TooManyBytes { bytes, limit, .. } => {
                FieldError::new(part, format!("{bytes} bytes"), format!("at most {limit} bytes"))
            }
            CodecError::TooManyCells { width, height, limit } => FieldError::new(
                part,
                format!("{width} x {height} cells"),
                format!("at most {limit} cells"),
            ),
            CodecError::NoMemory { cells, .. } => FieldError::new(part, format!("{cells} cells"), "fewer cells"),
            CodecError::UnknownFormat { .. }
            | CodecError::BadPicture { .. }
            | CodecError::BadYaml(_)
            | CodecError::BadJson(_)
            | CodecError::Lattice(_) => FieldError::missing(part, error.to_string()),
        };
        Self::new(code, format!("{part}: {error}")).field(field)
    }
}

impl From<Invalid> for ApiError {
    fn from(invalid: Invalid) -> Self {
        Self::invalid(invalid.field, &invalid.value, &invalid.limit)
    }
}
