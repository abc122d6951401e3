//! The embedded page.

use axum::Router;
use axum::http::{HeaderValue, header};
use axum::response::IntoResponse as _;
use axum::routing::get;

use super::state::AppState;
use crate::web::{ASSETS, Asset, CSP};

/// `/` and its files.
pub(super) fn routes() -> Router<AppState> {
    ASSETS.into_iter().fold(Router::new(), |router, asset| {
        router.route(asset.path, get(move || async move { file(asset) }))
    })
}

fn file(asset: Asset) -> axum::response::Response {
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(asset.media_type)),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(CSP)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
    ];
    (headers, asset.content).into_response()
}
