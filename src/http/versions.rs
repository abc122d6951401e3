//! Versions: what a merge has found, for good.

use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use bytes::Bytes;
use serde::Deserialize;
use utoipa::IntoParams;

use super::artifact::{Artifact, OCCUPANCY_GRID, PGM, PNG, TRANSFORMS, VERSION, YAML_PGM, YAML_PNG, ZIP};
use super::error::{ApiError, ApiResult};
use super::extract::{Path, Query, parsed};
use super::list::ListQuery;
use super::refusals::{OfVersion, SessionList};
use super::sessions::SessionPath;
use super::state::AppState;
use super::zip::stored_zip;
use crate::api::{
    self, MergeResult, Page, PlacementStatus, Stamp, Transform, TransformHeader, TransformStamped, Transforms,
    VersionSummary,
};
use crate::codec::{decode_cells, encode_occupancy_grid, encode_pgm, encode_png, encode_yaml};
use crate::grid::OccupancyGrid;
use crate::model::{SessionId, Version, VersionSelector};

/// The version of a path.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct VersionPath {
    /// Name of the session.
    session: SessionId,
    /// Number of the version, or `latest`.
    #[serde(deserialize_with = "parsed")]
    #[param(value_type = String, pattern = "^(latest|[1-9][0-9]{0,8})$", example = "latest")]
    version: VersionSelector,
}

impl VersionPath {
    async fn read(&self, state: &AppState) -> ApiResult<Version> {
        Ok(state.store.get_version(&self.session, self.version).await?)
    }
}

/// List versions
///
/// The newest first.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/versions", tag = "versions", operation_id = "list_versions",
    params(SessionPath, ListQuery),
    responses((status = 200, description = "One page", body = Page<VersionSummary>), SessionList)
)]
pub(super) async fn list(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
    Query(query): Query<ListQuery>,
) -> ApiResult<Json<Page<VersionSummary>>> {
    let versions = state.store.list_versions(&session, &query.page()?).await?;
    query.answer(versions, |version| version.number).map(Json)
}

/// Read a version
///
/// For each robot: placed or not placed, where, and why.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/versions/{version}", tag = "versions", operation_id = "get_version",
    params(VersionPath),
    responses(
        (status = 200, description = "The version", body = api::Version,
         headers(
            ("etag" = String, description = "Strong"),
            ("repr-digest" = String, description = "SHA-256 of the file (RFC 9530)"),
            ("content-digest" = String, description = "SHA-256 of what is sent: the file, or a part of it"),
         )),
        (status = 206, description = "The part that `Range` asks for"),
        (status = 304, description = "It is the one that `If-None-Match` names"),
        OfVersion,
    )
)]
pub(super) async fn get(
    State(state): State<AppState>,
    Path(path): Path<VersionPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    let version = api::Version::from(path.read(&state).await?);
    let json = Bytes::from(serde_json::to_vec(&version).map_err(ApiError::internal)?);
    let artifact = Artifact::derived(crate::model::Digest::of_bytes(&json), VERSION);
    if artifact.is_known_to(&headers) {
        return Ok(artifact.not_modified());
    }
    Ok(artifact.answer(&headers, json))
}

/// The fused map as PNG
///
/// As `map_server` writes and loads it: free 254, occupied 0, unknown 205.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/versions/{version}/map.png", tag = "versions", operation_id = "get_map_png_of_version",
    params(VersionPath),
    responses(
        (status = 200, description = "The picture", body = inline(String), content_type = "image/png",
         headers(
            ("etag" = String, description = "Strong"),
            ("repr-digest" = String, description = "SHA-256 of the file (RFC 9530)"),
            ("content-digest" = String, description = "SHA-256 of what is sent: the file, or a part of it"),
         )),
        (status = 206, description = "The part that `Range` asks for"),
        (status = 304, description = "It is the one that `If-None-Match` names"),
        OfVersion,
    )
)]
pub(super) async fn map_png(
    State(state): State<AppState>,
    Path(path): Path<VersionPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    let version = path.read(&state).await?;
    kept(&state, &headers, version.png).await
}

