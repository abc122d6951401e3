//! The YAML file of a ROS map: where the picture lies and what its grey values mean.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, Visitor};

use super::{CodecError, Limits, MapMeta, MapMode};
use crate::geometry::Pose2;
use crate::grid::{Lattice, LogOdds};

/// A map file: the name of its picture, and what it says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct MapYaml {
    /// Path of the picture, relative to the file; never empty.
    pub image: String,
    /// The rest.
    pub meta: MapMeta,
}

impl MapYaml {
    /// Reads the file. `image`, `resolution` and `origin` must be there; `negate` (0), `occupied_thresh` (0.65),
    /// `free_thresh` (0.196) and `mode` (trinary) have defaults; other keys are ignored.
    ///
    /// # Errors
    /// [`CodecError`] names the field, the value and what it must be.
    pub fn parse(yaml: &[u8], limits: &Limits) -> Result<Self, CodecError> {
        limits.check_yaml(yaml)?;
        let text = std::str::from_utf8(yaml).map_err(|e| CodecError::BadYaml(e.to_string()))?;
        let fields: Fields = serde_saphyr::from_str_with_options(text, options(limits))
            .map_err(|e| CodecError::BadYaml(e.to_string()))?;
        fields.parse()
    }
}

/// The budget of the YAML parser: enough for a file of one mapping with a list in it, nothing for one made to explode.
fn options(limits: &Limits) -> serde_saphyr::Options {
    serde_saphyr::options! {
        budget: serde_saphyr::budget! {
            max_depth: limits.yaml_depth,
            max_documents: 1,
            max_anchors: 16,
            max_aliases: 16,
            max_events: 4096,
            max_nodes: 2048,
        },
        with_snippet: false,
    }
}

#[derive(Deserialize)]
struct Fields {
    image: Option<String>,
    resolution: Option<f64>,
    origin: Option<Vec<f64>>,
    negate: Option<Negate>,
    occupied_thresh: Option<f64>,
    free_thresh: Option<f64>,
    mode: Option<String>,
}

impl Fields {
    fn parse(self) -> Result<MapYaml, CodecError> {
        let missing = |field, expected| CodecError::Missing { field, expected };
        let image = self.image.ok_or(missing("image", "the path of the picture"))?;
        if image.is_empty() {
            return Err(CodecError::bad_field("image", "empty", "the path of the picture"));
        }
        let resolution = self.resolution.ok_or(missing("resolution", "metres per pixel"))?;
        let origin = self.origin.ok_or(missing("origin", ORIGIN))?;
        let meta = MapMeta::new(resolution, parse_origin(&origin)?)?
            .with_thresholds(
                self.free_thresh.unwrap_or(LogOdds::FREE_MAX),
                self.occupied_thresh.unwrap_or(LogOdds::OCCUPIED_MIN),
            )?
            .with_negate(self.negate.is_some_and(|Negate(negate)| negate))
            .with_mode(self.mode.as_deref().map_or(Ok(MapMode::default()), parse_mode)?);
        Ok(MapYaml { image, meta })
    }
}

const ORIGIN: &str = "[x, y, yaw] in metres and radians, all finite";

fn parse_origin(origin: &[f64]) -> Result<Pose2, CodecError> {
    match *origin {
        [x, y, yaw] => Pose2::parse(x, y, yaw),
        _ => None,
    }
    .ok_or_else(|| CodecError::bad_field("origin", format!("{origin:?}"), ORIGIN))
}

fn parse_mode(mode: &str) -> Result<MapMode, CodecError> {
    match mode.to_ascii_lowercase().as_str() {
        "trinary" => Ok(MapMode::Trinary),
        "scale" => Ok(MapMode::Scale),
        "raw" => Ok(MapMode::Raw),
        _ => Err(CodecError::bad_field(
            "mode",
            format!("{mode:?}"),
            "trinary, scale or raw",
        )),
    }
}

/// A truth value that map files write as 0 and 1 or as a YAML boolean.
struct Negate(bool);

