//! `nav_msgs/OccupancyGrid` as JSON, as rosbridge and most tools write it.

mod message;
mod texts;

pub use message::{CellValues, Header, Info, OccupancyGridMessage, Origin, Position, Quaternion};

use super::{CodecError, Limits};
use crate::geometry::Pose2;
use crate::grid::{Lattice, LogOdds, OccupancyGrid};
use message::VALUES;

/// Reads the message as a map.
///
/// Memory: a byte a cell besides the map's two.
///
/// # Errors
/// [`CodecError`] when it is no such message or over the limits: with the field, the value and what it must be.
pub fn decode_occupancy_grid(json: &[u8], limits: &Limits) -> Result<OccupancyGrid, CodecError> {
    OccupancyGridMessage::parse(json, limits)?.to_grid(limits)
}

/// Writes a map as the message, in one line.
#[must_use]
pub fn encode_occupancy_grid(grid: &OccupancyGrid, frame_id: &str) -> Vec<u8> {
    to_json(&OccupancyGridMessage::new(grid, frame_id))
}

fn to_json(message: &OccupancyGridMessage) -> Vec<u8> {
    serde_json::to_vec(message).expect("invariant: finite numbers and strings are JSON")
}

impl OccupancyGridMessage {
    /// Reads the message, without a look at what its fields mean together.
    ///
    /// # Errors
    /// When it is too long or a text in it is, when it is no JSON, or when a field is missing or of the wrong kind.
    pub fn parse(json: &[u8], limits: &Limits) -> Result<Self, CodecError> {
        limits.check_bytes("JSON", json)?;
        texts::check(json)?;
        let mut deserializer = serde_json::Deserializer::from_slice(json);
        let message =
            serde_path_to_error::deserialize(&mut deserializer).map_err(|error| match error.path().to_string() {
                path if path == "." => CodecError::BadJson(error.into_inner().to_string()),
                path => CodecError::BadJson(format!("{path}: {}", error.into_inner())),
            })?;
        deserializer.end().map_err(|e| CodecError::BadJson(e.to_string()))?;
        Ok(message)
    }

    /// The map of the message.
    ///
    /// # Errors
    /// When size, place or values are out of range, or do not go together.
    pub fn to_grid(&self, limits: &Limits) -> Result<OccupancyGrid, CodecError> {
        let Info { width, height, .. } = self.info;
        let count = limits.check_cells(width, height)?;
        let values = &self.data.0;
        if values.len() != count {
            let expected = format!("as long as width x height, which is {width} x {height} = {count}");
            return Err(CodecError::bad_field("the length of data", values.len(), expected));
        }
        let lattice = self.info.lattice()?;
        let table: Vec<LogOdds> = (0..=100)
            .map(|percent| LogOdds::from_probability(f64::from(percent) / 100.0))
            .collect();
        let mut grid =
            OccupancyGrid::try_unknown(lattice).map_err(|reason| CodecError::NoMemory { cells: count, reason })?;
        for (index, (cell, &value)) in grid.cells_mut().iter_mut().zip(values).enumerate() {
            *cell = match usize::try_from(value) {
                Ok(percent @ 0..=100) => table[percent],
                Err(_) if value == -1 => LogOdds::UNKNOWN,
                _ => {
                    return Err(CodecError::BadCell {
                        index,
                        value,
                        expected: VALUES,
                    });
                }
            };
        }
        Ok(grid)
    }

    /// The message of a map: percents rounded, cells that nobody has seen -1.
    #[must_use]
    pub fn new(grid: &OccupancyGrid, frame_id: &str) -> Self {
        let lattice = grid.lattice();
        let origin = lattice.origin();
        Self {
            header: Header {
                frame_id: frame_id.to_owned(),
            },
            info: Info {
                resolution: lattice.resolution(),
                width: lattice.width(),
                height: lattice.height(),
                origin: Origin {
                    position: Position {
                        x: origin.x(),
                        y: origin.y(),
                        z: 0.0,
                    },
                    orientation: Quaternion::of_yaw(origin.yaw()),
                },
            },
            data: CellValues(grid.cells().iter().map(|&cell| percent(cell)).collect()),
        }
    }
}

