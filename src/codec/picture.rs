//! A colour picture, and text and boxes on it.

use std::convert::Infallible;

use embedded_graphics::Drawable;
use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::iso_8859_1::FONT_9X15_BOLD as FONT;
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::text::{Baseline, Text};
use image::RgbImage;
use image::codecs::png::PngEncoder;

/// Red, green and blue.
pub type Rgb = [u8; 3];

/// A picture for people: rows from the top, three bytes a pixel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture(RgbImage);

impl Picture {
    /// A picture of one colour.
    #[must_use]
    pub fn new(width: u32, height: u32, color: Rgb) -> Self {
        Self(RgbImage::from_pixel(width, height, image::Rgb(color)))
    }

    /// Pixels in a row.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.0.width()
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.0.height()
    }

    /// All pixels, row by row from the top.
    #[must_use]
    pub fn pixels(&self) -> &[Rgb] {
        self.0.as_raw().as_chunks().0
    }

    /// All pixels, to be changed in place.
    pub(super) fn pixels_mut(&mut self) -> &mut [Rgb] {
        self.0.as_chunks_mut().0
    }

    /// The pixel in a column, and a row counted from the top.
    ///
    /// # Panics
    /// When there is no such pixel.
    #[must_use]
    pub fn at(&self, x: u32, y: u32) -> Rgb {
        self.0.get_pixel(x, y).0
    }

    /// The picture as PNG; the same bytes for the same picture.
    #[must_use]
    pub fn to_png(&self) -> Vec<u8> {
        let mut png = Vec::new();
        self.0
            .write_with_encoder(PngEncoder::new(&mut png))
            .expect("invariant: a vector takes every byte, and pictures fit PNG's 31 bits a side");
        png
    }

    /// Copies `other` to the place whose left upper corner is (x, y); what does not fit is left out.
    pub(super) fn paste(&mut self, other: &Self, x: u32, y: u32) {
        let (own, others) = (self.width().max(1) as usize, other.width().max(1) as usize);
        let width = other.width().min(self.width().saturating_sub(x)) as usize;
        let rows = self.pixels_mut().chunks_mut(own).skip(y as usize);
        for (row, from) in rows.zip(other.pixels().chunks(others)) {
            row[x as usize..][..width].copy_from_slice(&from[..width]);
        }
    }

    /// Fills a box with what `color` says for each pixel of it; what lies outside the picture is left out.
    pub(super) fn fill(&mut self, x: u32, y: u32, width: u32, height: u32, color: impl Fn(u32, u32) -> Rgb) {
        for row in y..y.saturating_add(height).min(self.height()) {
            for column in x..x.saturating_add(width).min(self.width()) {
                self.0.put_pixel(column, row, image::Rgb(color(column, row)));
            }
        }
    }

    /// Writes one line of text whose left upper corner is (x, y), with `scale` pixels for each of the font's.
    pub(super) fn write(&mut self, text: &str, x: u32, y: u32, scale: u32, color: Rgb) {
        let line: String = text.chars().map(|c| if c.is_control() { '?' } else { c }).collect();
        let style = MonoTextStyle::new(&FONT, BinaryColor::On);
        let mut pen = Pen {
            picture: self,
            x,
            y,
            scale,
            color,
        };
        let Ok(_) = Text::with_baseline(&line, Point::zero(), style, Baseline::Top).draw(&mut pen);
    }
}

/// Width and height of a line of `letters` letters at scale 1.
pub(super) fn text_size(letters: usize) -> (u32, u32) {
    let Size { width, height } = FONT.character_size;
    (width.saturating_mul(u32::try_from(letters).unwrap_or(u32::MAX)), height)
}

/// Draws each pixel of a text as a square of `scale` pixels.
struct Pen<'a> {
    picture: &'a mut Picture,
    x: u32,
    y: u32,
    scale: u32,
    color: Rgb,
}

impl OriginDimensions for Pen<'_> {
    fn size(&self) -> Size {
        Size::new(self.picture.width(), self.picture.height())
    }
}

impl DrawTarget for Pen<'_> {
    type Color = BinaryColor;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<BinaryColor>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(point, ink) in pixels {
            let (Ok(x), Ok(y)) = (u32::try_from(point.x), u32::try_from(point.y)) else {
                continue;
            };
            if ink.is_on() {
                let (scale, color) = (self.scale, self.color);
                let (x, y) = (self.x + x * scale, self.y + y * scale);
                self.picture.fill(x, y, scale, scale, |_, _| color);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_leaves_ink_and_what_does_not_fit_is_left_out() {
        let mut picture = Picture::new(40, 20, [255; 3]);
        picture.write("A\n\u{4f60}", 2, 2, 1, [0; 3]);
        let ink = picture.pixels().iter().filter(|&&p| p == [0; 3]).count();
        assert!(ink > 20, "{ink} pixels of ink");
        picture.write("far too long for this picture", 30, 15, 3, [0; 3]);
        picture.paste(&Picture::new(99, 99, [9; 3]), 39, 19);
        assert_eq!(picture.at(39, 19), [9; 3]);
        assert_eq!(picture.at(0, 0), [255; 3]);
    }
}