/// The overlay
///
/// Each robot's map in its own colour, with a legend.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/versions/{version}/overlay.png", tag = "versions", operation_id = "get_overlay",
    params(VersionPath),
    responses(
        (status = 200, description = "The picture", body = inline(String), content_type = "image/png",
         headers(
            ("etag" = String, description = "Strong"),
            ("repr-digest" = String, description = "SHA-256 of the file (RFC 9530)"),
            ("content-digest" = String, description = "SHA-256 of what is sent: the file, or a part of it"),
         )),
        (status = 206, description = "The part that `Range` asks for"),
        (status = 304, description = "It is the one that `If-None-Match` names"),
        OfVersion,
    )
)]
pub(super) async fn overlay_png(
    State(state): State<AppState>,
    Path(path): Path<VersionPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    let version = path.read(&state).await?;
    kept(&state, &headers, version.overlay).await
}

async fn kept(state: &AppState, headers: &HeaderMap, key: crate::model::BlobKey) -> ApiResult<Response> {
    let artifact = Artifact::kept(key, PNG);
    if artifact.is_known_to(headers) {
        return Ok(artifact.not_modified());
    }
    Ok(artifact.answer(headers, state.blobs.get(key).await?))
}

/// The fused map as PGM
#[utoipa::path(
    get, path = "/v1/sessions/{session}/versions/{version}/map.pgm", tag = "versions", operation_id = "get_map_pgm",
    params(VersionPath),
    responses(
        (status = 200, description = "The picture", body = inline(String), content_type = "image/x-portable-graymap",
         headers(
            ("etag" = String, description = "Strong"),
            ("repr-digest" = String, description = "SHA-256 of the file (RFC 9530)"),
            ("content-digest" = String, description = "SHA-256 of what is sent: the file, or a part of it"),
         )),
        (status = 206, description = "The part that `Range` asks for"),
        (status = 304, description = "It is the one that `If-None-Match` names"),
        OfVersion,
    )
)]
pub(super) async fn map_pgm(
    State(state): State<AppState>,
    Path(path): Path<VersionPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    made(&state, &path, &headers, PGM, |grid, _| encode_pgm(grid)).await
}

/// Which picture a YAML file names.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct YamlQuery {
    /// The picture that it names: `map.png` or `map.pgm`.
    #[param(default = "map.png", pattern = r"^map\.(png|pgm)$")]
    image: Option<String>,
}

/// The fused map's YAML file
///
/// Nav2's `map_server` loads it as it is, with the picture beside it.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/versions/{version}/map.yaml", tag = "versions", operation_id = "get_map_yaml",
    params(VersionPath, YamlQuery),
    responses(
        (status = 200, description = "The file", body = inline(String), content_type = "application/yaml",
         headers(
            ("etag" = String, description = "Strong"),
            ("repr-digest" = String, description = "SHA-256 of the file (RFC 9530)"),
            ("content-digest" = String, description = "SHA-256 of what is sent: the file, or a part of it"),
         )),
        (status = 206, description = "The part that `Range` asks for"),
        (status = 304, description = "It is the one that `If-None-Match` names"),
        OfVersion,
    )
)]
pub(super) async fn map_yaml(
    State(state): State<AppState>,
    Path(path): Path<VersionPath>,
    Query(query): Query<YamlQuery>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    let (kind, image) = match query.image.as_deref() {
        None | Some("map.png") => (YAML_PNG, "map.png"),
        Some("map.pgm") => (YAML_PGM, "map.pgm"),
        Some(other) => return Err(ApiError::invalid("image", other, "map.png or map.pgm")),
    };
    let yaml = move |grid: &OccupancyGrid, _: &Version| encode_yaml(grid.lattice(), image).into_bytes();
    made(&state, &path, &headers, kind, yaml).await
}

/// The fused map as an archive
///
/// `map.yaml` and `map.png`, as Nav2's `map_server` loads them.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/versions/{version}/map.zip", tag = "versions", operation_id = "get_map_zip",
    params(VersionPath),
    responses(
        (status = 200, description = "The archive", body = inline(String), content_type = "application/zip",
         headers(
            ("etag" = String, description = "Strong"),
            ("repr-digest" = String, description = "SHA-256 of the file (RFC 9530)"),
            ("content-digest" = String, description = "SHA-256 of what is sent: the file, or a part of it"),
         )),
        (status = 206, description = "The part that `Range` asks for"),
        (status = 304, description = "It is the one that `If-None-Match` names"),
        OfVersion,
    )
)]
pub(super) async fn map_zip(
    State(state): State<AppState>,
    Path(path): Path<VersionPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    made(&state, &path, &headers, ZIP, |grid, _| {
        let yaml = encode_yaml(grid.lattice(), "map.png").into_bytes();
        stored_zip(&[("map.yaml", yaml), ("map.png", encode_png(grid))])
    })
    .await
}

