//! Who may do what: every request that meets a route is held against the [table of answers](ANSWERS) before its body is
//! read.
//!
//! A server asks for keys when it listens beyond its own machine, and from the moment on that a key was made; until
//! then, and with `--insecure`, everyone may do everything.

mod access;
mod audit;
mod caller;
mod own;
mod rate;

use std::sync::atomic::{AtomicBool, Ordering};

use axum::extract::{MatchedPath, Request, State};
use axum::http::request::Parts;
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};

pub(super) use access::{ANSWERS, Access, Answers, Route};
pub(super) use audit::Peer;
pub(super) use caller::Caller;
pub(super) use rate::RateLimit;

use super::error::{ApiError, ApiResult};
use super::state::AppState;
use crate::api::{FieldError, ProblemCode};
use crate::meters;
use access::Answer;
use audit::Audit;

/// What decides about a request before its handler does.
pub(super) struct Gate {
    answers: Answers,
    rate: RateLimit,
    /// Nobody has to show a key, whatever happens.
    insecure: bool,
    /// Everybody has to show a key, from now on.
    closed: AtomicBool,
}

impl Gate {
    /// `beyond_loopback`: whether other machines reach the server.
    pub(super) fn new(answers: Answers, rate: RateLimit, insecure: bool, beyond_loopback: bool) -> Self {
        Self {
            answers,
            rate,
            insecure,
            closed: AtomicBool::new(beyond_loopback && !insecure),
        }
    }

    /// Whether a request may come without a key. A key that was made while the server runs closes it for good: keys are
    /// never deleted, only revoked.
    async fn is_open(&self, state: &AppState) -> ApiResult<bool> {
        if self.insecure {
            return Ok(true);
        }
        if !self.closed.load(Ordering::Relaxed) && state.store.has_keys().await? {
            self.closed.store(true, Ordering::Relaxed);
        }
        Ok(!self.closed.load(Ordering::Relaxed))
    }

    fn route(&self, parts: &Parts) -> Option<Route> {
        let path = parts.extensions.get::<MatchedPath>()?;
        self.answers.route(path.as_str(), &parts.method)
    }
}

/// Lets a request pass to its handler, or refuses it. Its answer tells the [`Route`] in its extensions.
pub(super) async fn authorise(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let (parts, body) = request.into_parts();
    let Some(route) = state.gate.route(&parts) else {
        // no operation of ours: a page, or nothing that there is
        return next.run(Request::from_parts(parts, body)).await;
    };
    let mut answer = if route.access == Access::Open {
        next.run(Request::from_parts(parts, body)).await
    } else {
        held_against(&state, route.clone(), Request::from_parts(parts, body), next).await
    };
    answer.extensions_mut().insert(route);
    answer
}

async fn held_against(state: &AppState, route: Route, request: Request, next: Next) -> Response {
    let (mut parts, body) = request.into_parts();
    let mut audit = Audit::begin(&route, &parts);
    let answer = match enter(state, &route, &mut parts, audit.as_mut()).await {
        Ok(caller) => {
            parts.extensions.insert(caller);
            parts.extensions.insert(route);
            next.run(Request::from_parts(parts, body)).await
        }
        Err(refusal) => refusal.into_response(),
    };
    if let Some(audit) = audit {
        audit.end(&answer);
    }
    answer
}

async fn enter(state: &AppState, route: &Route, parts: &mut Parts, audit: Option<&mut Audit>) -> ApiResult<Caller> {
    let caller = Caller::of(state, &parts.method, &parts.headers).await?;
    if let Some(audit) = audit {
        audit.by(&caller);
    }
    let Some(key) = caller.key() else { return Ok(caller) };
    state.gate.rate.admit(key.id, state.clock.monotonic()).map_err(|wait| {
        meters::shed("key_rate");
        ApiError::new(
            ProblemCode::RateLimited,
            format!(
                "the key {} asks more often than it may; try again in {:.3} s",
                key.id,
                wait.as_secs_f64()
            ),
        )
        .retry_after(wait)
    })?;
    match route.access.answer(&key.scope) {
        Answer::Yes => {}
        Answer::IfOwn => own::check(state, route.access, &key.scope, parts).await?,
        Answer::No => {
            let limit = format!("a key of scope {}", route.access.scopes().join(" or "));
            return Err(ApiError::new(
                ProblemCode::Forbidden,
                format!(
                    "{} is not for a key of scope {}; it takes {limit}",
                    route.operation, key.scope
                ),
            )
            .field(FieldError::new("authorization", key.scope.to_string(), limit)));
        }
    }
    Ok(caller)
}
