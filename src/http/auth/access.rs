//! The table of answers: who may call what. One row an operation, in the order of the table of routes.
//!
//! The document of the API is made with it, requests are held against it, and `tests/service/http/access.rs` walks all
//! routes with keys of every scope and expects it.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use axum::http::Method;
use utoipa::openapi::OpenApi;
use utoipa::openapi::path::{Operation, PathItem};

use super::super::suffix::inside;
use crate::model::Scope;

/// What a caller needs for an operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::http) enum Access {
    /// No key.
    Open,
    /// Any good key.
    AnyKey,
    /// A key that reads everything.
    Look,
    /// As [`Access::Look`]; a robot in its own session.
    InSession,
    /// As [`Access::Look`]; a robot when it asks for its own maps only.
    OwnMaps,
    /// As [`Access::Look`]; a robot for a map of its own. Others are not there for it.
    OwnMap,
    /// As [`Access::Look`]; a robot for a job of its own session. Others are not there for it.
    OwnJob,
    /// A key that runs all sessions; a robot for itself.
    Push,
    /// A key that runs all sessions.
    Operate,
    /// A key for what cannot be undone.
    Administer,
}

/// Operations by their ids.
pub(in crate::http) const ANSWERS: &[(&str, Access)] = &[
    ("list_sessions", Access::Look),
    ("create_session", Access::Operate),
    ("get_session", Access::InSession),
    ("put_session", Access::Operate),
    ("patch_session", Access::Operate),
    ("delete_session", Access::Administer),
    ("list_robots", Access::Look),
    ("session_events", Access::InSession),
    ("add_constraint", Access::Operate),
    ("list_constraints", Access::Look),
    ("get_constraint", Access::Look),
    ("remove_constraint", Access::Operate),
    ("push_map", Access::Push),
    ("list_maps", Access::OwnMaps),
    ("get_map", Access::OwnMap),
    ("list_merges", Access::Look),
    ("merge", Access::Operate),
    ("get_job", Access::OwnJob),
    ("job_events", Access::OwnJob),
    ("list_versions", Access::InSession),
    ("get_version", Access::InSession),
    ("get_map_png_of_version", Access::InSession),
    ("get_map_pgm", Access::InSession),
    ("get_map_yaml", Access::InSession),
    ("get_map_zip", Access::InSession),
    ("get_occupancy_grid", Access::InSession),
    ("get_overlay", Access::InSession),
    ("get_transforms", Access::InSession),
    ("merge_now", Access::Operate),
    ("list_methods", Access::AnyKey),
    ("livez", Access::Open),
    ("readyz", Access::Open),
    ("metrics", Access::Look),
    ("get_map_png", Access::OwnMap),
    ("cancel_job", Access::Operate),
];

/// What the table says about a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Answer {
    Yes,
    No,
    /// When what is asked for is the robot's own.
    IfOwn,
}

impl Access {
    /// What a key of this scope may.
    pub(super) fn answer(self, scope: &Scope) -> Answer {
        match (self, scope) {
            (_, Scope::Admin)
            | (Self::Open | Self::AnyKey, _)
            | (Self::Push | Self::Operate, Scope::Operator)
            | (
                Self::Look | Self::InSession | Self::OwnMaps | Self::OwnMap | Self::OwnJob,
                Scope::Operator | Scope::Read,
            ) => Answer::Yes,
            (Self::InSession | Self::OwnMaps | Self::OwnMap | Self::OwnJob | Self::Push, Scope::Robot { .. }) => {
                Answer::IfOwn
            }
            (Self::Administer, _)
            | (Self::Look | Self::Operate, Scope::Robot { .. })
            | (Self::Push | Self::Operate, Scope::Read) => Answer::No,
        }
    }

    /// The words of the scopes that may, at least for their own.
    pub(in crate::http) fn scopes(self) -> &'static [&'static str] {
        match self {
            Self::Open => &[],
            Self::AnyKey | Self::InSession | Self::OwnMaps | Self::OwnMap | Self::OwnJob => &Scope::WORDS,
            Self::Look => &["admin", "operator", "read"],
            Self::Push => &["admin", "operator", "robot"],
            Self::Operate => &["admin", "operator"],
            Self::Administer => &["admin"],
        }
    }
}

