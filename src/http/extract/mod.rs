//! Extractors whose every rejection is an [`ApiError`](super::error::ApiError) that names the field, the value and
//! the limit.

mod body;
mod digest;
mod json;
mod multipart;
mod params;

pub(super) use body::{ReadUpload, UploadBody, media_type};
pub(super) use digest::{CONTENT_DIGEST, REPR_DIGEST};
pub(super) use json::{JsonBody, read_json, unsupported};
pub(super) use multipart::{Part, read_parts};
pub(super) use params::{Path, Query, parse_query, parsed, take_repeated};