/// The fused map as a message
///
/// `nav_msgs/OccupancyGrid` as rosbridge writes it. Large: prefer the PNG.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/versions/{version}/occupancy_grid.json", tag = "versions", operation_id = "get_occupancy_grid",
    params(VersionPath),
    responses(
        (status = 200, description = "The message", body = crate::codec::OccupancyGridMessage,
         headers(
            ("etag" = String, description = "Strong"),
            ("repr-digest" = String, description = "SHA-256 of the file (RFC 9530)"),
            ("content-digest" = String, description = "SHA-256 of what is sent: the file, or a part of it"),
         )),
        (status = 206, description = "The part that `Range` asks for"),
        (status = 304, description = "It is the one that `If-None-Match` names"),
        OfVersion,
    )
)]
pub(super) async fn occupancy_grid(
    State(state): State<AppState>,
    Path(path): Path<VersionPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    made(&state, &path, &headers, OCCUPANCY_GRID, |grid, version| {
        encode_occupancy_grid(grid, &frame(version.anchor.as_str()))
    })
    .await
}

/// A file that is made of the fused map's cells.
async fn made(
    state: &AppState,
    path: &VersionPath,
    headers: &HeaderMap,
    kind: super::artifact::Kind,
    make: impl FnOnce(&OccupancyGrid, &Version) -> Vec<u8> + Send + 'static,
) -> ApiResult<Response> {
    let version = path.read(state).await?;
    let artifact = Artifact::derived(version.digest, kind);
    if artifact.is_known_to(headers) {
        return Ok(artifact.not_modified());
    }
    let cells = state.blobs.get(version.grid).await?;
    let headers = headers.clone();
    state
        .compute(move || {
            let grid = decode_cells(&cells).map_err(ApiError::internal)?;
            Ok(artifact.answer(&headers, make(&grid, &version).into()))
        })
        .await
}

/// The transforms
///
/// The pose of each placed robot's map frame (`ROBOT/map`) in the session frame (the anchor's, `ANCHOR/map`), as
/// `tf2_msgs/TFMessage`.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/versions/{version}/transforms", tag = "versions", operation_id = "get_transforms",
    params(VersionPath),
    responses(
        (status = 200, description = "The transforms", body = Transforms,
         headers(
            ("etag" = String, description = "Strong"),
            ("repr-digest" = String, description = "SHA-256 of the file (RFC 9530)"),
            ("content-digest" = String, description = "SHA-256 of what is sent: the file, or a part of it"),
         )),
        (status = 206, description = "The part that `Range` asks for"),
        (status = 304, description = "It is the one that `If-None-Match` names"),
        OfVersion,
    )
)]
pub(super) async fn transforms(
    State(state): State<AppState>,
    Path(path): Path<VersionPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    let version = path.read(&state).await?;
    let result: MergeResult = serde_json::from_str(version.result.as_str()).map_err(ApiError::internal)?;
    let json = serde_json::to_vec(&transforms_of(&version, &result)).map_err(ApiError::internal)?;
    let artifact = Artifact::derived(crate::model::Digest::of_bytes(&json), TRANSFORMS);
    if artifact.is_known_to(&headers) {
        return Ok(artifact.not_modified());
    }
    Ok(artifact.answer(&headers, json.into()))
}

fn transforms_of(version: &Version, result: &MergeResult) -> Transforms {
    let since_1970 = version.created_at.duration_since(crate::model::Timestamp::UNIX_EPOCH);
    let stamp = Stamp {
        sec: since_1970.as_secs(),
        nanosec: since_1970.subsec_nanos().unsigned_abs(),
    };
    let placed = result.maps.iter().filter(|map| map.status == PlacementStatus::Placed);
    let transform = |map: &api::MapPlacement| {
        map.pose.map(|pose| TransformStamped {
            header: TransformHeader {
                stamp,
                frame_id: frame(&result.anchor),
            },
            child_frame_id: frame(&map.name),
            transform: Transform::of_pose(pose),
        })
    };
    Transforms {
        transforms: placed
            .filter(|map| map.name != result.anchor)
            .filter_map(transform)
            .collect(),
    }
}

fn frame(robot: &str) -> String {
    format!("{robot}/map")
}
