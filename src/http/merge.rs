//! One-shot merges: maps in, the answer out, nothing kept.

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use utoipa::IntoParams;

use super::error::{ApiError, ApiResult};
use super::extract::{Part, Query, UploadBody, media_type, read_parts, unsupported};
use super::oneshot::{self, MapParts};
use super::refusals::BadOneShot;
use super::state::AppState;
use crate::api::{FieldError, MergeResult, ProblemCode};
use crate::codec::encode_png;
use crate::model::{MethodSpec, Resolution};
use crate::registration::MethodName;

/// How maps are merged at once.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct MergeQuery {
    /// The registration method. Default: the first of `/v1/methods`.
    #[param(value_type = Option<MethodName>)]
    method: Option<String>,
    /// Its parameters: a JSON object; those that are not named have their defaults.
    #[param(example = "{\"reach_m\": 0.5}")]
    parameters: Option<String>,
    /// Name of the map in whose frame the result is told: the stem of its file's name. Default: the first one.
    anchor: Option<String>,
    /// Metres a cell of the fused map. Default: as the anchor's map.
    #[param(value_type = Option<f64>, minimum = 0.001, maximum = 100)]
    resolution: Option<Resolution>,
}

/// The maps of a one-shot merge: each YAML names its picture by its file name.
#[derive(utoipa::ToSchema)]
#[expect(dead_code, reason = "only for the OpenAPI document")]
pub(super) struct MergeForm {
    /// The YAML files of two or more maps.
    #[schema(value_type = Vec<String>, format = Binary, min_items = 2)]
    map: Vec<Vec<u8>>,
    /// Their pictures, PNG or PGM.
    #[schema(value_type = Vec<String>, format = Binary, min_items = 2)]
    image: Vec<Vec<u8>>,
}

/// Merge at once
///
/// `curl -F map=@a.yaml -F image=@a.png -F map=@b.yaml -F image=@b.png URL/v1/merge`: two or more maps in one request,
/// each called by the stem of its YAML file's name; everything is told in the frame of the first one, or of `anchor`. The answer is the
/// document that `mapweld merge` writes, or the fused picture with `Accept: image/png`. Nothing is kept.
#[utoipa::path(
    post, path = "/v1/merge", tag = "one-shot", operation_id = "merge_now",
    params(MergeQuery),
    request_body(content = MergeForm, content_type = "multipart/form-data"),
    responses(
        (status = 200, description = "What is placed where, and why", content(
            (MergeResult = "application/json"),
            (inline(String) = "image/png"),
        )),
        BadOneShot,
    )
)]
pub(super) async fn merge(
    State(state): State<AppState>,
    headers: HeaderMap,
    Query(query): Query<MergeQuery>,
    UploadBody {
        content_type,
        bytes,
        place,
    }: UploadBody,
) -> ApiResult<Response> {
    let answer = Answer::accepted_by(&headers)?;
    let method = method(&query)?;
    if media_type(&content_type) != "multipart/form-data" {
        return Err(unsupported(Some(&content_type), "multipart/form-data"));
    }
    let parts = sort_out(read_parts(&content_type, bytes).await?, state.limits.maps)?;
    let _at_once = state.merges.enter()?;
    let order = oneshot::Order {
        parts,
        method,
        anchor: query.anchor,
        resolution: query.resolution.map(Resolution::metres),
        limits: state.limits.codec,
    };
    let welded = oneshot::run(&state, order, place).await?;
    Ok(match answer {
        Answer::Json => axum::Json(welded.result).into_response(),
        Answer::Png => {
            let picture = state.compute(move || Ok(encode_png(&welded.fused))).await?;
            ([(header::CONTENT_TYPE, HeaderValue::from_static("image/png"))], picture).into_response()
        }
    })
}

