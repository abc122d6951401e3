//! The OpenAPI document: what the table of routes does not say by itself.

use serde_json::Value;
use utoipa::OpenApi;
use utoipa::openapi::header::HeaderBuilder;
use utoipa::openapi::path::{Operation, ParameterBuilder, ParameterIn};
use utoipa::openapi::schema::{ObjectBuilder, Type};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{ContactBuilder, RefOr, Required};

use super::auth::{ANSWERS, Access};
use super::calls::{IDEMPOTENCY_REPLAYED, can_be_named};
use super::refusals::problem;
use crate::api::{FieldError, Problem, ProblemCode};
use crate::model::CallName;

#[derive(OpenApi)]
#[openapi(
    info(
        title = "mapweld",
        description = "Welds the occupancy grid maps of many robots into one.\n\n\
            Robots push maps to a session; the service registers them with one another, fuses those that it can place, \
            and serves every fused version with the pose of each robot's map and the evidence for it, or the reason why \
            a map is not placed.\n\n\
            Metres, radians, x right, y up, counter-clockwise (REP 103). `pose` of a map is the pose of its frame in the \
            anchor's frame: p_anchor = R(yaw) p_map + (x, y). Ids are UUIDv7, times RFC 3339. Every error is \
            `application/problem+json` (RFC 9457) with a stable `code`.",
        license(name = "Apache-2.0", identifier = "Apache-2.0"),
    ),
    servers((url = "/", description = "This server")),
    tags(
        (name = "sessions", description = "Places and times that robots map together"),
        (name = "maps", description = "What robots push"),
        (name = "jobs", description = "Merges, and how far they are"),
        (name = "constraints", description = "What operators say about how maps lie"),
        (name = "versions", description = "Fused maps, immutable"),
        (name = "one-shot", description = "Merges that keep nothing"),
        (name = "service", description = "The server itself"),
    ),
    components(schemas(Problem, ProblemCode, FieldError)),
)]
pub(super) struct Document;

/// Adds to every operation what holds for all of them.
pub(super) fn complete(mut document: utoipa::openapi::OpenApi) -> utoipa::openapi::OpenApi {
    env!("CARGO_PKG_VERSION").clone_into(&mut document.info.version);
    document.info.contact = Some(ContactBuilder::new().name(Some("mapweld")).build());
    let components = document.components.get_or_insert_default();
    components.add_security_scheme(KEY, key_scheme());
    for item in document.paths.paths.values_mut() {
        let operations = [
            &mut item.get,
            &mut item.put,
            &mut item.post,
            &mut item.patch,
            &mut item.delete,
        ];
        for operation in operations.into_iter().flatten() {
            any_refusal(operation);
            key_needed(operation);
            name_taken(operation);
            body_may_be_empty(operation);
        }
    }
    without_null_defaults(document)
}

/// Members that may be absent are documented with the default `null`, which most of them do not take as a value.
fn without_null_defaults(document: utoipa::openapi::OpenApi) -> utoipa::openapi::OpenApi {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(members) => {
                if members.get("default").is_some_and(Value::is_null) {
                    members.shift_remove("default");
                }
                members.values_mut().for_each(strip);
            }
            Value::Array(items) => items.iter_mut().for_each(strip),
            _ => {}
        }
    }
    let mut value = serde_json::to_value(document).expect("invariant: the document serialises");
    strip(&mut value);
    serde_json::from_value(value).expect("invariant: it is still a document")
}

/// The name of the way to show a key.
const KEY: &str = "key";

fn key_scheme() -> SecurityScheme {
    let description = "A key that `mapweld keys create` has made. Its scope is one of `admin`, `operator`, `robot` and \
                       `read`; each operation lists those that may call it, a robot for what is its own. A server on \
                       its own machine asks for keys as soon as one was made, any other always.";
    let bearer = HttpBuilder::new()
        .scheme(HttpAuthScheme::Bearer)
        .description(Some(description));
    SecurityScheme::Http(bearer.build())
}

/// Which keys an operation takes, and how the others are refused.
fn key_needed(operation: &mut Operation) {
    let id = operation.operation_id.as_deref().unwrap_or_default();
    let row = ANSWERS.iter().find(|(name, _)| *name == id);
    let access = row.map_or(Access::Administer, |(_, access)| *access);
    if access == Access::Open {
        operation.security = Some(Vec::new());
        return;
    }
    operation.security = Some(vec![SecurityRequirement::new(KEY, access.scopes().iter().copied())]);
    let codes = [
        ProblemCode::Unauthorized,
        ProblemCode::Forbidden,
        ProblemCode::RateLimited,
    ];
    add_refusals(operation, &codes);
}

fn add_refusals(operation: &mut Operation, codes: &[ProblemCode]) {
    for code in codes {
        let status = code.status().to_string();
        let told = format!("`{}`: {}.", code.as_str(), code.title());
        let responses = &mut operation.responses.responses;
        match responses.get_mut(&status) {
            Some(RefOr::T(response)) => response.description = format!("{} {told}", response.description),
            _ => {
                responses.insert(status, RefOr::T(problem(&told)));
            }
        }
    }
}

/// That a change can be named, where it can.
fn name_taken(operation: &mut Operation) {
    if !can_be_named(operation.operation_id.as_deref().unwrap_or_default()) {
        return;
    }
    let name = ObjectBuilder::new()
        .schema_type(Type::String)
        .min_length(Some(1))
        .max_length(Some(CallName::CHARS_MAX))
        .pattern(Some("^[!-~]+$"));
    let parameter = ParameterBuilder::new()
        .name("Idempotency-Key")
        .parameter_in(ParameterIn::Header)
        .description(Some(
            "A name of the caller's for this change, such as a UUID. The same request under the same name is answered \
             with the first answer again, and changes nothing again, unless what it made has been deleted since; \
             another request under it is refused. Names are each key's own and hold for a day, unless the server says otherwise.",
        ))
        .schema(Some(name))
        .build();
    operation.parameters.get_or_insert_default().push(RefOr::T(parameter));
    for (status, response) in &mut operation.responses.responses {
        if let (true, RefOr::T(response)) = (status.starts_with('2'), response) {
            let told = HeaderBuilder::new()
                .description(Some("`true` when this answer was given before to the same request"))
                .build();
            response
                .headers
                .insert(IDEMPOTENCY_REPLAYED.as_str().to_owned(), RefOr::T(told));
        }
    }
    let codes = [
        ProblemCode::BadRequest,
        ProblemCode::IdempotencyKeyInUse,
        ProblemCode::Gone,
        ProblemCode::IdempotencyKeyReused,
    ];
    add_refusals(operation, &codes);
}

/// The operations whose empty body stands for `{}`: every member of it has a default.
const EMPTY_BODIES: [&str; 4] = ["create_session", "put_session", "patch_session", "merge"];

fn body_may_be_empty(operation: &mut Operation) {
    let id = operation.operation_id.as_deref().unwrap_or_default();
    if !EMPTY_BODIES.contains(&id) {
        return;
    }
    if let Some(RefOr::T(body)) = operation.request_body.as_mut() {
        body.required = Some(Required::False);
    }
}

fn any_refusal(operation: &mut Operation) {
    operation.responses.responses.insert(
        "default".to_owned(),
        RefOr::T(problem("Any other refusal, as application/problem+json")),
    );
}
