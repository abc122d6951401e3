//! Content is known by its SHA-256.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use utoipa::ToSchema;

use super::Invalid;
use crate::grid::OccupancyGrid;

/// A SHA-256. Written as 64 small hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(try_from = "String", into = "String")]
#[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
pub struct Digest([u8; 32]);

impl Digest {
    /// The digest of some bytes.
    #[must_use]
    pub fn of_bytes(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }

    /// The digest of a map's content: its lattice and every cell, whatever file it came in.
    ///
    /// Hashed: a tag with the version of this layout, width and height (u32), resolution, origin x, y and yaw (f64), then each cell from the lowest row on
    /// (its log odds in whole quanta as i16, unknown as the least i16), all little-endian.
    #[must_use]
    pub fn of_grid(grid: &OccupancyGrid) -> Self {
        let lattice = grid.lattice();
        let mut hash = Sha256::new();
        hash.update(b"mapweld map 1\n");
        hash.update(lattice.width().to_le_bytes());
        hash.update(lattice.height().to_le_bytes());
        let origin = lattice.origin();
        for number in [lattice.resolution(), origin.x(), origin.y(), origin.yaw().radians()] {
            // -0.0 and 0.0 are one number
            hash.update((number + 0.0).to_le_bytes());
        }
        let mut bytes = Vec::with_capacity(2 * lattice.width() as usize);
        for row in 0..lattice.height() {
            bytes.clear();
            bytes.extend(grid.row(row).iter().flat_map(|cell| cell.to_bits().to_le_bytes()));
            hash.update(&bytes);
        }
        Self(hash.finalize().into())
    }

    /// The 32 bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// A digest of these bytes; `None` unless there are 32.
    #[must_use]
    pub fn from_slice(bytes: &[u8]) -> Option<Self> {
        bytes.try_into().ok().map(Self)
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Digest({self})")
    }
}

impl FromStr for Digest {
    type Err = Invalid;
    fn from_str(text: &str) -> Result<Self, Invalid> {
        let bad = || Invalid::new("digest", text, "64 small hexadecimal digits");
        let digit = |byte: u8| match byte {
            b'0'..=b'9' => Some(byte - b'0'),
            b'a'..=b'f' => Some(byte - b'a' + 10),
            _ => None,
        };
        let (pairs, rest) = text.as_bytes().as_chunks::<2>();
        if pairs.len() != 32 || !rest.is_empty() {
            return Err(bad());
        }
        let mut bytes = [0; 32];
        for (byte, &[high, low]) in bytes.iter_mut().zip(pairs) {
            *byte = digit(high).zip(digit(low)).map(|(h, l)| h << 4 | l).ok_or_else(bad)?;
        }
        Ok(Self(bytes))
    }
}

impl TryFrom<String> for Digest {
    type Error = Invalid;
    fn try_from(text: String) -> Result<Self, Invalid> {
        text.parse()
    }
}

impl From<Digest> for String {
    fn from(digest: Digest) -> Self {
        digest.to_string()
    }
}

/// Where a blob is kept: the digest of its bytes.
///
/// A key is only ever computed, so no path from outside can reach the folder of blobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BlobKey(pub Digest);

impl BlobKey {
    /// The key that these bytes are kept under.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(Digest::of_bytes(bytes))
    }

    /// The key that stands for this place; none for a place of no blob.
    #[must_use]
    pub fn at(place: &str) -> Option<Self> {
        let (first, rest) = place.strip_prefix("sha256/")?.split_once('/')?;
        let key = format!("{first}{rest}").parse().ok().map(Self)?;
        (key.to_string() == place).then_some(key)
    }
}

impl fmt::Display for BlobKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hex = self.0.to_string();
        write!(f, "sha256/{}/{}", &hex[..2], &hex[2..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Angle, Pose2};
    use crate::grid::{Lattice, LogOdds};

    #[test]
    fn a_digest_survives_its_text() {
        let digest = Digest::of_bytes(b"abc");
        assert!(digest.to_string().starts_with("ba7816bf8f01cfea"));
        assert_eq!(digest.to_string().parse::<Digest>().expect("parses"), digest);
        for bad in [
            "",
            "ba78",
            &"g".repeat(64),
            &digest.to_string().to_uppercase(),
            &format!("{digest}0"),
        ] {
            assert!(bad.parse::<Digest>().is_err(), "{bad:?}");
        }
    }

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
        assert_eq!(Digest::of_grid(&map), Digest::of_bytes(&layout.concat()));
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
        let digests: std::collections::BTreeSet<_> = maps.iter().map(Digest::of_grid).collect();
        assert_eq!(digests.len(), maps.len());
        let minus_zero = grid(6, 1, 0.05, Pose2::new(-0.0, 0.0, Angle::ZERO));
        assert_eq!(Digest::of_grid(&minus_zero), Digest::of_grid(&maps[0]), "equal maps");
    }

    #[test]
    fn a_blob_lies_in_a_folder_of_its_first_two_digits() {
        let key = BlobKey::of(b"abc").to_string();
        assert!(key.starts_with("sha256/ba/7816bf8f"), "{key}");
        assert_eq!(BlobKey::at(&key), Some(BlobKey::of(b"abc")));
        for other in [
            &key[1..],
            &key.replace("/ba/", "/b/a"),
            &key.to_uppercase(),
            "sha256/ba",
        ] {
            assert_eq!(BlobKey::at(other), None, "{other}");
        }
    }
}