fn method(query: &MergeQuery) -> ApiResult<MethodSpec> {
    let name = match &query.method {
        None => MethodSpec::default().name(),
        Some(name) => name.parse().map_err(|error: crate::registration::UnknownMethod| {
            ApiError::invalid("method", name, &error.to_string())
        })?,
    };
    let parameters = match &query.parameters {
        None => None,
        Some(text) => Some(
            serde_json::from_str(text)
                .map_err(|error| ApiError::invalid("parameters", text, &format!("a JSON object: {error}")))?,
        ),
    };
    MethodSpec::new(name, parameters).map_err(|error| {
        let (sent, told) = (query.parameters.as_deref().unwrap_or_default(), error.to_string());
        ApiError::new(ProblemCode::InvalidRequest, &told).field(FieldError::new("parameters", sent, told))
    })
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Answer {
    Json,
    Png,
}

impl Answer {
    /// The one that `Accept` likes best; JSON when it likes both.
    fn accepted_by(headers: &HeaderMap) -> ApiResult<Self> {
        let mut accept = headers.get_all(header::ACCEPT).iter().peekable();
        if accept.peek().is_none() {
            return Ok(Self::Json);
        }
        let ranges: Vec<&str> = accept
            .filter_map(|value| value.to_str().ok())
            .flat_map(|value| value.split(','))
            .collect();
        let quality = |kind: &str, media_type: &str| {
            let matching = ranges.iter().filter_map(|range| {
                let mut parts = range.split(';').map(str::trim);
                let name = parts.next()?.to_ascii_lowercase();
                let closeness = match name.as_str() {
                    "*/*" => 0,
                    name if name == kind => 1,
                    name if name == media_type => 2,
                    _ => return None,
                };
                let q = parts.find_map(|parameter| parameter.strip_prefix("q=")?.parse::<f32>().ok());
                Some((closeness, q.unwrap_or(1.0)))
            });
            matching.max_by_key(|(closeness, _)| *closeness).map_or(0.0, |(_, q)| q)
        };
        let (json, png) = (
            quality("application/*", "application/json"),
            quality("image/*", "image/png"),
        );
        if json <= 0.0 && png <= 0.0 {
            let sent = ranges.join(",");
            let limit = "application/json or image/png";
            return Err(
                ApiError::new(ProblemCode::NotAcceptable, format!("this path answers {limit}"))
                    .field(FieldError::new("accept", sent, limit)),
            );
        }
        Ok(if png > json { Self::Png } else { Self::Json })
    }
}

/// The maps' YAML files and all pictures, in the order of the parts.
fn sort_out(parts: Vec<Part>, maps_max: usize) -> ApiResult<MapParts> {
    let mut sorted = MapParts::default();
    for part in parts {
        match part.name.as_str() {
            "map" => sorted.maps.push(part),
            "image" => sorted.images.push(part),
            other => return Err(super::upload::odd_part(other, "map or image")),
        }
    }
    let count = sorted.maps.len();
    if !(2..=maps_max).contains(&count) {
        let limit = format!("2 to {maps_max} maps");
        return Err(ApiError::new(
            ProblemCode::MalformedMultipart,
            format!("there are {count} parts named map; a merge takes {limit}"),
        )
        .field(FieldError::new("map", format!("{count} maps"), limit)));
    }
    Ok(sorted)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(accept: &str) -> Option<Answer> {
        let headers = HeaderMap::from_iter([(header::ACCEPT, HeaderValue::from_str(accept).expect("a header"))]);
        Answer::accepted_by(&headers).ok()
    }

    #[test]
    fn the_answer_is_json_unless_a_picture_is_liked_better() {
        assert_eq!(answer("*/*"), Some(Answer::Json));
        assert_eq!(answer("image/png"), Some(Answer::Png));
        assert_eq!(answer("image/*, application/json;q=0.5"), Some(Answer::Png));
        assert_eq!(answer("image/png;q=0.5, */*"), Some(Answer::Json));
        assert_eq!(answer("text/html"), None);
        assert_eq!(Answer::accepted_by(&HeaderMap::new()).expect("no wish"), Answer::Json);
    }
}