/// An operation, as requests meet it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::http) struct Route {
    /// As the document writes it.
    pub(in crate::http) path: Arc<str>,
    pub(in crate::http) operation: &'static str,
    pub(super) access: Access,
}

/// [`ANSWERS`] by the router's path.
pub(in crate::http) struct Answers(HashMap<String, Vec<(Method, Route)>>);

impl Answers {
    /// # Panics
    /// When the table and the document do not have the same operations: a route without a row would be open to all.
    pub(in crate::http) fn of(document: &OpenApi) -> Self {
        let mut rows: BTreeMap<&str, Access> = ANSWERS.iter().copied().collect();
        assert_eq!(rows.len(), ANSWERS.len(), "invariant: one row an operation");
        let mut answers = HashMap::<String, Vec<(Method, Route)>>::new();
        for (path, item) in &document.paths.paths {
            let routed = inside(path).unwrap_or_else(|| path.clone());
            for (method, operation) in operations(item) {
                let id = operation.operation_id.as_deref().unwrap_or_default();
                let row = rows.remove_entry(id);
                let (operation, access) = row
                    .unwrap_or_else(|| panic!("invariant: {method} {path}, {id:?}, has a row in the table of answers"));
                // the row's own name lives for ever
                let operation = ANSWERS
                    .iter()
                    .find(|(name, _)| *name == operation)
                    .map_or("", |(name, _)| *name);
                let route = Route {
                    path: Arc::from(path.as_str()),
                    operation,
                    access,
                };
                answers.entry(routed.clone()).or_default().push((method, route));
            }
        }
        assert!(rows.is_empty(), "invariant: rows without a route: {rows:?}");
        Self(answers)
    }

    /// The operation of a request. HEAD is a GET without its body.
    pub(super) fn route(&self, path: &str, method: &Method) -> Option<Route> {
        let wanted = if method == Method::HEAD { &Method::GET } else { method };
        let of_path = self.0.get(path)?;
        of_path
            .iter()
            .find(|(method, _)| method == wanted)
            .map(|(_, route)| route.clone())
    }
}

fn operations(item: &PathItem) -> impl Iterator<Item = (Method, &Operation)> {
    let all = [
        (Method::GET, &item.get),
        (Method::PUT, &item.put),
        (Method::POST, &item.post),
        (Method::PATCH, &item.patch),
        (Method::DELETE, &item.delete),
    ];
    all.into_iter()
        .filter_map(|(method, operation)| Some((method, operation.as_ref()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_operation_has_a_row_and_is_found_by_its_routed_path() {
        let answers = Answers::of(&crate::http::openapi());
        let found = |method, path: &str| answers.route(path, &method).map(|route| route.operation);
        assert_eq!(found(Method::POST, "/v1/jobs/{job}/~cancel"), Some("cancel_job"));
        assert_eq!(found(Method::HEAD, "/livez"), Some("livez"));
        assert_eq!(found(Method::DELETE, "/livez"), None);
        let rows: usize = answers.0.values().map(Vec::len).sum();
        assert_eq!(rows, ANSWERS.len());
    }

    #[test]
    fn the_words_of_the_document_are_those_that_requests_are_held_against() {
        let session = crate::model::SessionId::parse("hall").expect("a name");
        let robot = crate::model::RobotId::parse("r1").expect("a name");
        let scopes = [
            Scope::Admin,
            Scope::Operator,
            Scope::Robot { session, robot },
            Scope::Read,
        ];
        for (operation, access) in ANSWERS {
            for scope in &scopes {
                let may = access.answer(scope) != Answer::No;
                let told = *access == Access::Open || access.scopes().contains(&scope.as_str());
                assert_eq!(may, told, "{operation}, {scope}");
            }
        }
    }
}
