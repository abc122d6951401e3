//! Paths such as `/v1/jobs/{job}:cancel`: a parameter with a suffix in one segment, which the router cannot match.
//!
//! Inside of the server the suffix is a segment of its own, `/v1/jobs/{job}/~cancel`; a layer before the router
//! rewrites requests, and the table of routes is written, and documented, in the outer form.

use axum::extract::Request;
use axum::http::Uri;
use axum::http::uri::PathAndQuery;
use utoipa_axum::router::{OpenApiRouter, UtoipaMethodRouter};

use super::state::AppState;

/// `(segment before, suffix, segment inside)`.
const SUFFIXES: [(&str, &str, &str); 3] = [
    ("jobs", ":cancel", "~cancel"),
    ("jobs", "%3Acancel", "~cancel"),
    ("maps", ".png", "~png"),
];

/// Adds a route whose path ends in a suffix.
pub(super) fn add_suffixed(
    router: OpenApiRouter<AppState>,
    (schemas, paths, methods): UtoipaMethodRouter<AppState>,
) -> OpenApiRouter<AppState> {
    let mut router = router;
    for path in paths.paths.keys() {
        let inside = inside(path).expect("invariant: the table names a suffix that is listed here");
        router = router.route(&inside, methods.clone());
    }
    // documents the path in its outer form; the empty method router takes no request
    let documented = router.get_openapi_mut();
    documented.paths.paths.extend(paths.paths);
    let components = documented.components.get_or_insert_default();
    components.schemas.extend(schemas);
    router
}

/// Turns a request's path into its inner form.
pub(super) fn rewrite(mut request: Request) -> Request {
    let path = request.uri().path();
    let inside = if path.contains("/~") {
        Some("/~".to_owned())
    } else {
        inside(path)
    };
    if let Some(mut inside) = inside {
        if let Some(query) = request.uri().query() {
            inside.push('?');
            inside.push_str(query);
        }
        let mut parts = request.uri().clone().into_parts();
        parts.path_and_query = PathAndQuery::try_from(inside).ok().or(parts.path_and_query);
        if let Ok(uri) = Uri::from_parts(parts) {
            *request.uri_mut() = uri;
        }
    }
    request
}

/// The inner form of a path; `None` when it has no suffix.
pub(super) fn inside(path: &str) -> Option<String> {
    let (before, last) = path.rsplit_once('/')?;
    let (_, parent) = before.rsplit_once('/')?;
    SUFFIXES
        .iter()
        .filter(|(segment, ..)| *segment == parent)
        .find_map(|(_, suffix, inside)| {
            let parameter = last.strip_suffix(suffix)?;
            Some(format!("{before}/{parameter}/{inside}"))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rewritten(path: &str) -> String {
        let request = Request::builder()
            .uri(path)
            .body(axum::body::Body::empty())
            .expect("a request");
        rewrite(request).uri().to_string()
    }

    #[test]
    fn suffixes_become_segments_and_the_query_stays() {
        assert_eq!(rewritten("/v1/jobs/7:cancel?x=1"), "/v1/jobs/7/~cancel?x=1");
        assert_eq!(rewritten("/v1/sessions/s/maps/7.png"), "/v1/sessions/s/maps/7/~png");
    }

    #[test]
    fn other_paths_stay_and_the_inner_form_cannot_be_asked_for() {
        let same = [
            "/v1/sessions/s/versions/3/map.png",
            "/v1/jobs/7",
            "/",
            "/v1/sessions/s/maps",
        ];
        for path in same {
            assert_eq!(rewritten(path), path);
        }
        assert_eq!(rewritten("/v1/jobs/7/~cancel"), "/~");
    }
}
