//! Names, marks and the length of some metres, below the map.

use super::palette::{INK, Look, PAPER, hazard};
use super::{Picture, Rgb, text_size};

pub(super) struct Legend<'a> {
    pub(super) names: &'a [&'a str],
    pub(super) looks: &'a [Look],
    pub(super) conflicts: bool,
    pub(super) metres_per_pixel: f64,
    /// Pixels for a unit of text.
    pub(super) unit: u32,
}

/// Letters of a name that are shown at most.
const LETTERS: usize = 40;
/// Sizes in units of the text's scale: the side of a swatch, the height of a line, the space around and between.
const SWATCH: u32 = 16;
const LINE: u32 = 22;
const MARGIN: u32 = 10;

/// What stands before the words of an entry.
enum Swatch {
    Robot(Look),
    SharedWall,
    Conflict,
}

/// The map with the legend under it; the picture is widened if a name needs it.
pub(super) fn below(map: &Picture, legend: &Legend<'_>) -> Picture {
    let unit = legend.unit;
    let entries = entries(legend);
    let longest = entries
        .iter()
        .map(|(_, words)| words.chars().count())
        .max()
        .unwrap_or(0);
    let column_width = (SWATCH + MARGIN / 2 + text_size(longest).0 + 2 * MARGIN) * unit;
    let width = map.width().max(column_width + 2 * MARGIN * unit);
    let columns = (width - 2 * MARGIN * unit) / column_width;
    let lines = u32::try_from(entries.len())
        .unwrap_or(u32::MAX)
        .div_ceil(columns.max(1));
    let height = (2 * MARGIN + (lines + 1) * LINE) * unit;

    let mut picture = Picture::new(width, map.height() + height, PAPER);
    picture.paste(map, (width - map.width()) / 2, 0);
    let top = map.height();
    picture.fill(0, top, width, unit, |_, _| [200; 3]);
    for (index, (swatch, words)) in (0_u32..).zip(&entries) {
        // down the columns, as people read lists
        let x = (MARGIN * unit) + index / lines * column_width;
        let y = top + (MARGIN + index % lines * LINE) * unit;
        draw_swatch(&mut picture, swatch, x, y, unit);
        picture.write(words, x + (SWATCH + MARGIN / 2) * unit, y, unit, INK);
    }
    let y = top + (MARGIN + lines * LINE) * unit;
    draw_scale_bar(&mut picture, map.width(), legend.metres_per_pixel, y, unit);
    picture
}

fn entries(legend: &Legend<'_>) -> Vec<(Swatch, String)> {
    let mut entries: Vec<_> = (1_usize..)
        .zip(legend.names.iter().zip(legend.looks))
        .map(|(number, (name, &look))| (Swatch::Robot(look), format!("{number} {}", shortened(name))))
        .collect();
    if legend.names.len() > 1 {
        entries.push((Swatch::SharedWall, "wall seen by several".to_owned()));
    }
    if legend.conflicts {
        entries.push((Swatch::Conflict, "contradiction".to_owned()));
    }
    entries
}

fn shortened(name: &str) -> String {
    if name.chars().count() <= LETTERS {
        return name.to_owned();
    }
    name.chars().take(LETTERS - 3).chain("...".chars()).collect()
}

fn draw_swatch(picture: &mut Picture, swatch: &Swatch, x: u32, y: u32, unit: u32) {
    let (side, border) = (SWATCH * unit, 3 * unit);
    match swatch {
        Swatch::Robot(look) => {
            picture.fill(x, y, side, side, |_, _| look.wall);
            picture.fill(x + border, y + border, side - 2 * border, side - 2 * border, |x, y| {
                look.free(x, y)
            });
        }
        Swatch::SharedWall => picture.fill(x, y + side / 3, side, side / 3, |_, _| INK),
        Swatch::Conflict => picture.fill(x, y, side, side, hazard),
    }
}

/// A bar of 1, 2 or 5 times a power of ten metres, about a fifth of the map's width long.
fn draw_scale_bar(picture: &mut Picture, map_width: u32, metres_per_pixel: f64, y: u32, unit: u32) {
    let wanted = f64::from(map_width) * metres_per_pixel / 5.0;
    let power = 10_f64.powf(wanted.log10().floor());
    let metres = [5.0, 2.0, 1.0]
        .map(|n| n * power)
        .into_iter()
        .find(|&m| m <= wanted)
        .unwrap_or(power);
    let length = pixels(metres / metres_per_pixel).max(1);
    let x = MARGIN * unit;
    let bar: [(u32, u32, u32, u32); 3] = [
        (x, y + 7 * unit, length, 2 * unit),
        (x, y + 3 * unit, unit, 10 * unit),
        (x + length.saturating_sub(unit), y + 3 * unit, unit, 10 * unit),
    ];
    for (x, y, width, height) in bar {
        picture.fill(x, y, width, height, |_, _: u32| -> Rgb { INK });
    }
    picture.write(&format!("{metres} m"), x + length + MARGIN / 2 * unit, y, unit, INK);
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of a picture's width"
)]
fn pixels(length: f64) -> u32 {
    length.round() as u32
}
