//! An upload as a map: what its media type, query and parts mean.

use bytes::Bytes;
use serde::Deserialize;
use utoipa::IntoParams;

use super::error::{ApiError, ApiResult};
use super::extract::{Part, media_type, read_parts, unsupported};
use crate::api::{FieldError, ProblemCode};
use crate::codec::{Decoded, Limits, MapMeta, MapMode, OccupancyGridMessage, decode_image, decode_map};
use crate::geometry::Pose2;

/// The media types that an upload may have.
const MEDIA_TYPES: &str = "multipart/form-data, image/png, image/x-portable-graymap or application/json";

/// What a picture's YAML would say; only for pictures that come without one.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PictureQuery {
    /// Metres a pixel; needed with a raw picture, not allowed otherwise.
    #[param(minimum = 0.001, maximum = 100, example = 0.05)]
    resolution: Option<f64>,
    /// `x,y,yaw` of the lower-left corner of the lower-left pixel in the robot's map frame, in metres and radians;
    /// needed with a raw picture, not allowed otherwise.
    #[param(example = "-12.5,-8.0,0")]
    origin: Option<String>,
    /// Whether white means occupied.
    negate: Option<bool>,
    /// Occupied from this occupancy on. Default: 0.65.
    #[param(minimum = 0, maximum = 1)]
    occupied_thresh: Option<f64>,
    /// Free up to this occupancy. Default: 0.196.
    #[param(minimum = 0, maximum = 1)]
    free_thresh: Option<f64>,
    /// `trinary`, `scale` or `raw`. Default: trinary.
    mode: Option<String>,
    /// Name of the robot's map frame.
    frame_id: Option<String>,
}

/// An upload whose parts are sorted out, not decoded yet.
#[derive(Debug)]
pub(super) struct Upload {
    source: Source,
    frame_id: Option<String>,
}

#[derive(Debug)]
enum Source {
    Files { yaml: Bytes, image: Bytes },
    Picture { meta: MapMeta, image: Bytes },
    Message(Bytes),
}

/// A map out of an upload.
#[derive(Debug)]
pub(super) struct Uploaded {
    pub(super) decoded: Decoded,
    pub(super) frame_id: Option<String>,
}

impl Upload {
    /// Sorts out a body by its media type.
    pub(super) async fn read(content_type: &str, query: PictureQuery, body: Bytes) -> ApiResult<Self> {
        let frame_id = query.frame_id.clone().map(parse_frame_id).transpose()?;
        let source = match media_type(content_type).as_str() {
            "multipart/form-data" => {
                query.refuse("with a multipart body, whose part map says it")?;
                files(read_parts(content_type, body).await?)?
            }
            "application/json" => {
                query.refuse("with an OccupancyGrid, which says it itself")?;
                Source::Message(body)
            }
            "image/png" | "image/x-portable-graymap" | "image/x-portable-anymap" => Source::Picture {
                meta: query.meta()?,
                image: body,
            },
            _ => return Err(unsupported(Some(content_type), MEDIA_TYPES)),
        };
        Ok(Self { source, frame_id })
    }

    /// Decodes the map: takes its time, so not on a thread that serves requests.
    pub(super) fn decode(self, limits: &Limits) -> ApiResult<Uploaded> {
        let decoded = match &self.source {
            Source::Files { yaml, image } => decode_map(yaml, image, limits)?,
            Source::Picture { meta, image } => decode_image(image, meta, limits)?,
            Source::Message(json) => return Self::decode_message(json, self.frame_id, limits),
        };
        Ok(Uploaded {
            decoded,
            frame_id: self.frame_id,
        })
    }

    fn decode_message(json: &[u8], frame_id: Option<String>, limits: &Limits) -> ApiResult<Uploaded> {
        let message = OccupancyGridMessage::parse(json, limits)?;
        let grid = message.to_grid(limits)?;
        let named = Some(message.header.frame_id).filter(|name| !name.is_empty());
        Ok(Uploaded {
            decoded: Decoded {
                grid,
                warnings: Vec::new(),
            },
            frame_id: frame_id.or(named.map(parse_frame_id).transpose()?),
        })
    }
}

impl PictureQuery {
    fn refuse(&self, why: &str) -> ApiResult<()> {
        let given = [
            ("resolution", self.resolution.is_some()),
            ("origin", self.origin.is_some()),
            ("negate", self.negate.is_some()),
            ("occupied_thresh", self.occupied_thresh.is_some()),
            ("free_thresh", self.free_thresh.is_some()),
            ("mode", self.mode.is_some()),
        ];
        match given.into_iter().find(|(_, given)| *given) {
            None => Ok(()),
            Some((field, _)) => {
                let limit = format!("absent {why}");
                let error = ApiError::new(ProblemCode::InvalidQuery, format!("{field} must be {limit}"));
                Err(error.field(FieldError::missing(field, limit)))
            }
        }
    }

    fn meta(&self) -> ApiResult<MapMeta> {
        let missing = |field: &str, limit: &str| {
            ApiError::new(
                ProblemCode::InvalidQuery,
                format!("{field} is missing; a picture needs {limit}"),
            )
            .field(FieldError::missing(field, limit))
        };
        let resolution = self.resolution.ok_or_else(|| missing("resolution", "metres a pixel"))?;
        let origin = self.origin.as_deref();
        let origin = parse_origin(origin.ok_or_else(|| missing("origin", "x,y,yaw in metres and radians"))?)?;
        let meta = MapMeta::new(resolution, origin).map_err(|error| ApiError::bad_map("query", &error))?;
        let (free, occupied) = (meta.free_thresh(), meta.occupied_thresh());
        let meta = meta
            .with_thresholds(
                self.free_thresh.unwrap_or(free),
                self.occupied_thresh.unwrap_or(occupied),
            )
            .map_err(|error| ApiError::bad_map("query", &error))?;
        Ok(meta.with_negate(self.negate.unwrap_or(false)).with_mode(self.mode()?))
    }

