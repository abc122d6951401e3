//! The API's document, and a page to read it by that needs no network.

use std::sync::Arc;

use axum::extract::Path;
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::get;
use axum::{Json, Router};
use utoipa::openapi::OpenApi;
use utoipa_swagger_ui::Config;

use super::state::AppState;

/// Swagger UI sets styles on its elements and draws with `data:` pictures; it loads nothing from elsewhere.
const DOCS_CSP: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; \
                        img-src 'self' data:; font-src 'self'; connect-src 'self'; base-uri 'none'; \
                        form-action 'none'; frame-ancestors 'none'";

/// `/openapi.json` and `/docs`.
pub(super) fn routes(document: OpenApi) -> Router<AppState> {
    let document = Arc::new(document);
    let page = |path: String| async move { asset(&path) };
    Router::new()
        .route(
            "/openapi.json",
            get(move || async move { Json(document.as_ref().clone()) }),
        )
        .route("/docs", get(|| async { Redirect::permanent("/docs/") }))
        .route("/docs/", get(move || page(String::new())))
        .route("/docs/{*path}", get(move |Path(path): Path<String>| page(path)))
}

fn asset(path: &str) -> Response {
    let config = Config::from("/openapi.json")
        .try_it_out_enabled(true)
        .with_credentials(false);
    match utoipa_swagger_ui::serve(path, Arc::new(config)) {
        Ok(Some(file)) => {
            let headers: [(HeaderName, HeaderValue); 1] =
                [(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(DOCS_CSP))];
            (headers, [(header::CONTENT_TYPE, file.content_type)], file.bytes).into_response()
        }
        Ok(None) => StatusCode::NOT_FOUND.into_response(),
        Err(error) => super::error::ApiError::internal(error).into_response(),
    }
}
