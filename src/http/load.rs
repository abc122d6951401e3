//! Load is shed before the machine is busy: so many requests at one time, so many of them that only wait, so many merges
//! at once; what is beyond is answered 503 at once and told when to come again.
//!
//! The probes of supervisors are never shed: a server that has much to do lives.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{Request, State};
use axum::http::Uri;
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use http_body::{Frame, SizeHint};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::error::{ApiError, ApiResult};
use super::state::AppState;
use crate::api::{FieldError, ProblemCode};
use crate::meters;

/// A bound on what is done at one time.
pub(super) struct Bound {
    /// What is counted, in words and as a field.
    what: &'static str,
    /// What is counted, as the reason of a refusal.
    reason: &'static str,
    most: u32,
    places: Arc<Semaphore>,
}

/// A place among those that are bounded; free again when it is dropped.
pub(super) type Place = OwnedSemaphorePermit;

impl Bound {
    pub(super) fn new(what: &'static str, reason: &'static str, most: u32) -> Self {
        Self {
            what,
            reason,
            most,
            places: Arc::new(Semaphore::new(most as usize)),
        }
    }

    /// A place, if there is one.
    ///
    /// # Errors
    /// 503 names what is bounded and the bound.
    pub(super) fn enter(&self) -> ApiResult<Place> {
        Arc::clone(&self.places).try_acquire_owned().map_err(|_| {
            meters::shed(self.reason);
            let limit = format!("at most {} at one time", self.most);
            ApiError::new(
                ProblemCode::Overloaded,
                format!("the server has as many {} as it takes, {limit}; try again", self.what),
            )
            .field(FieldError::missing(self.what, limit))
        })
    }
}

/// The mark of a request that came on a connection beyond those that the server takes: it is only there so that probes,
/// and a refusal in words, still pass.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crowded {
    /// The most connections.
    pub(super) most: u32,
}

/// Lets a request in, for as long as its answer is on its way, or refuses it.
pub(super) async fn shed(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let crowded = request.extensions().get::<Crowded>();
    match request.uri().path() {
        "/livez" | "/readyz" => return next.run(request).await,
        // whoever watches shall see what is going on
        "/metrics" if crowded.is_none() => return next.run(request).await,
        _ => {}
    }
    let entered = match crowded {
        Some(crowded) => Err(too_many_connections(*crowded)),
        None if waits(request.uri()) => state.waiting.enter(),
        None => state.requests.enter(),
    };
    match entered {
        Ok(place) => next
            .run(request)
            .await
            .map(|body| Body::new(Held { body, _place: place })),
        Err(refusal) => refusal.into_response(),
    }
}

/// Whether a request mostly waits: an event stream or a long poll. Such requests may be many and cost little; they have
/// a bound of their own so that they leave room for those that work.
fn waits(uri: &Uri) -> bool {
    let long_poll = |query: &str| query.split('&').any(|pair| pair.starts_with("wait="));
    uri.path().ends_with("/events") || uri.query().is_some_and(long_poll)
}

fn too_many_connections(Crowded { most }: Crowded) -> ApiError {
    meters::shed("connections");
    let limit = format!("at most {most} at one time");
    ApiError::new(
        ProblemCode::Overloaded,
        format!("the server has as many connections as it takes, {limit}; try again"),
    )
    .field(FieldError::missing("connections", limit))
}

/// A body that keeps its place until it is sent, or given up.
struct Held {
    body: Body,
    _place: Place,
}

impl HttpBody for Held {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beyond_the_bound_is_refused_until_a_place_is_free() {
        let bound = Bound::new("requests", "requests", 2);
        let first = bound.enter().expect("the first");
        let _second = bound.enter().expect("the second");
        let refused = bound.enter().expect_err("the third");
        assert!(format!("{refused:?}").contains("at most 2"), "{refused:?}");
        drop(first);
        assert!(bound.enter().is_ok());
    }

    #[test]
    fn streams_and_long_polls_wait_and_others_work() {
        let of = |uri: &'static str| waits(&Uri::from_static(uri));
        assert!(of("/v1/jobs/7/events") && of("/v1/jobs/7?wait=20") && of("/v1/jobs/7?x=1&wait=2"));
        assert!(!of("/v1/jobs/7") && !of("/v1/sessions?await=1"));
    }

    #[tokio::test]
    async fn a_place_is_held_until_the_body_is_sent_and_its_length_is_told() {
        let bound = Bound::new("requests", "requests", 1);
        let held = Body::new(Held {
            body: Body::from("four"),
            _place: bound.enter().expect("a place"),
        });
        assert_eq!(held.size_hint().exact(), Some(4));
        assert!(bound.enter().is_err());
        let sent = axum::body::to_bytes(held, 10).await.expect("a body");
        assert_eq!(&sent[..], b"four");
        assert!(bound.enter().is_ok());
    }
}