    fn mode(&self) -> ApiResult<MapMode> {
        match self.mode.as_deref() {
            None | Some("trinary") => Ok(MapMode::Trinary),
            Some("scale") => Ok(MapMode::Scale),
            Some("raw") => Ok(MapMode::Raw),
            Some(other) => Err(ApiError::invalid("mode", other, "trinary, scale or raw")),
        }
    }
}

fn parse_origin(text: &str) -> ApiResult<Pose2> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, yaw]) => Pose2::parse(x, y, yaw),
        _ => None,
    }
    .ok_or_else(|| ApiError::invalid("origin", text, "x,y,yaw in metres and radians, all finite"))
}

/// Most characters of a frame's name.
const FRAME_ID_MAX: usize = 200;

fn parse_frame_id(name: String) -> ApiResult<String> {
    let plain = name.chars().count() <= FRAME_ID_MAX && !name.chars().any(char::is_control);
    if plain {
        Ok(name)
    } else {
        Err(ApiError::invalid(
            "frame_id",
            name,
            "at most 200 characters without control characters",
        ))
    }
}

/// The one map of a multipart body.
fn files(parts: Vec<Part>) -> ApiResult<Source> {
    let (mut yaml, mut image) = (None, None);
    for part in parts {
        let place = match part.name.as_str() {
            "map" => &mut yaml,
            "image" => &mut image,
            other => return Err(odd_part(other, "map or image")),
        };
        if place.replace(part.bytes).is_some() {
            return Err(odd_part(&part.name, "there once: an upload is one map"));
        }
    }
    let missing = |part: &str, limit: &str| {
        ApiError::new(
            ProblemCode::MalformedMultipart,
            format!("the part {part} is missing; it is {limit}"),
        )
        .field(FieldError::missing(part, limit))
    };
    Ok(Source::Files {
        yaml: yaml.ok_or_else(|| missing("map", "the YAML file"))?,
        image: image.ok_or_else(|| missing("image", "the picture, PNG or PGM"))?,
    })
}

/// Reads an upload as a push does; only for the targets under `fuzz/`.
///
/// # Errors
/// The refusal, in words.
#[cfg(fuzzing)]
pub async fn fuzzed_upload(content_type: &str, query: &str, body: Bytes, limits: &Limits) -> Result<Decoded, String> {
    let query = super::extract::parse_query(query).map_err(|error| error.to_string())?;
    let upload = Upload::read(content_type, query, body).await;
    let uploaded = upload.and_then(|upload| upload.decode(limits));
    uploaded.map(|map| map.decoded).map_err(|error| error.to_string())
}

/// A part that is not expected.
pub(super) fn odd_part(name: &str, limit: &str) -> ApiError {
    ApiError::new(
        ProblemCode::MalformedMultipart,
        format!("the part {name:?} must be {limit}"),
    )
    .field(FieldError::new("part", name, limit))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw() -> PictureQuery {
        PictureQuery {
            resolution: Some(0.05),
            origin: Some("1, 2, 0.5".to_owned()),
            ..PictureQuery::default()
        }
    }

    async fn decode(content_type: &str, query: PictureQuery, body: &'static [u8]) -> ApiResult<Uploaded> {
        Upload::read(content_type, query, Bytes::from_static(body))
            .await?
            .decode(&Limits::default())
    }

    #[tokio::test]
    async fn a_raw_picture_lies_where_its_query_says() {
        let map = decode("image/x-portable-graymap", raw(), b"P2 2 1 255 0 254")
            .await
            .expect("a map");
        let lattice = map.decoded.grid.lattice();
        assert!((lattice.origin().y() - 2.0).abs() < 1e-12 && (lattice.resolution() - 0.05).abs() < 1e-12);
        assert_eq!(map.decoded.grid.state_counts().occupied, 1);
    }

    #[tokio::test]
    async fn a_message_names_its_frame() {
        let json = br#"{"header": {"frame_id": "r1/map"}, "info": {"resolution": 0.1, "width": 2, "height": 1,
            "origin": {"position": {"x": 0, "y": 0}}}, "data": [0, 100]}"#;
        let map = decode("application/json; charset=utf-8", PictureQuery::default(), json)
            .await
            .expect("a map");
        assert_eq!(map.frame_id.as_deref(), Some("r1/map"));
    }

    #[tokio::test]
    async fn what_does_not_belong_together_is_refused_by_name() {
        let mut query = raw();
        query.origin = None;
        let error = decode("image/png", query, b"").await.expect_err("no origin");
        assert!(error.to_string().contains("origin is missing"), "{error}");
        let error = decode("application/json", raw(), b"{}").await.expect_err("twice said");
        assert!(error.to_string().contains("resolution must be absent"), "{error}");
        let error = decode("text/plain", PictureQuery::default(), b"")
            .await
            .expect_err("no map");
        assert!(error.to_string().contains("text/plain"), "{error}");
    }

    #[test]
    fn origins_are_three_finite_numbers() {
        assert!(parse_origin("1,2,3").is_ok());
        for bad in ["", "1,2", "1,2,3,4", "1,2,nan", "1;2;3"] {
            assert!(parse_origin(bad).is_err(), "{bad:?}");
        }
    }
}
