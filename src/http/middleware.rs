//! What surrounds every request: its id, its line in the log, the finishing of refusals, the security headers.

use std::sync::{Arc, LazyLock};
use std::time::Duration;

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use tracing::{Instrument, Span, field};

use super::auth::Route;
use super::error::{Refusal, refusal_of_status};
use super::state::AppState;
use crate::api::PROBLEM_JSON;
use crate::meters;
use crate::model::TraceParent;
use crate::telemetry;

/// The header that carries a request's id, in both directions.
pub(crate) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// The header that carries the trace of a request.
const TRACE_PARENT: HeaderName = HeaderName::from_static("traceparent");

/// The outermost layer: gives the request its id, follows it in the log, and turns every refusal, ours or the
/// router's, into problem+json.
pub(super) async fn follow(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    let id = request_id(request.headers()).unwrap_or_else(|| state.ids.next().to_string());
    let method = request.method().clone();
    let path = request.uri().path().to_owned();
    let began = state.clock.monotonic();
    let span = tracing::info_span!(
        "request",
        otel.kind = "server",
        %method,
        path,
        request_id = id,
        trace_id = field::Empty,
        job = field::Empty,
        status = field::Empty,
    );
    let trace = telemetry::join(&span, trace_parent(request.headers()), state.ids.next());
    request.extensions_mut().insert(trace);

    let mut response = next.run(request).instrument(span.clone()).await;
    let _entered = span.enter();
    if response.status().is_client_error() || response.status().is_server_error() {
        response = finish_refusal(response, &path, &id);
    }
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(REQUEST_ID, value);
    }
    let took = state.clock.monotonic().saturating_sub(began);
    measure(&method, &response, took);
    tell_route(&span, &method, &response);
    log_answer(&path, response.status(), took);
    response
}

/// The trace that a caller's request belongs to. What is no traceparent begins a trace of its own, as the standard wants it.
fn trace_parent(headers: &HeaderMap) -> Option<TraceParent> {
    let mut values = headers.get_all(TRACE_PARENT).iter();
    let parent = values.next()?.to_str().ok()?.parse().ok();
    if values.next().is_some() { None } else { parent }
}

fn tell_route(span: &Span, method: &Method, response: &Response) {
    if let Some(route) = response.extensions().get::<Route>() {
        telemetry::rename(span, || format!("{method} {}", route.path));
    }
    span.record("status", response.status().as_u16());
}

/// What a request that met no operation, or was refused before, is counted under.
static NO_ROUTE: LazyLock<Arc<str>> = LazyLock::new(|| Arc::from("none"));

fn measure(method: &Method, response: &Response, took: Duration) {
    let route = response.extensions().get::<Route>();
    let route = route.map_or(&*NO_ROUTE, |route| &route.path);
    // callers may make up methods
    let known = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"];
    let method = known.into_iter().find(|known| method.as_str() == *known);
    meters::request(route, method.unwrap_or("other"), response.status().as_u16(), took);
}

/// The caller's own id, if it is one that can stand in a log: 1 to 64 of `[A-Za-z0-9._-]`.
fn request_id(headers: &HeaderMap) -> Option<String> {
    let id = headers.get(REQUEST_ID)?.to_str().ok()?;
    let harmless = id
        .bytes()
        .all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte));
    ((1..=64).contains(&id.len()) && harmless).then(|| id.to_owned())
}

fn finish_refusal(response: Response, path: &str, id: &str) -> Response {
    let (mut parts, _) = response.into_parts();
    let Refusal { mut problem, cause } = parts
        .extensions
        .remove()
        .unwrap_or_else(|| refusal_of_status(parts.status));
    if let Some(cause) = cause {
        tracing::error!(code = ?problem.code, cause, "request failed");
    }
    problem.instance = Some(path.to_owned());
    id.clone_into(&mut problem.request_id);
    let body = serde_json::to_vec(&problem).expect("invariant: a problem serialises");
    parts.headers.remove(header::CONTENT_LENGTH);
    parts
        .headers
        .insert(header::CONTENT_TYPE, HeaderValue::from_static(PROBLEM_JSON));
    Response::from_parts(parts, Body::from(body))
}

fn log_answer(path: &str, status: StatusCode, took: Duration) {
    let (status, seconds) = (status.as_u16(), took.as_secs_f64());
    if status >= 500 {
        tracing::warn!(status, seconds, "answered");
    } else if matches!(path, "/livez" | "/readyz" | "/metrics") {
        tracing::trace!(status, seconds, "answered");
    } else {
        tracing::debug!(status, seconds, "answered");
    }
}

/// Headers that make a browser careful with everything that we serve.
pub(super) async fn secure(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
    headers
        .entry(header::CONTENT_SECURITY_POLICY)
        .or_insert(HeaderValue::from_static("default-src 'none'; frame-ancestors 'none'"));
    response
}

/// The answer when a handler panics: a plain 500, which [`follow`] finishes.
#[expect(clippy::needless_pass_by_value, reason = "the layer hands over the box")]
pub(super) fn panicked(panic: Box<dyn std::any::Any + Send + 'static>) -> Response {
    let message = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied());
    super::error::ApiError::internal(format!("a handler panicked: {}", message.unwrap_or("no message"))).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_callers_request_id_is_taken_only_when_it_is_harmless_in_a_log() {
        let with = |id: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(REQUEST_ID, HeaderValue::from_str(id).expect("a header value"));
            request_id(&headers)
        };
        assert_eq!(with("robot-7.push_3"), Some("robot-7.push_3".to_owned()));
        assert_eq!(with("two words"), None);
        assert_eq!(with(&"x".repeat(65)), None);
        assert_eq!(with(""), None);
    }
}