impl Info {
    fn lattice(&self) -> Result<Lattice, CodecError> {
        let Position { x, y, .. } = self.origin.position;
        let yaw = self.origin.orientation.yaw()?;
        let origin = Pose2::parse(x, y, yaw.radians())
            .ok_or_else(|| CodecError::bad_field("info.origin.position", format!("({x}, {y})"), "finite"))?;
        Ok(Lattice::new(self.width, self.height, self.resolution, origin)?)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a probability in percent lies in 0..=100"
)]
fn percent(cell: LogOdds) -> i8 {
    cell.probability().map_or(-1, |p| (p * 100.0).round() as i8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use proptest::prelude::*;

    fn message(orientation: &str, size: &str, data: &str) -> String {
        format!(
            r#"{{"header": {{"stamp": {{"sec": 1, "nanosec": 2}}, "frame_id": "map"}},
                 "info": {{"map_load_time": {{"sec": 0}}, "resolution": 0.05, {size}, "origin":
                 {{"position": {{"x": 1.5, "y": -2, "z": 0}}, "orientation": {orientation}}}}}, "data": {data}}}"#
        )
    }

    const LEVEL: &str = r#"{"x": 0, "y": 0, "z": 0, "w": 1}"#;
    const SIZE: &str = r#""width": 3, "height": 2"#;

    fn decode(json: &str) -> Result<OccupancyGrid, String> {
        decode_occupancy_grid(json.as_bytes(), &Limits::default()).map_err(|e| e.to_string())
    }

    #[test]
    fn a_message_of_rosbridge_reads_row_by_row_from_the_lowest() {
        let grid = decode(&message(LEVEL, SIZE, "[0, 100, -1, 40, 65, 1]")).expect("a good message");
        assert_eq!(grid.at(0, 0), LogOdds::FREE);
        assert_eq!(grid.at(1, 0), LogOdds::OCCUPIED);
        assert_eq!(grid.at(2, 0), LogOdds::UNKNOWN);
        assert!(grid.at(0, 1).is_known());
        assert_eq!(grid.lattice().origin(), Pose2::new(1.5, -2.0, Angle::ZERO));
        let bytes = STANDARD.encode([0, 100, 255, 40, 65, 1]);
        assert_eq!(decode(&message(LEVEL, SIZE, &format!("{bytes:?}"))), Ok(grid));
    }

    #[test]
    fn header_and_orientation_may_be_left_out() {
        let json = r#"{"data": [-1], "info": {"resolution": 1, "width": 1, "height": 1, "origin": {"position": {"x": 0, "y": 0}}}}"#;
        assert_eq!(decode(json).map(|grid| grid.lattice().cell_count()), Ok(1));
    }

    #[test]
    fn the_yaw_of_the_quaternion_is_the_origins() {
        let grid = decode(&message(
            r#"{"x": 0, "y": 0, "z": -0.70710678, "w": 0.70710678}"#,
            SIZE,
            "[0,0,0,0,0,0]",
        ))
        .expect("turned by a quarter");
        assert!((grid.lattice().origin().yaw() + Angle::QUARTER_TURN).magnitude() < 1e-7);
    }

    #[test]
    fn errors_name_the_field_the_value_and_the_limit() {
        let six = "[0,0,0,0,0,0]";
        let cases = [
            (
                message(LEVEL, SIZE, "[0, 0, 0, 0, 101, 0]"),
                "data[4]: is 101; it must be -1 (unknown) or within 0 and 100",
            ),
            (message(LEVEL, SIZE, "[0, -2]"), "data[1]: is -2; it must be"),
            (
                message(LEVEL, SIZE, "[0, 0.5]"),
                "data[1]: invalid type: floating point `0.5`",
            ),
            (
                message(LEVEL, SIZE, "\"AAAAAGUA\""),
                "data[4] is 101; it must be -1 (unknown) or within 0 and 100",
            ),
            (message(LEVEL, SIZE, "\"AA==A\""), "data: no base64"),
            (
                message(LEVEL, SIZE, "[0]"),
                "the length of data is 1; it must be as long as width x height, which is 3 x 2 = 6",
            ),
            (
                message(LEVEL, r#""width": -3, "height": 2"#, six),
                "info.width: invalid value: integer `-3`",
            ),
            (message(LEVEL, r#""width": 0, "height": 2"#, six), "has no cell"),
            (
                message(LEVEL, r#""width": 99999, "height": 99999"#, six),
                "over the limit of 67108864 cells",
            ),
            (message(LEVEL, r#""height": 2"#, six), "info: missing field `width`"),
            (
                message(r#"{"x": 0, "y": 0, "z": 0, "w": 0}"#, SIZE, six),
                "info.origin.orientation is (0, 0, 0, 0); it must be of length 1 +- 0.01",
            ),
            (
                message(r#"{"x": 0.1, "y": 0, "z": 0, "w": 0.995}"#, SIZE, six),
                "it leans by 0.2",
            ),
            ("{".to_owned(), "EOF"),
            (message(LEVEL, SIZE, six) + "x", "trailing characters"),
        ];
        for (json, part) in cases {
            let error = decode(&json).expect_err(part);
            assert!(error.contains(part), "{error:?} does not say {part:?}");
        }
    }

    fn any_percents() -> impl Strategy<Value = (u32, u32, Vec<i8>)> {
        (1_u32..20, 1_u32..20).prop_flat_map(|(width, height)| {
            (
                Just(width),
                Just(height),
                proptest::collection::vec(-1_i8..=100, (width * height) as usize),
            )
        })
    }

    proptest! {
        #[test]
        fn every_percent_and_the_pose_survive_the_way_there_and_back((width, height, values) in any_percents(),
                                                                     x in -1e6..1e6_f64, yaw in -4.0..4.0_f64) {
            let origin = Pose2::new(x, -x, Angle::from_radians(yaw));
            let lattice = Lattice::new(width, height, 0.05, origin).expect("valid");
            let mut first = OccupancyGridMessage::new(&OccupancyGrid::unknown(lattice), "map");
            first.data = CellValues(values);
            let grid = first.to_grid(&Limits::default()).expect("a good message");
            let json = encode_occupancy_grid(&grid, "map");
            let second = OccupancyGridMessage::parse(&json, &Limits::default()).expect("our own message");
            prop_assert_eq!(&second.data, &first.data);
            let back = second.to_grid(&Limits::default()).expect("our own message");
            prop_assert_eq!(back.cells(), grid.cells());
            prop_assert_eq!(back.lattice().origin().x().to_bits(), origin.x().to_bits());
            prop_assert!((back.lattice().origin().yaw() - origin.yaw()).magnitude() < 1e-12);
        }

        #[test]
        fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), at in 0..400_usize) {
            let _ = decode_occupancy_grid(&bytes, &Limits::default());
            let mut whole = message(LEVEL, SIZE, "[0, 100, -1, 40, 65, 1]").into_bytes();
            whole.truncate(at);
            let _ = decode_occupancy_grid(&whole, &Limits::default());
            for (byte, noise) in whole.iter_mut().skip(at / 2).zip(bytes) {
                *byte = noise;
            }
            let _ = decode_occupancy_grid(&whole, &Limits::default());
        }
    }
}
