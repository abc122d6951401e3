//! Extractors whose every rejection is an [`ApiError`](super::error::ApiError) that names the field, the value and
//! the limit.

mod body;
mod json;
mod multipart;
mod params;

pub(super) use body::{UploadBody, media_type};
pub(super) use json::{JsonBody, unsupported};
pub(super) use multipart::{Part, read_parts};
pub(super) use params::{Path, Query, parsed};
