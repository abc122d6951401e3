//! Which refusals an operation documents: groups of codes for the OpenAPI document.

use std::collections::BTreeMap;

use utoipa::openapi::{ContentBuilder, Ref, RefOr, Response, ResponseBuilder};

use crate::api::{PROBLEM_JSON, ProblemCode};

macro_rules! refusals {
    ($($(#[$doc:meta])* $name:ident: $($code:ident),+;)*) => {
        $(
            $(#[$doc])*
            pub(super) struct $name;

            impl utoipa::IntoResponses for $name {
                fn responses() -> BTreeMap<String, RefOr<Response>> {
                    documented(&[$(ProblemCode::$code),+])
                }
            }
        )*
    };
}

refusals! {
    /// Of a list.
    BadList: InvalidQuery, InvalidRequest;
    /// Of a JSON body.
    BadBody: MalformedJson, DigestMismatch, BodyTimeout, BodyTooLarge, UnsupportedMediaType, InvalidRequest;
    /// Of everything below a session.
    InSession: InvalidPath, SessionNotFound;
    /// Of a list below a session.
    SessionList: InvalidPath, InvalidQuery, SessionNotFound, InvalidRequest;
    /// Of a session that is to be made.
    SessionClash: InvalidPath, MalformedJson, DigestMismatch, BodyTimeout, SessionExists, BodyTooLarge, UnsupportedMediaType,
        InvalidRequest;
    /// Of a session that is to be changed.
    BadPatch: InvalidPath, MalformedJson, DigestMismatch, BodyTimeout, SessionNotFound, BodyTooLarge, UnsupportedMediaType,
        InvalidRequest;
    /// Of a map.
    OfMap: InvalidPath, SessionNotFound, MapNotFound;
    /// Of a map's picture.
    OfPicture: InvalidPath, SessionNotFound, MapNotFound, RangeNotSatisfiable;
    /// Of a job.
    OfJob: InvalidPath, InvalidQuery, JobNotFound, InvalidRequest;
    /// Of a version.
    OfVersion: InvalidPath, SessionNotFound, VersionNotFound, RangeNotSatisfiable;
    /// Of an upload.
    BadUpload: InvalidPath, InvalidQuery, MalformedMultipart, DigestMismatch, SessionNotFound, BodyTimeout, BodyTooLarge, MapTooLarge,
        UnsupportedMediaType, InvalidRequest, InvalidMap, QueueFull, Overloaded, StorageUnavailable, ShuttingDown;
    /// Of a merge that is asked for.
    BadMerge: InvalidPath, MalformedJson, DigestMismatch, BodyTimeout, SessionNotFound, Conflict, BodyTooLarge, UnsupportedMediaType,
        InvalidRequest, QueueFull, StorageUnavailable;
    /// Of a constraint that is to stand.
    BadConstraint: InvalidPath, MalformedJson, DigestMismatch, BodyTimeout, SessionNotFound, Conflict, BodyTooLarge,
        UnsupportedMediaType, InvalidRequest;
    /// Of a constraint.
    OfConstraint: InvalidPath, SessionNotFound, ConstraintNotFound;
    /// Of a merge at once.
    BadOneShot: InvalidQuery, MalformedMultipart, DigestMismatch, NotAcceptable, BodyTimeout, BodyTooLarge, MapTooLarge,
        UnsupportedMediaType, InvalidRequest, InvalidMap, Overloaded, ShuttingDown;
    /// Of a server that is not ready.
    NotReady: StorageUnavailable, ShuttingDown;
}

/// One response for each status, its codes listed.
fn documented(codes: &[ProblemCode]) -> BTreeMap<String, RefOr<Response>> {
    let mut by_status = BTreeMap::<u16, Vec<String>>::new();
    for code in codes {
        let sentence = format!("`{}`: {}.", code.as_str(), code.title());
        by_status.entry(code.status()).or_default().push(sentence);
    }
    by_status
        .into_iter()
        .map(|(status, sentences)| (status.to_string(), problem(&sentences.join(" ")).into()))
        .collect()
}

/// A response that is a problem.
pub(super) fn problem(description: &str) -> Response {
    let content = ContentBuilder::new()
        .schema(Some(Ref::from_schema_name("Problem")))
        .build();
    ResponseBuilder::new()
        .description(description)
        .content(PROBLEM_JSON, content)
        .build()
}
