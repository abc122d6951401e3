//! What Prometheus asks for.

use axum::extract::State;
use axum::http::{HeaderName, header};

use super::error::{ApiError, ApiResult};
use super::state::AppState;
use crate::meters;

/// The text format of Prometheus.
const TEXT: &str = "text/plain; version=0.0.4; charset=utf-8";

/// What is measured of this server
///
/// In the text format of Prometheus; each replica tells its own figures, and all the same ones of the queue. The
/// operators' page tells what each of them means.
#[utoipa::path(
    get, path = "/metrics", tag = "service", operation_id = "metrics",
    responses((status = 200, description = "All figures", body = String, content_type = "text/plain"))
)]
pub(super) async fn metrics(State(state): State<AppState>) -> ApiResult<([(HeaderName, &'static str); 1], String)> {
    let depth = state.store.queue_depth().await;
    meters::queue(depth.ok().map(|depth| (depth.queued, depth.running)));
    let figures = meters::exposition().ok_or_else(|| ApiError::internal(meters::Taken))?;
    Ok(([(header::CONTENT_TYPE, TEXT)], figures))
}
