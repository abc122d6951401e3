//! What the fuzz targets share.

use mapweld::codec::{Decoded, Limits, decode_cells, encode_cells};

/// Small limits: what is slow or large at most is found all the same, and sooner.
#[must_use]
pub fn limits() -> Limits {
    Limits {
        bytes: 1 << 20,
        cells: 1 << 16,
        ..Limits::default()
    }
}

/// What was taken in can be kept and read back, and is within the limits.
///
/// # Panics
/// When it cannot: that is a find.
pub fn must_be_kept(decoded: &Decoded) {
    let lattice = decoded.grid.lattice();
    assert!(lattice.cell_count() as u64 <= limits().cells, "over the limit of cells");
    let back = decode_cells(&encode_cells(&decoded.grid)).expect("what is kept can be read");
    assert_eq!(back, decoded.grid);
}
