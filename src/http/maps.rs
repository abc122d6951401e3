//! Maps: pushed by robots, and read back.

use axum::Json;
use axum::extract::{Extension, State};
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::Response;
use bytes::Bytes;
use serde::Deserialize;
use utoipa::IntoParams;

use super::artifact::{Artifact, PNG};
use super::error::{ApiError, ApiResult};
use super::extract::{Path, Query, UploadBody, parsed};
use super::list::ListQuery;
use super::refusals::{BadUpload, OfMap, OfPicture, SessionList};
use super::sessions::SessionPath;
use super::state::{AppState, to_the_end};
use super::upload::{PictureQuery, Upload, Uploaded};
use crate::api::{Map, Page, Pushed};
use crate::codec::{OccupancyGridMessage, decode_cells, encode_cells, encode_png};
use crate::failpoint::{self, Point};
use crate::meters;
use crate::model::{JobId, MapId, NewMap, RobotId, SessionId, SessionSettings, TraceParent};
use crate::store::{AddMap, StoreError, keep_blob};
use crate::telemetry;

/// The robot of a path.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct RobotPath {
    /// Name of the session.
    session: SessionId,
    /// Name of the robot.
    robot: RobotId,
}

/// The map of a path.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct MapPath {
    /// Name of the session.
    session: SessionId,
    /// Id of the map.
    #[serde(deserialize_with = "parsed")]
    map: MapId,
}

/// A map of a multipart upload.
#[derive(utoipa::ToSchema)]
#[expect(dead_code, reason = "only for the OpenAPI document")]
pub(super) struct MapForm {
    /// The YAML file of the map.
    #[schema(value_type = String, format = Binary)]
    map: Vec<u8>,
    /// Its picture, PNG or PGM.
    #[schema(value_type = String, format = Binary)]
    image: Vec<u8>,
}

/// Push a map
///
/// The newest map of a robot replaces its earlier ones in the next merge. Send the two files of a ROS map as
/// multipart/form-data (`curl -F map=@r1.yaml -F image=@r1.pgm`), a picture with its place in the query, or a
/// `nav_msgs/OccupancyGrid` as JSON (data as an array or as base64). The session is made when it is not there.
///
/// With `Content-Digest` (RFC 9530) a body that was damaged on its way is refused. 201 says that the map is on disk. The same content from the same robot again changes nothing: 200 and the same id.
#[utoipa::path(
    post, path = "/v1/sessions/{session}/robots/{robot}/maps", tag = "maps", operation_id = "push_map",
    params(RobotPath, PictureQuery),
    request_body(content(
        (MapForm = "multipart/form-data"),
        (inline(String) = "image/png"),
        (inline(String) = "image/x-portable-graymap"),
        (OccupancyGridMessage = "application/json"),
    )),
    responses(
        (status = 201, description = "It is kept", body = Pushed,
         headers(("location" = String, description = "Path of the map"))),
        (status = 200, description = "The session had this map of this robot", body = Pushed,
         headers(("location" = String, description = "Path of the map"))),
        BadUpload,
    )
)]
pub(super) async fn push(
    State(state): State<AppState>,
    Path(path): Path<RobotPath>,
    Query(query): Query<PictureQuery>,
    Extension(trace): Extension<TraceParent>,
    UploadBody {
        content_type,
        bytes,
        place,
    }: UploadBody,
) -> ApiResult<(StatusCode, [(HeaderName, String); 1], Json<Pushed>)> {
    let upload = Upload::read(&content_type, query, bytes).await?;
    // In a task of its own: a robot that hangs up now finds its map when it comes again.
    let pushed = to_the_end(async move {
        let limits = state.limits.codec;
        let kept = state
            .compute(move || {
                let Uploaded { decoded, frame_id } = upload.decode(&limits)?;
                let cells = Bytes::from(encode_cells(&decoded.grid));
                Ok((decoded, frame_id, cells))
            })
            .await?;
        drop(place);
        keep(&state, path, trace, kept).await
    });
    let pushed = pushed.await?;
    if let Some(job) = &pushed.job {
        telemetry::tell_job(job);
    }
    let status = if pushed.created {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let location = format!("/v1/sessions/{}/maps/{}", pushed.map.session, pushed.map.id);
    Ok((status, [(header::LOCATION, location)], Json(pushed)))
}

/// First the blob, then the row: whatever happens in between, no row is without its blob.
async fn keep(
    state: &AppState,
    RobotPath { session, robot }: RobotPath,
    trace: TraceParent,
    (decoded, frame_id, cells): (crate::codec::Decoded, Option<String>, Bytes),
) -> ApiResult<Pushed> {
    let blob = keep_blob(&*state.store, &state.blobs, cells.clone(), state.clock.now()).await?;
    failpoint::reach(Point::AfterBlob);
    let map = NewMap {
        frame_id,
        warnings: decoded.warnings.iter().map(ToString::to_string).collect(),
        ..NewMap::of(&decoded.grid, blob)
    };
    let add = AddMap {
        session,
        create_session: state.auto_create.then(SessionSettings::default),
        robot,
        id: MapId::new(state.ids.next()),
        job: JobId::new(state.ids.next()),
        map,
        trace: Some(trace),
    };
    let added = match state.store.add_map_and_enqueue(add.clone(), state.clock.now()).await {
        Err(StoreError::BlobRemoved(_)) => {
            // somebody has just removed the same bytes, which nothing needed until now
            keep_blob(&*state.store, &state.blobs, cells, state.clock.now()).await?;
            state.store.add_map_and_enqueue(add, state.clock.now()).await?
        }
        added => added?,
    };
    failpoint::reach(Point::AfterCommit);
    meters::upload(added.created);
    Ok(Pushed {
        created: added.created,
        job: added.map.job,
        map: added.map.into(),
    })
}

/// Which maps of a list.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct MapListQuery {
    /// Only maps of this robot.
    robot: Option<RobotId>,
    /// Most items of the page.
    #[param(default = 50, minimum = 1, maximum = 200)]
    page_size: Option<u32>,
    /// `next_page_token` of the page before.
    page_token: Option<String>,
}

