//! A map as mapweld keeps it: every log odds and the lattice, exactly.
//!
//! A 16-bit grey PNG, so that other programs can look at it. The grey value of a cell is its log odds in quanta plus
//! 2^15; unknown is 0. The lattice stands in a text chunk. Only what [`encode_cells`] wrote is read.

use std::io::Cursor;

use ::png::{BitDepth, ColorType, Compression, Decoder, Limits as PngLimits};

use super::png::Format;
use super::{CodecError, flip_rows};
use crate::geometry::Pose2;
use crate::grid::{Lattice, LogOdds, OccupancyGrid};

/// Keyword of the text chunk: resolution and the origin's x, y and yaw follow, in metres and radians.
const KEYWORD: &str = "mapweld lattice 1";

/// Memory for the decoder's own needs: rows of the widest picture.
const WORKING_BYTES: usize = 256 << 20;

/// The map without any loss, with its lattice: what [`decode_cells`] reads. The same bytes for the same map.
#[must_use]
pub fn encode_cells(grid: &OccupancyGrid) -> Vec<u8> {
    let lattice = grid.lattice();
    let origin = lattice.origin();
    let numbers = [lattice.resolution(), origin.x(), origin.y(), origin.yaw().radians()];
    // the shortest text that reads back as the same number
    let text = numbers.map(|number| format!("{number:?}")).join(" ");
    let format = Format {
        color: ColorType::Grayscale,
        depth: BitDepth::Sixteen,
        compression: Compression::Fast,
        note: Some((KEYWORD, text)),
    };
    let grey_row = |row| -> Vec<u8> {
        grid.row(row)
            .iter()
            .flat_map(|cell| grey_of(*cell).to_be_bytes())
            .collect()
    };
    super::png::write(
        lattice.width(),
        lattice.height(),
        format,
        (0..lattice.height()).rev().map(grey_row),
    )
}

/// The map that [`encode_cells`] wrote.
///
/// # Errors
/// [`CodecError`] when it did not write these bytes.
pub fn decode_cells(bytes: &[u8]) -> Result<OccupancyGrid, CodecError> {
    let decoder = Decoder::new_with_limits(Cursor::new(bytes), PngLimits { bytes: WORKING_BYTES });
    let mut reader = decoder.read_info().map_err(|error| bad(error.to_string()))?;
    let (width, height) = reader.info().size();
    if reader.output_color_type() != (ColorType::Grayscale, BitDepth::Sixteen) || reader.info().interlaced {
        return Err(bad("not 16-bit grey".to_owned()));
    }
    let mut texts = reader.info().uncompressed_latin1_text.iter();
    let text = texts
        .find(|chunk| chunk.keyword == KEYWORD)
        .ok_or_else(|| bad(format!("no text chunk {KEYWORD:?}")))?;
    let lattice = lattice(width, height, &text.text)?;
    let mut cells = Vec::new();
    let count = lattice.cell_count();
    cells
        .try_reserve_exact(count)
        .map_err(|reason| CodecError::NoMemory { cells: count, reason })?;
    while let Some(line) = reader.next_row().map_err(|error| bad(error.to_string()))? {
        let (samples, _) = line.data().as_chunks();
        cells.extend(samples.iter().map(|sample| cell_of(u16::from_be_bytes(*sample))));
    }
    let read = cells.len();
    flip_rows(&mut cells, width as usize);
    OccupancyGrid::new(lattice, cells).ok_or_else(|| bad(format!("{read} of {count} cells")))
}

fn lattice(width: u32, height: u32, text: &str) -> Result<Lattice, CodecError> {
    let numbers: Result<Vec<f64>, _> = text.split(' ').map(str::parse).collect();
    let bad_text = || CodecError::bad_field(KEYWORD, format!("{text:?}"), "four finite numbers");
    let [resolution, x, y, yaw] = numbers
        .ok()
        .and_then(|numbers| <[f64; 4]>::try_from(numbers).ok())
        .ok_or_else(bad_text)?;
    let origin = Pose2::parse(x, y, yaw).ok_or_else(bad_text)?;
    Ok(Lattice::new(width, height, resolution, origin)?)
}

fn grey_of(cell: LogOdds) -> u16 {
    cell.to_bits().cast_unsigned() ^ 0x8000
}

fn cell_of(grey: u16) -> LogOdds {
    LogOdds::from_bits((grey ^ 0x8000).cast_signed())
}

fn bad(reason: String) -> CodecError {
    CodecError::BadPicture {
        format: "mapweld PNG",
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    use crate::geometry::Angle;

    proptest! {
        #[test]
        fn every_log_odds_and_the_lattice_survive_exactly(
            width in 1_u32..20, cells in prop::collection::vec(any::<i16>(), 1..200), resolution in 0.01..1.0_f64,
            x in -1e4..1e4_f64, y in -1e4..1e4_f64, yaw in -4.0..4.0_f64,
        ) {
            let width = width.min(u32::try_from(cells.len()).expect("few"));
            let height = u32::try_from(cells.len()).expect("few") / width;
            let origin = Pose2::new(x, y, Angle::from_radians(yaw));
            let lattice = Lattice::new(width, height, resolution, origin).expect("valid");
            let cells = cells.into_iter().take(lattice.cell_count()).map(LogOdds::from_bits).collect();
            let grid = OccupancyGrid::new(lattice, cells).expect("as many");
            let back = decode_cells(&encode_cells(&grid)).expect("reads back");
            prop_assert_eq!(&back, &grid);
            prop_assert_eq!(encode_cells(&back), encode_cells(&grid));
        }

        #[test]
        fn other_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..300), cut in 0_usize..200) {
            prop_assert!(decode_cells(&bytes).is_err());
            let whole = encode_cells(&OccupancyGrid::unknown(Lattice::new(9, 9, 0.1, Pose2::IDENTITY).expect("valid")));
            prop_assert!(decode_cells(&whole[..cut.min(whole.len() - 20)]).is_err());
        }
    }

    #[test]
    fn an_ordinary_picture_is_refused() {
        let grid = OccupancyGrid::unknown(Lattice::new(9, 9, 0.1, Pose2::IDENTITY).expect("valid"));
        let error = decode_cells(&super::super::encode_png(&grid)).expect_err("8 bits");
        assert!(error.to_string().contains("16-bit"), "{error}");
    }
}