impl<'de> Deserialize<'de> for Negate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl Visitor<'_> for Either {
            type Value = Negate;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "negate to be 0, 1, false or true")
            }
            fn visit_bool<E: de::Error>(self, value: bool) -> Result<Negate, E> {
                Ok(Negate(value))
            }
            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Negate, E> {
                let value = u64::try_from(value).map_err(|_| E::invalid_value(de::Unexpected::Signed(value), &self))?;
                self.visit_u64(value)
            }
            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Negate, E> {
                match value {
                    0 | 1 => Ok(Negate(value == 1)),
                    _ => Err(E::invalid_value(de::Unexpected::Unsigned(value), &self)),
                }
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// The map file for a picture of this lattice that [`encode_png`](super::encode_png) or
/// [`encode_pgm`](super::encode_pgm) has written.
///
/// `free_thresh` is 0.196: with the 0.25 of old map savers every unknown cell (grey 205, occupancy 0.19608) reads as free.
/// Numbers are written without exponent, which some YAML readers take for text.
#[must_use]
pub fn encode_yaml(lattice: &Lattice, image_name: &str) -> String {
    let origin = lattice.origin();
    format!(
        "image: {}\nmode: trinary\nresolution: {}\norigin: [{}, {}, {}]\nnegate: 0\noccupied_thresh: {}\nfree_thresh: {}\n",
        scalar(image_name),
        lattice.resolution(),
        origin.x(),
        origin.y(),
        origin.yaw().radians(),
        LogOdds::OCCUPIED_MIN,
        LogOdds::FREE_MAX,
    )
}

/// A file name as a YAML scalar: plain when nothing in it means anything to YAML, else in JSON's quotes, which YAML reads.
fn scalar(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '/' | '-');
    if name.chars().all(plain) && name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.contains('.') {
        return name.to_owned();
    }
    serde_json::to_string(name).expect("invariant: every string is a JSON string")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use proptest::prelude::*;

    fn parse(yaml: &str) -> Result<MapYaml, String> {
        MapYaml::parse(yaml.as_bytes(), &Limits::default()).map_err(|e| e.to_string())
    }

    fn with(change: &str) -> Result<MapYaml, String> {
        let (key, _) = change.split_once(':').expect("a key");
        let whole = ["image: m.png", "resolution: 0.05", "origin: [1.0, -2.0, 0.5]"];
        let rest = whole.iter().filter(|line| !line.starts_with(&format!("{key}:")));
        parse(
            &rest
                .chain([&change])
                .fold(String::new(), |yaml, line| yaml + line + "\n"),
        )
    }

    #[test]
    fn what_a_map_file_leaves_out_has_the_defaults_of_map_server() {
        let map = with("description: keys that we do not know are no error").expect("a good file");
        assert_eq!(map.image, "m.png");
        let meta = map.meta;
        assert_eq!(meta.origin(), Pose2::new(1.0, -2.0, Angle::from_radians(0.5)));
        assert_eq!((meta.free_thresh(), meta.occupied_thresh()), (0.196, 0.65));
        assert_eq!((meta.mode(), meta.negate()), (MapMode::Trinary, false));
    }

    #[test]
    fn modes_and_negate_are_read_as_map_server_reads_them() {
        assert_eq!(with("mode: Scale").map(|m| m.meta.mode()), Ok(MapMode::Scale));
        assert_eq!(with("mode: raw").map(|m| m.meta.mode()), Ok(MapMode::Raw));
        for (yaml, negate) in [
            ("0", false),
            ("1", true),
            ("false", false),
            ("true", true),
            ("True", true),
        ] {
            assert_eq!(
                with(&format!("negate: {yaml}")).map(|m| m.meta.negate()),
                Ok(negate),
                "{yaml}"
            );
        }
    }

    #[test]
    fn errors_name_the_field_the_value_and_the_limit() {
        let cases = [
            ("mode: binary", "mode is \"binary\"; it must be trinary, scale or raw"),
            (
                "resolution: 0",
                "resolution 0 m/cell is out of range: it must lie within 0.001 and 100",
            ),
            (
                "resolution: -0.05",
                "resolution -0.05 m/cell is out of range: it must lie within 0.001 and 100",
            ),
            (
                "resolution: .nan",
                "resolution NaN m/cell is out of range: it must lie within 0.001 and 100",
            ),
            (
                "origin: [.nan, 0, 0]",
                "origin is [NaN, 0.0, 0.0]; it must be [x, y, yaw] in metres and radians, all finite",
            ),
            (
                "origin: [1, 2]",
                "origin is [1.0, 2.0]; it must be [x, y, yaw] in metres and radians, all finite",
            ),
            (
                "origin: [1e9, 0, 0]",
                "origin (1000000000, 0) m is out of range: each must lie within +-100000000 m",
            ),
            (
                "occupied_thresh: 1.5",
                "occupied_thresh is 1.5; it must be within 0 and 1",
            ),
            ("free_thresh: -0.1", "free_thresh is -0.1; it must be within 0 and 1"),
            (
                "free_thresh: 0.65",
                "free_thresh is 0.65; it must be below occupied_thresh, which is 0.65",
            ),
            ("free_thresh: .nan", "free_thresh is NaN; it must be within 0 and 1"),
            ("image: ''", "image is empty; it must be the path of the picture"),
        ];
        for (change, message) in cases {
            assert_eq!(with(change).expect_err(change), message);
        }
        assert_eq!(
            parse("image: m.png\norigin: [0, 0, 0]").expect_err("no resolution"),
            "resolution is missing; it must be metres per pixel"
        );
        for (change, part) in [
            ("negate: 7", "negate"),
            ("resolution: five", "five"),
            ("resolution: [1]", "resolution"),
        ] {
            let message = with(change).expect_err(change);
            assert!(message.contains("bad map YAML"), "{message}");
            assert!(message.contains(part) || message.contains("line"), "{message}");
        }
    }

    #[test]
    fn files_made_to_explode_are_refused() {
        let deep = format!("image: m.png\nx: {}{}", "[".repeat(100), "]".repeat(100));
        assert!(parse(&deep).is_err());
        let mut laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n".to_owned();
        for i in 1..12 {
            let alias = format!("*a{}, ", i - 1).repeat(10);
            laughs = format!("{laughs}a{i}: &a{i} [{alias}]\n");
        }
        assert!(parse(&laughs).is_err());
        let long = "#".repeat(1 << 17);
        assert_eq!(
            parse(&long).expect_err("long"),
            "YAML of 131072 bytes is over the limit of 65536 bytes"
        );
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back_exactly(x in -1e8..1e8_f64, y in -1e-9..1e-9_f64, yaw in -4.0..4.0_f64,
                                                resolution in 0.001..100.0_f64, name in "[^\\p{C}]{1,20}") {
            let lattice = Lattice::new(3, 2, resolution, Pose2::new(x, y, Angle::from_radians(yaw))).expect("valid");
            let yaml = encode_yaml(&lattice, &name);
            let back = parse(&yaml).map_err(TestCaseError::fail)?;
            prop_assert_eq!(back.image, name);
            prop_assert_eq!(back.meta.origin(), lattice.origin());
            prop_assert_eq!(back.meta.resolution().to_bits(), resolution.to_bits());
        }

        #[test]
        fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), text in "\\PC{0,200}") {
            let _ = MapYaml::parse(&bytes, &Limits::default());
            let _ = MapYaml::parse(text.as_bytes(), &Limits::default());
        }
    }
}
