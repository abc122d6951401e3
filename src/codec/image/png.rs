//! PNG pictures, row by row.

use std::io::{Cursor, Write as _};

use png::{
    BitDepth, ColorType, Compression, Decoder, DecodingError, Encoder, EncodingError, Limits as PngLimits,
    Transformations,
};

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
        if self.wide {
            let (samples, _) = bytes.as_chunks();
            self.push_samples(samples, |&sample| u16::from_be_bytes(sample), table, pixels);
        } else {
            self.push_samples(bytes, |&sample| u16::from(sample), table, pixels);
        }
    }

    fn push_samples<T>(
        &self,
        samples: &[T],
        number: impl Fn(&T) -> u16 + Copy,
        table: &ShadeTable,
        pixels: &mut Pixels,
    ) {
        let colours = usize::from(self.colours);
        let sum = move |colours: &[T]| colours.iter().map(|sample| usize::from(number(sample))).sum();
        if self.alpha {
            for pixel in samples.chunks_exact(colours + 1) {
                pixels.push(table, sum(&pixel[..colours]), number(&pixel[colours]) == table.max);
            }
        } else if colours == 1 {
            pixels.extend(table, samples.iter().map(move |sample| number(sample).into()));
        } else {
            pixels.extend(table, samples.chunks_exact(colours).map(sum));
        }
    }
}

/// What kind of picture to write.
pub(super) struct Format<'a> {
    pub(super) color: ColorType,
    pub(super) depth: BitDepth,
    pub(super) compression: Compression,
    /// Keyword and text of a note in the file.
    pub(super) note: Option<(&'a str, String)>,
}

impl Format<'_> {
    /// Eight bits a sample, no note.
    pub(super) fn plain(color: ColorType) -> Self {
        Self {
            color,
            depth: BitDepth::Eight,
            compression: Compression::Balanced,
            note: None,
        }
    }
}

/// A picture of these rows, the top one first; the same bytes for the same picture.
pub(super) fn write(
    width: u32,
    height: u32,
    format: Format<'_>,
    rows: impl Iterator<Item = impl AsRef<[u8]>>,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let written = try_write(&mut bytes, width, height, format, rows);
    written.expect("invariant: a vector takes every byte, and lattices fit PNG's 31 bits a side");
    bytes
}

fn try_write(
    bytes: &mut Vec<u8>,
    width: u32,
    height: u32,
    format: Format<'_>,
    rows: impl Iterator<Item = impl AsRef<[u8]>>,
) -> Result<(), EncodingError> {
    let mut encoder = Encoder::new(bytes, width, height);
    encoder.set_color(format.color);
    encoder.set_depth(format.depth);
    encoder.set_compression(format.compression);
    if let Some((keyword, text)) = format.note {
        encoder.add_text_chunk(keyword.to_owned(), text)?;
    }
    let mut header = encoder.write_header()?;
    let mut stream = header.stream_writer()?;
    for row in rows {
        stream.write_all(row.as_ref())?;
    }
    stream.finish()?;
    header.finish()
}
