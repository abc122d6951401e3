//! Rasters between the axes.

use crate::experiments::figure::Raster;
use crate::experiments::numbers::{count, index, real};

/// A raster and the pixels of the picture that it fills.
pub(super) struct Placed<'a> {
    pub(super) raster: &'a Raster,
    /// Left, top, right and bottom.
    pub(super) corners: [i32; 4],
}

impl Placed<'_> {
    /// Corner, size and bytes of the raster in the picture's own pixels. Made smaller, a pixel shows the darkest of the
    /// pixels that it stands for, so that thin walls stay whole.
    pub(super) fn scaled(&self) -> ((i32, i32), (u32, u32), Vec<u8>) {
        let [left, top, right, bottom] = self.corners;
        let side = |pixels: i32| count(f64::from(pixels.max(1)));
        let (width, height) = (side(right - left), side(bottom - top));
        let span = |at: usize, of: usize, all: usize| {
            let first = count(real(at) * real(all) / real(of)).min(all - 1);
            let end = count((real(at + 1) * real(all) / real(of)).floor()).clamp(first + 1, all);
            first..end
        };
        let mut bytes = Vec::with_capacity(width * height * 3);
        for y in 0..height {
            for x in 0..width {
                let rows = span(y, height, self.raster.height);
                let darkest = rows
                    .flat_map(|row| span(x, width, self.raster.width).map(move |column| (row, column)))
                    .map(|(row, column)| self.raster.pixels[row * self.raster.width + column])
                    .min_by_key(|pixel| pixel.iter().map(|c| u32::from(*c)).sum::<u32>());
                bytes.extend(darkest.unwrap_or([255; 3]));
            }
        }
        ((left, top), (index(real(width)), index(real(height))), bytes)
    }
}
