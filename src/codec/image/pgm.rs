//! PGM pictures, binary (P5) and plain (P2). Read by hand: the raster is used where it lies, and no size of a header is
//! trusted before the raster is seen to have it.

use super::{CodecError, Limits, MapMeta, Pixels, ShadeTable};

pub(super) fn read(bytes: &[u8], meta: &MapMeta, limits: &Limits) -> Result<Pixels, CodecError> {
    let plain = bytes.starts_with(b"P2");
    let mut scanner = Scanner { rest: &bytes[2..] };
    let width = scanner.number("width")?;
    let height = scanner.number("height")?;
    let max = scanner.number("maxval")?;
    let max = match u16::try_from(max) {
        Ok(max) if max > 0 => max,
        _ => return Err(bad(format!("maxval is {max}; it must be within 1 and 65535"))),
    };
    let count = limits.check_cells(width, height)?;
    let least = match (plain, max) {
        (true, _) => count.saturating_mul(2).saturating_sub(1), // a digit and a blank
        (false, ..256) => count,
        (false, _) => count.saturating_mul(2),
    };
    let raster = if plain { scanner.rest } else { scanner.raster()? };
    if raster.len() < least {
        return Err(bad(format!(
            "a raster of {width} x {height} pixels is cut short: {} bytes, at least {least} are needed",
            raster.len()
        )));
    }
    let table = ShadeTable::new(meta, 1, max, false);
    let mut pixels = Pixels::new(width, height, meta, limits)?;
    let refuse = |sample: u32| {
        Err(bad(format!(
            "a pixel is {sample}; it must be at most maxval, which is {max}"
        )))
    };
    match (plain, max) {
        (true, _) => {
            for _ in 0..count {
                let sample = scanner.number("a pixel")?;
                if sample > u32::from(max) {
                    return refuse(sample);
                }
                pixels.extend(&table, std::iter::once(sample as usize));
            }
        }
        (false, ..256) => {
            let samples = &raster[..count];
            if let Some(&sample) = samples.iter().find(|&&sample| u16::from(sample) > max) {
                return refuse(sample.into());
            }
            pixels.extend(&table, samples.iter().map(|&sample| sample.into()));
        }
        (false, _) => {
            let (samples, _) = raster[..least].as_chunks();
            let samples = samples.iter().map(|&sample| u16::from_be_bytes(sample));
            if let Some(sample) = samples.clone().find(|&sample| sample > max) {
                return refuse(sample.into());
            }
            pixels.extend(&table, samples.map(usize::from));
        }
    }
    Ok(pixels)
}

fn bad(reason: String) -> CodecError {
    CodecError::BadPicture { format: "PGM", reason }
}

/// Reads numbers between blanks and comments.
struct Scanner<'a> {
    rest: &'a [u8],
}

impl<'a> Scanner<'a> {
    fn number(&mut self, what: &str) -> Result<u32, CodecError> {
        self.skip_blanks();
        let digits = self.rest.iter().take_while(|b| b.is_ascii_digit()).count();
        let (number, rest) = self.rest.split_at(digits);
        if number.is_empty() {
            let found = match rest.first() {
                Some(byte) => format!("\"{}\"", byte.escape_ascii()),
                None => "the end of the file".to_owned(),
            };
            return Err(bad(format!("{what} is {found}; it must be a number")));
        }
        self.rest = rest;
        number
            .iter()
            .try_fold(0_u32, |n, digit| {
                n.checked_mul(10)?.checked_add(u32::from(digit - b'0'))
            })
            .ok_or_else(|| bad(format!("{what} is over {}", u32::MAX)))
    }

    fn skip_blanks(&mut self) {
        loop {
            self.rest = self.rest.trim_ascii_start();
            if self.rest.first() != Some(&b'#') {
                return;
            }
            let line = self.rest.iter().take_while(|&&b| b != b'\n' && b != b'\r').count();
            self.rest = &self.rest[line..];
        }
    }

    /// What follows the one blank after the header.
    fn raster(&self) -> Result<&'a [u8], CodecError> {
        match self.rest.split_first() {
            Some((blank, raster)) if blank.is_ascii_whitespace() => Ok(raster),
            _ => Err(bad("no blank between maxval and the raster".to_owned())),
        }
    }
}
