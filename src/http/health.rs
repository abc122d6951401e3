//! Whether the process lives, and whether it can do its work.

use axum::Json;
use axum::extract::State;
use serde::Serialize;
use utoipa::ToSchema;

use super::error::{ApiError, ApiResult};
use super::refusals::NotReady;
use super::state::AppState;
use crate::api::ProblemCode;

/// The process lives.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Alive {
    /// Always `alive`.
    status: &'static str,
    /// The version of mapweld.
    version: &'static str,
}

/// The server can do its work.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Ready {
    /// Always `ready`.
    status: &'static str,
    /// Jobs that wait.
    queued: u32,
    /// Jobs that run.
    running: u32,
}

/// Whether the process lives
///
/// Depends on nothing.
#[utoipa::path(
    get, path = "/livez", tag = "service", operation_id = "livez",
    responses((status = 200, description = "It does", body = Alive))
)]
pub(super) async fn livez() -> Json<Alive> {
    Json(Alive {
        status: "alive",
        version: env!("CARGO_PKG_VERSION"),
    })
}

/// Whether the server can do its work
///
/// The database and the blob store take writes, and the server is not about to stop.
#[utoipa::path(
    get, path = "/readyz", tag = "service", operation_id = "readyz",
    responses((status = 200, description = "It can", body = Ready), NotReady)
)]
pub(super) async fn readyz(State(state): State<AppState>) -> ApiResult<Json<Ready>> {
    if state.stop.is_cancelled() {
        return Err(ApiError::new(ProblemCode::ShuttingDown, "the server is about to stop"));
    }
    state.store.check().await?;
    state.blobs.put(bytes::Bytes::from_static(b"mapweld readyz\n")).await?;
    let depth = state.store.queue_depth().await?;
    Ok(Json(Ready {
        status: "ready",
        queued: depth.queued,
        running: depth.running,
    }))
}
