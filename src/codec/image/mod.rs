//! Pictures of maps. A picture's first row is on top, a grid's row 0 is the lowest: the only row flip of the crate.

mod cells;
mod pgm;
mod png;
mod shade;

use super::{CodecError, Decoded, Limits, MapMeta};
use crate::grid::{CellState, Lattice, OccupancyGrid};
use ::png::ColorType;
pub use cells::{decode_cells, encode_cells};
use png::Format;
use shade::{Pixels, ShadeTable};

/// Reads a picture, PNG or PGM (P5, P2) as its first bytes tell, as a map whose grey values mean what `meta` says.
///
/// The rules are those of ROS `map_server`: shade = mean of the colour channels in 0..1, occupancy = 1 - shade
/// (`negate`: shade), then by mode. A pixel with alpha below its maximum is unknown in every mode; opaque pixels are read by
/// their colour alone (see [`Warning::AlphaNotAveraged`](super::Warning::AlphaNotAveraged)).
///
/// Memory: two bytes a cell and some rows; PGM and interlaced PNG need the whole picture besides.
///
/// # Errors
/// [`CodecError`] when the bytes are no such picture, or over the limits.
pub fn decode_image(picture: &[u8], meta: &MapMeta, limits: &Limits) -> Result<Decoded, CodecError> {
    limits.check_bytes("picture", picture)?;
    let pixels = if picture.starts_with(b"\x89PNG\r\n\x1a\n") {
        png::read(picture, meta, limits)?
    } else if picture.starts_with(b"P5") || picture.starts_with(b"P2") {
        pgm::read(picture, meta, limits)?
    } else {
        let start = picture[..picture.len().min(8)].escape_ascii();
        return Err(CodecError::UnknownFormat {
            start: format!("\"{start}\""),
        });
    };
    assemble(pixels, meta)
}

fn assemble(pixels: Pixels, meta: &MapMeta) -> Result<Decoded, CodecError> {
    let (width, height, mut cells, warnings) = pixels.finish();
    flip_rows(&mut cells, width as usize);
    let lattice = Lattice::new(width, height, meta.resolution(), meta.origin())?;
    let grid = OccupancyGrid::new(lattice, cells).expect("invariant: the readers fill every row");
    Ok(Decoded { grid, warnings })
}

/// Turns a picture's rows, the top one first, into a grid's, the lowest first, and back.
pub(super) fn flip_rows<T>(values: &mut [T], width: usize) {
    let mut rows = values.chunks_exact_mut(width);
    while let (Some(upper), Some(lower)) = (rows.next(), rows.next_back()) {
        upper.swap_with_slice(lower);
    }
}

/// The row, counted from the top, of what lies at `row` counted from the bottom; both of `height` rows.
pub(super) fn flip_row(row: u32, height: u32) -> u32 {
    height - 1 - row
}

/// The grid's rows as a picture has them, the highest first, as grey values of trinary map files.
fn grey_rows(grid: &OccupancyGrid) -> impl Iterator<Item = Vec<u8>> {
    (0..grid.lattice().height())
        .rev()
        .map(|row| grid.row(row).iter().map(|cell| grey(cell.state())).collect())
}

fn grey(state: CellState) -> u8 {
    match state {
        CellState::Occupied => 0,
        CellState::Free => 254,
        CellState::Unknown => 205,
    }
}

/// The map as an 8-bit grey PNG: 0 occupied, 254 free, 205 unknown, to go with [`encode_yaml`](super::encode_yaml).
#[must_use]
pub fn encode_png(grid: &OccupancyGrid) -> Vec<u8> {
    let lattice = grid.lattice();
    png::write(
        lattice.width(),
        lattice.height(),
        Format::plain(ColorType::Grayscale),
        grey_rows(grid),
    )
}

/// The map as a binary PGM (P5), with the same grey values as [`encode_png`].
#[must_use]
pub fn encode_pgm(grid: &OccupancyGrid) -> Vec<u8> {
    let lattice = grid.lattice();
    let mut bytes = format!("P5\n{} {}\n255\n", lattice.width(), lattice.height()).into_bytes();
    bytes.reserve_exact(lattice.cell_count());
    for row in grey_rows(grid) {
        bytes.extend_from_slice(&row);
    }
    bytes
}

#[cfg(test)]
mod tests;
