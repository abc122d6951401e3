//! A line in the log for every change: who, what, from where, and how it ended.

use std::net::SocketAddr;

use axum::http::request::Parts;
use axum::http::{StatusCode, header};
use axum::response::Response;

use super::access::Route;
use super::caller::Caller;

/// The address that a request came from.
#[derive(Debug, Clone, Copy)]
pub(in crate::http) struct Peer(pub(in crate::http) SocketAddr);

/// A change that somebody has asked for. Its line is written when it is answered, or dropped because the caller hung up.
pub(super) struct Audit {
    operation: &'static str,
    method: String,
    path: String,
    peer: Option<SocketAddr>,
    caller: Option<Caller>,
    told: bool,
}

impl Audit {
    /// Of a request that may change something; reading leaves no line.
    pub(super) fn begin(route: &Route, parts: &Parts) -> Option<Self> {
        (!parts.method.is_safe()).then(|| Self {
            operation: route.operation,
            method: parts.method.to_string(),
            path: parts.uri.path().to_owned(),
            peer: parts.extensions.get::<Peer>().map(|peer| peer.0),
            caller: None,
            told: false,
        })
    }

    /// Who asks for it; until this is said, nobody that we know.
    pub(super) fn by(&mut self, caller: &Caller) {
        self.caller = Some(caller.clone());
    }

    /// How it was answered.
    pub(super) fn end(mut self, answer: &Response) {
        let made = answer.headers().get(header::LOCATION).and_then(|at| at.to_str().ok());
        self.tell(Some(answer.status()), made.unwrap_or_default());
    }

    fn tell(&mut self, status: Option<StatusCode>, made: &str) {
        self.told = true;
        let key = self.caller.as_ref().and_then(Caller::key);
        let caller = match (&self.caller, key) {
            (Some(_), Some(key)) => key.name.as_str(),
            (Some(_), None) => "anyone",
            (None, _) => "nobody",
        };
        tracing::info!(
            target: "mapweld::audit",
            caller,
            key = key.map(|key| tracing::field::display(key.id)),
            scope = key.map(|key| tracing::field::display(key.scope.clone())),
            peer = self.peer.map(tracing::field::display),
            operation = self.operation,
            method = self.method,
            path = self.path,
            status = status.map(|status| status.as_u16()),
            made,
            "{}",
            match status {
                Some(status) if status.is_success() => "done",
                Some(_) => "refused",
                None => "the caller hung up: it may be done or not",
            },
        );
    }
}

impl Drop for Audit {
    fn drop(&mut self) {
        if !self.told {
            self.tell(None, "");
        }
    }
}
