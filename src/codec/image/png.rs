//! PNG pictures, row by row.

use std::io::Cursor;

use png::{BitDepth, ColorType, Compression, Decoder, DecodingError, Encoder, Limits as PngLimits, Transformations};

use super::{CodecError, Limits, MapMeta, Pixels, ShadeTable};

/// Memory for the decoder's own needs: the palette and a few rows of the widest picture. The grid is counted in cells.
const WORKING_BYTES: usize = 64 << 20;

pub(super) fn read(bytes: &[u8], meta: &MapMeta, limits: &Limits) -> Result<Pixels, CodecError> {
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), PngLimits { bytes: WORKING_BYTES });
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    // palettes become colours, their transparency becomes alpha, samples below 8 bits are spread to 8
    decoder.set_transformations(Transformations::EXPAND);
    let (width, height) = decoder.read_header_info().map_err(bad)?.size();
    limits.check_cells(width, height)?;
    let mut reader = decoder.read_info().map_err(bad)?;
    let (color, depth) = reader.output_color_type();
    let layout = Layout::of(color, depth)?;
    let table = ShadeTable::new(meta, layout.colours, layout.max(), layout.alpha);
    let mut pixels = Pixels::new(width, height, meta, limits)?;
    if reader.info().interlaced {
        let size = reader
            .output_buffer_size()
            .ok_or_else(|| bad(DecodingError::LimitsExceeded))?;
        let mut picture = Vec::new();
        picture.try_reserve_exact(size).map_err(|reason| CodecError::NoMemory {
            cells: width as usize * height as usize,
            reason,
        })?;
        picture.resize(size, 0);
        reader.next_frame(&mut picture).map_err(bad)?;
        layout.push(&picture, &table, &mut pixels);
    } else {
        for row in 0..height {
            let line = reader.next_row().map_err(bad)?.ok_or_else(|| CodecError::BadPicture {
                format: "PNG",
                reason: format!("only {row} of {height} rows"),
            })?;
            layout.push(line.data(), &table, &mut pixels);
        }
    }
    Ok(pixels)
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn bad(error: DecodingError) -> CodecError {
    CodecError::BadPicture {
        format: "PNG",
        reason: error.to_string(),
    }
}

/// How the samples of a pixel lie in its bytes.
struct Layout {
    colours: u16,
    alpha: bool,
    wide: bool,
}

impl Layout {
    fn of(color: ColorType, depth: BitDepth) -> Result<Self, CodecError> {
        let (colours, alpha) = match color {
            ColorType::Grayscale => (1, false),
            ColorType::GrayscaleAlpha => (1, true),
            ColorType::Rgb => (3, false),
            ColorType::Rgba => (3, true),
            ColorType::Indexed => {
                return Err(CodecError::BadPicture {
                    format: "PNG",
                    reason: "a palette picture without a palette".to_owned(),
                });
            }
        };
        Ok(Self {
            colours,
            alpha,
            wide: depth == BitDepth::Sixteen,
        })
    }

    fn max(&self) -> u16 {
        if self.wide { u16::MAX } else { u8::MAX.into() }
    }

    fn push(&self, bytes: &[u8], table: &ShadeTable, pixels: &mut Pixels) {
        let samples = usize::from(self.colours) + usize::from(self.alpha);
        if self.wide {
            let (wide, _) = bytes.as_chunks();
            for pixel in wide.chunks_exact(samples) {
                self.push_pixel(pixel.iter().map(|&sample| u16::from_be_bytes(sample)), table, pixels);
            }
        } else {
            for pixel in bytes.chunks_exact(samples) {
                self.push_pixel(pixel.iter().map(|&sample| sample.into()), table, pixels);
            }
        }
    }

    #[inline]
    fn push_pixel(&self, mut samples: impl Iterator<Item = u16>, table: &ShadeTable, pixels: &mut Pixels) {
        let sum = samples.by_ref().take(self.colours.into()).map(usize::from).sum();
        let opaque = samples.next().is_none_or(|alpha| alpha == table.max);
        pixels.push(table, sum, opaque);
    }
}

/// A picture of these rows, the top one first, 8 bits a sample; the same bytes for the same picture.
pub(super) fn write(
    width: u32,
    height: u32,
    color: ColorType,
    rows: impl Iterator<Item = impl AsRef<[u8]>>,
) -> Vec<u8> {
    use std::io::Write as _;
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Balanced);
    let written = encoder.write_header().and_then(|mut header| {
        let mut stream = header.stream_writer()?;
        for row in rows {
            stream.write_all(row.as_ref())?;
        }
        stream.finish()?;
        header.finish()
    });
    written.expect("invariant: a vector takes every byte, and lattices fit PNG's 31 bits a side");
    bytes
}
