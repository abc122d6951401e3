//! Maps as bytes: ROS `map_server` YAML with PNG or PGM, `nav_msgs/OccupancyGrid` as JSON, pictures for people.
//!
//! Imports `geometry` and `grid` only. Pure: bytes in, values out; no files. Whatever the bytes are, the answer is a
//! grid or a [`CodecError`] that names the field, the value and the limit; [`Limits`] hold before memory is taken.
//! Only `image` turns pictures (first row on top) into grids (row 0 lowest) and back.

mod error;
mod image;
mod limits;
mod map_meta;
mod map_yaml;
mod occupancy_grid;
mod overlay;
mod picture;

pub use error::{CodecError, Warning};
pub use image::{decode_cells, decode_image, encode_cells, encode_pgm, encode_png};
pub use limits::Limits;
pub use map_meta::{MapMeta, MapMode};
pub use map_yaml::{MapYaml, encode_yaml};
pub use occupancy_grid::{
    CellValues, Header, Info, OccupancyGridMessage, Origin, Position, Quaternion, decode_occupancy_grid,
    encode_occupancy_grid,
};
pub use overlay::{OverlayLayer, overlay};
pub use picture::{Picture, Rgb};

use crate::grid::OccupancyGrid;

/// A map, and what its author should know about how it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Decoded {
    /// The map.
    pub grid: OccupancyGrid,
    /// What is odd about the file; empty for most.
    pub warnings: Vec<Warning>,
}

/// Reads a ROS map: its YAML and the picture that belongs to it (PNG or PGM, told by its first bytes).
///
/// ```
/// use mapweld::codec::{Limits, decode_map};
/// let yaml = b"{image: m.pgm, resolution: 0.05, origin: [-1.0, 2.0, 0.0], negate: 0, \
///              occupied_thresh: 0.65, free_thresh: 0.196}";
/// let picture = b"P2 3 1 255 0 254 205";
/// let map = decode_map(yaml, picture, &Limits::default())?;
/// assert_eq!(map.grid.state_counts().occupied, 1);
/// assert!(map.warnings.is_empty());
/// # Ok::<(), mapweld::codec::CodecError>(())
/// ```
///
/// # Errors
/// [`CodecError`] when either is not what it should be, or over the limits.
pub fn decode_map(yaml: &[u8], picture: &[u8], limits: &Limits) -> Result<Decoded, CodecError> {
    decode_image(picture, &MapYaml::parse(yaml, limits)?.meta, limits)
}
