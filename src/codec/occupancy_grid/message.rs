//! The message as structs. Reading and writing them never builds a tree of JSON values.

use std::fmt;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::de::{self, Deserializer, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};

use super::CodecError;
use crate::geometry::Angle;

/// The message, field by field; fields that it does not name (stamps, load time) are ignored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct OccupancyGridMessage {
    /// The frame that the map is told in.
    #[serde(default)]
    pub header: Header,
    /// Size and place.
    pub info: Info,
    /// Occupancy in percent, row by row from the lowest, -1 for unknown. Read also from base64 of the signed bytes.
    #[schema(value_type = Vec<i8>)]
    pub data: CellValues,
}

/// `std_msgs/Header`, without the stamp.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Header {
    /// Name of the frame that the map is told in.
    #[serde(default)]
    pub frame_id: String,
}

/// `nav_msgs/MapMetaData`, without the load time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Info {
    /// Metres per cell.
    #[schema(minimum = 0.001, maximum = 100)]
    pub resolution: f64,
    /// Cells in a row.
    #[schema(minimum = 1)]
    pub width: u32,
    /// Rows.
    #[schema(minimum = 1)]
    pub height: u32,
    /// Pose of the lower-left corner of cell (0, 0).
    pub origin: Origin,
}

/// `geometry_msgs/Pose`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Origin {
    /// Where.
    pub position: Position,
    /// Which way; not turned when left out.
    #[serde(default)]
    pub orientation: Quaternion,
}

/// `geometry_msgs/Point`, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Position {
    /// Metres along x.
    pub x: f64,
    /// Metres along y.
    pub y: f64,
    /// Metres along z; a flat map has no use for it.
    #[serde(default)]
    pub z: f64,
}

/// `geometry_msgs/Quaternion`: must be a turn about z.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Quaternion {
    /// 0 for maps.
    pub x: f64,
    /// 0 for maps.
    pub y: f64,
    /// sin(yaw / 2).
    pub z: f64,
    /// cos(yaw / 2).
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self::of_yaw(Angle::ZERO)
    }
}

impl Quaternion {
    /// How far the length of a quaternion may be from 1: room for single precision and a few digits of text.
    const LENGTH_TOLERANCE: f64 = 0.01;
    /// How far the map's plane may be from level, in radians.
    const TILT_MAX: f64 = 0.002;

    pub(super) fn of_yaw(yaw: Angle) -> Self {
        let (z, w) = (yaw.radians() / 2.0).sin_cos();
        Self { x: 0.0, y: 0.0, z, w }
    }

    pub(super) fn yaw(self) -> Result<Angle, CodecError> {
        let Self { x, y, z, w } = self;
        let refuse = |expected| {
            let value = format!("({x}, {y}, {z}, {w})");
            Err(CodecError::bad_field("info.origin.orientation", value, expected))
        };
        let length = (x * x + y * y + z * z + w * w).sqrt();
        if length.is_nan() || (length - 1.0).abs() > Self::LENGTH_TOLERANCE {
            return refuse(format!("of length 1 +- {}", Self::LENGTH_TOLERANCE));
        }
        // the z axis turned by the quaternion leans by this angle
        let tilt = 2.0 * (x.hypot(y) / length).min(1.0).asin();
        if tilt > Self::TILT_MAX {
            return refuse(format!(
                "a turn about z: it leans by {tilt:.4} rad, at most {}",
                Self::TILT_MAX
            ));
        }
        Ok(Angle::from_radians(2.0 * z.atan2(w)))
    }
}

/// Occupancies as they stand in the message: -1 unknown, 0..=100 percent; a byte a cell.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct CellValues(pub Vec<i8>);

impl<'de> Deserialize<'de> for CellValues {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = CellValues;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "an array of whole numbers, or their bytes in base64")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut values: A) -> Result<CellValues, A::Error> {
                let mut cells = Vec::new();
                while let Some(CellValue(value)) = values.next_element()? {
                    cells.push(value);
                }
                Ok(CellValues(cells))
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<CellValues, E> {
                let bytes = STANDARD
                    .decode(text)
                    .map_err(|e| E::custom(format_args!("no base64: {e}")))?;
                Ok(CellValues(bytes.into_iter().map(u8::cast_signed).collect()))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// The values that mean something.
pub(super) const VALUES: &str = "-1 (unknown) or within 0 and 100";

struct CellValue(i8);

impl<'de> Deserialize<'de> for CellValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Percent;
        impl Visitor<'_> for Percent {
            type Value = CellValue;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{VALUES}")
            }
            fn visit_i64<E: de::Error>(self, value: i64) -> Result<CellValue, E> {
                match i8::try_from(value) {
                    Ok(value @ -1..=100) => Ok(CellValue(value)),
                    _ => Err(E::custom(format_args!("is {value}; it must be {VALUES}"))),
                }
            }
            fn visit_u64<E: de::Error>(self, value: u64) -> Result<CellValue, E> {
                match i8::try_from(value) {
                    Ok(value @ 0..=100) => Ok(CellValue(value)),
                    _ => Err(E::custom(format_args!("is {value}; it must be {VALUES}"))),
                }
            }
        }
        deserializer.deserialize_any(Percent)
    }
}
