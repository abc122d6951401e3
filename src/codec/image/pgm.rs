//! PGM pictures, binary (P5) and plain (P2).

use std::io::Cursor;

use ::image::codecs::pnm::PnmDecoder;
use ::image::{ColorType, ImageDecoder, ImageError};

use super::{CodecError, Limits, MapMeta, Pixels, ShadeTable};

/// Samples come spread to the full range of 8 or 16 bits, whatever the file's maxval.
pub(super) fn read(bytes: &[u8], meta: &MapMeta, limits: &Limits) -> Result<Pixels, CodecError> {
    let decoder = PnmDecoder::new(Cursor::new(bytes)).map_err(bad)?;
    let (width, height) = decoder.dimensions();
    let count = limits.check_cells(width, height)?;
    let wide = decoder.color_type() == ColorType::L16;
    let samples = count.saturating_mul(if wide { 2 } else { 1 });
    // A plain sample is a digit and a blank at least. No size of a header is trusted before the raster can have it.
    let least = if bytes.starts_with(b"P2") {
        count.saturating_mul(2).saturating_sub(1)
    } else {
        samples
    };
    if bytes.len() < least {
        return Err(CodecError::BadPicture {
            format: "PGM",
            reason: format!(
                "a raster of {width} x {height} pixels is cut short: the file has {} bytes, at least {least} are needed",
                bytes.len()
            ),
        });
    }
    let mut raster = Vec::new();
    raster
        .try_reserve_exact(samples)
        .map_err(|reason| CodecError::NoMemory { cells: count, reason })?;
    raster.resize(samples, 0);
    decoder.read_image(&mut raster).map_err(bad)?;
    let mut pixels = Pixels::new(width, height, meta, limits)?;
    if wide {
        let (raster, _) = raster.as_chunks();
        let table = ShadeTable::new(meta, 1, u16::MAX, false);
        pixels.extend(&table, raster.iter().map(|&sample| u16::from_ne_bytes(sample).into()));
    } else {
        let table = ShadeTable::new(meta, 1, u8::MAX.into(), false);
        pixels.extend(&table, raster.iter().map(|&sample| sample.into()));
    }
    Ok(pixels)
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn bad(error: ImageError) -> CodecError {
    CodecError::BadPicture {
        format: "PGM",
        reason: error.to_string(),
    }
}