/// List maps
///
/// The newest first.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/maps", tag = "maps", operation_id = "list_maps",
    params(SessionPath, MapListQuery),
    responses((status = 200, description = "One page", body = Page<Map>), SessionList)
)]
pub(super) async fn list(
    State(state): State<AppState>,
    Path(SessionPath { session }): Path<SessionPath>,
    Query(query): Query<MapListQuery>,
) -> ApiResult<Json<Page<Map>>> {
    let list = ListQuery::new(query.page_size, query.page_token);
    let maps = state
        .store
        .list_maps(&session, query.robot.as_ref(), &list.page()?)
        .await?;
    list.answer(maps, |map| map.id).map(Json)
}

/// Read a map
#[utoipa::path(
    get, path = "/v1/sessions/{session}/maps/{map}", tag = "maps", operation_id = "get_map",
    params(MapPath),
    responses((status = 200, description = "What is known of it", body = Map), OfMap)
)]
pub(super) async fn get(
    State(state): State<AppState>,
    Path(MapPath { session, map }): Path<MapPath>,
) -> ApiResult<Json<Map>> {
    Ok(Json(state.store.get_map(&session, map).await?.into()))
}

/// A map as a picture
///
/// As `map_server` writes it: free 254, occupied 0, unknown 205.
#[utoipa::path(
    get, path = "/v1/sessions/{session}/maps/{map}.png", tag = "maps", operation_id = "get_map_png",
    params(MapPath),
    responses(
        (status = 200, description = "The picture", body = inline(String), content_type = "image/png",
         headers(
            ("etag" = String, description = "Strong"),
            ("repr-digest" = String, description = "SHA-256 of the file (RFC 9530)"),
            ("content-digest" = String, description = "SHA-256 of what is sent: the file, or a part of it"),
         )),
        (status = 206, description = "The part that `Range` asks for"),
        (status = 304, description = "It is the one that `If-None-Match` names"),
        OfPicture,
    )
)]
pub(super) async fn png(
    State(state): State<AppState>,
    Path(MapPath { session, map }): Path<MapPath>,
    headers: HeaderMap,
) -> ApiResult<Response> {
    let record = state.store.get_map(&session, map).await?;
    let artifact = Artifact::derived(record.map.digest, PNG);
    if artifact.is_known_to(&headers) {
        return Ok(artifact.not_modified());
    }
    let cells = state.blobs.get(record.map.blob).await?;
    state
        .compute(move || {
            let picture = encode_png(&decode_cells(&cells).map_err(ApiError::internal)?);
            Ok(artifact.answer(&headers, picture.into()))
        })
        .await
}
