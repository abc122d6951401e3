//! What a map is called after its content.

use std::fmt::{self, Write as _};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::CodecError;
use crate::grid::OccupancyGrid;

/// SHA-256 over the lattice and every cell of a map: equal exactly when the maps are equal, whatever files they came
/// in. 64 lower-case hexadecimal digits as text.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct MapDigest([u8; 32]);

/// The digest of a map.
///
/// Taken over: a tag with the version of this layout, width and height (u32), resolution, origin x, y and yaw (f64,
/// zero without sign), then the cells row by row from the lowest (i16); all little-endian.
#[must_use]
pub fn digest(grid: &OccupancyGrid) -> MapDigest {
    let lattice = grid.lattice();
    let origin = lattice.origin();
    let mut hash = Sha256::new();
    hash.update(b"mapweld map 1\n");
    hash.update(lattice.width().to_le_bytes());
    hash.update(lattice.height().to_le_bytes());
    for number in [lattice.resolution(), origin.x(), origin.y(), origin.yaw().radians()] {
        hash.update((number + 0.0).to_le_bytes()); // -0.0 + 0.0 is 0.0
    }
    let mut bytes = Vec::with_capacity(2 * lattice.width() as usize);
    for row in 0..lattice.height() {
        bytes.clear();
        bytes.extend(grid.row(row).iter().flat_map(|cell| cell.to_bits().to_le_bytes()));
        hash.update(&bytes);
    }
    MapDigest(hash.finalize().into())
}

impl MapDigest {
    /// The 32 bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl fmt::Display for MapDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = String::with_capacity(64);
        for byte in self.0 {
            write!(text, "{byte:02x}")?;
        }
        f.pad(&text)
    }
}

impl fmt::Debug for MapDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MapDigest({self})")
    }
}

impl FromStr for MapDigest {
    type Err = CodecError;
    fn from_str(text: &str) -> Result<Self, CodecError> {
        let digit = |c: u8| match c {
            b'0'..=b'9' => Some(c - b'0'),
            b'a'..=b'f' => Some(c - b'a' + 10),
            _ => None,
        };
        let parse = || {
            let (pairs, []) = text.as_bytes().as_chunks::<2>() else {
                return None;
            };
            let bytes: Option<Vec<u8>> = pairs.iter().map(|&[a, b]| Some(digit(a)? << 4 | digit(b)?)).collect();
            bytes?.try_into().ok().map(Self)
        };
        parse().ok_or_else(|| {
            let shown: String = text.chars().take(80).collect();
            CodecError::bad_field("map digest", format!("{shown:?}"), "64 lower-case hexadecimal digits")
        })
    }
}

impl TryFrom<String> for MapDigest {
    type Error = CodecError;
    fn try_from(text: String) -> Result<Self, CodecError> {
        text.parse()
    }
}

impl From<MapDigest> for String {
    fn from(digest: MapDigest) -> Self {
        digest.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Angle, Pose2};
    use crate::grid::{Lattice, LogOdds};

    fn grid(width: u32, height: u32, resolution: f64, origin: Pose2) -> OccupancyGrid {
        OccupancyGrid::unknown(Lattice::new(width, height, resolution, origin).expect("valid"))
    }

    #[test]
    fn the_digest_of_a_known_map_never_changes() {
        let mut map = grid(2, 1, 0.05, Pose2::new(1.0, -2.0, Angle::ZERO));
        map.cells_mut()[1] = LogOdds::OCCUPIED;
        let layout = [
            &b"mapweld map 1\n"[..],
            &[2, 0, 0, 0, 1, 0, 0, 0],
            &0.05_f64.to_le_bytes(),
            &1.0_f64.to_le_bytes(),
            &(-2.0_f64).to_le_bytes(),
            &[0; 8],
            &[0x00, 0x80, 0xc2, 0x02],
        ];
        assert_eq!(digest(&map).as_bytes()[..], Sha256::digest(layout.concat())[..]);
        assert_eq!(digest(&map).to_string(), digest(&map.clone()).to_string());
    }

    #[test]
    fn whatever_differs_between_two_maps_changes_the_digest() {
        let id = Pose2::IDENTITY;
        let mut known = grid(6, 1, 0.05, id);
        known.cells_mut()[0] = LogOdds::from_value(0.0);
        let maps = [
            grid(6, 1, 0.05, id),
            known,
            grid(3, 2, 0.05, id),
            grid(6, 1, 0.06, id),
            grid(6, 1, 0.05, Pose2::new(0.0, 1e-9, Angle::ZERO)),
            grid(6, 1, 0.05, Pose2::new(0.0, 0.0, Angle::HALF_TURN)),
        ];
        let mut digests: Vec<_> = maps.iter().map(digest).collect();
        digests.sort();
        digests.dedup();
        assert_eq!(digests.len(), maps.len());
        let minus_zero = Pose2::new(-0.0, 0.0, Angle::ZERO);
        assert_eq!(digest(&grid(6, 1, 0.05, minus_zero)), digest(&maps[0]), "equal maps");
    }

    #[test]
    fn a_digest_survives_its_text() {
        let digest = digest(&grid(1, 1, 0.05, Pose2::IDENTITY));
        let text = digest.to_string();
        assert_eq!(text.len(), 64);
        assert_eq!(text.parse(), Ok(digest));
        for bad in ["", "00", &text.to_uppercase(), &text[1..], &format!("{text}00")] {
            assert!(bad.parse::<MapDigest>().is_err(), "{bad}");
        }
    }
}
