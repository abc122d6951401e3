//! Draws figures: one picture as PNG and as SVG, with a font of our own, so that nothing is asked of the system.

mod chart;
mod layout;
mod legend;
mod raster;

use std::sync::OnceLock;

use base64::Engine;
use image::RgbImage;
use image::codecs::png::PngEncoder;
use plotters::prelude::*;
use plotters::style::register_font;

use super::figure::Figure;
use layout::Layout;
use raster::Placed;

/// A drawn figure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drawn {
    /// A PNG file.
    pub png: Vec<u8>,
    /// An SVG file; rasters are embedded.
    pub svg: String,
}

/// Why a figure cannot be drawn.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("figure {figure} cannot be drawn: {problem}")]
pub struct PlotError {
    /// The figure's name.
    pub figure: String,
    /// What the plotting library says.
    pub problem: String,
}

/// The family under which the embedded font is registered; viewers of the SVG take their own sans-serif.
const FONT: &str = "sans-serif";

/// Draws a figure; the same figure gives the same bytes.
///
/// # Errors
/// [`PlotError`] when the plotting library refuses.
///
/// # Panics
/// Never: the embedded font is one.
pub fn draw(figure: &Figure) -> Result<Drawn, PlotError> {
    static REGISTERED: OnceLock<bool> = OnceLock::new();
    let registered =
        *REGISTERED.get_or_init(|| register_font(FONT, FontStyle::Normal, dejavu::sans::regular()).is_ok());
    assert!(registered, "invariant: the embedded font is a font");
    let problem = |problem: String| PlotError {
        figure: figure.name.clone(),
        problem,
    };
    let layout = Layout::of(figure);
    Ok(Drawn {
        png: png(figure, &layout).map_err(problem)?,
        svg: svg(figure, &layout).map_err(problem)?,
    })
}

fn png(figure: &Figure, layout: &Layout) -> Result<Vec<u8>, String> {
    let (width, height) = (layout.width, layout.height);
    let mut pixels = vec![255; width as usize * height as usize * 3];
    {
        let root = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
        chart::panels(&root, figure, layout, |area, placed| {
            let (at, size, bytes) = placed.scaled();
            match BitMapElement::with_owned_buffer(at, size, bytes) {
                Some(bitmap) => area.draw(&bitmap).map_err(|error| error.to_string()),
                None => Ok(()), // nothing of it is within the axes
            }
        })?;
        root.present().map_err(|error| error.to_string())?;
    }
    let picture = RgbImage::from_raw(width, height, pixels).expect("invariant: three bytes a pixel");
    Ok(encoded(&picture))
}

fn svg(figure: &Figure, layout: &Layout) -> Result<String, String> {
    let mut text = String::new();
    let mut images = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (layout.width, layout.height)).into_drawing_area();
        chart::panels(&root, figure, layout, |_, placed| {
            images += &image_element(placed);
            Ok(())
        })?;
        root.present().map_err(|error| error.to_string())?;
    }
    // rasters lie on the background and behind everything else; plotters' own way to embed them needs a second
    // version of the image crate
    let background = text.find("/>").map_or(0, |at| at + 2);
    text.insert_str(background, &images);
    Ok(text)
}

fn image_element(placed: &Placed<'_>) -> String {
    let raster = placed.raster;
    let side = |pixels: usize| u32::try_from(pixels).expect("invariant: rasters are pictures of maps");
    let bytes = raster.pixels.as_flattened().to_vec();
    let picture =
        RgbImage::from_raw(side(raster.width), side(raster.height), bytes).expect("invariant: a colour a pixel");
    let data = base64::engine::general_purpose::STANDARD.encode(encoded(&picture));
    let [left, top, right, bottom] = placed.corners;
    format!(
        "\n<image x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" \
         style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{data}\"/>",
        right - left,
        bottom - top,
    )
}

fn encoded(picture: &RgbImage) -> Vec<u8> {
    let mut png = Vec::new();
    picture
        .write_with_encoder(PngEncoder::new(&mut png))
        .expect("invariant: a vector takes every byte");
    png
}

#[cfg(test)]
mod tests {
    use super::super::figure::{Axis, Mark, Panel, Raster, Series};
    use super::*;

    fn figure() -> Figure {
        let raster = Raster {
            width: 2,
            height: 1,
            pixels: vec![[255, 0, 0], [0, 0, 255]],
        };
        let chart = Panel::new(
            "a <title> & more",
            Axis::new("x [m]", 0.0, 4.0),
            Axis::new("y [m]", 0.0, 2.0),
        )
        .with(Series::new("line", [0, 0, 0], Mark::Line, vec![[0.0, 0.5], [4.0, 1.5]]))
        .with(Series::new("dots", [0, 9, 0], Mark::LineAndDots, vec![[1.0, 1.0]]).with_spread(vec![[0.5, 1.5]]));
        let picture = Panel::new("map", Axis::new("x [m]", 0.0, 4.0), Axis::new("y [m]", 0.0, 2.0));
        Figure::new("f", "a figure", 2, vec![chart, picture.with_raster(raster, true)])
    }

    #[test]
    fn a_figure_is_a_png_and_an_svg_of_one_size_and_the_same_each_time() {
        let drawn = draw(&figure()).expect("it is drawn");
        assert_eq!(drawn, draw(&figure()).expect("again"));
        let picture = image::load_from_memory(&drawn.png).expect("a PNG").to_rgb8();
        assert!(
            drawn
                .svg
                .contains(&format!("viewBox=\"0 0 {} {}\"", picture.width(), picture.height()))
        );
        assert!(drawn.svg.contains("a &lt;title&gt; &amp; more") && drawn.svg.contains("data:image/png;base64,"));
        assert!(drawn.svg.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn the_raster_fills_the_axes_left_red_right_blue() {
        let picture = image::load_from_memory(&draw(&figure()).expect("drawn").png)
            .expect("a PNG")
            .to_rgb8();
        let of = |color: [u8; 3]| {
            let columns: Vec<u32> = picture
                .enumerate_pixels()
                .filter(|(.., p)| p.0 == color)
                .map(|(x, ..)| x)
                .collect();
            (
                columns.len(),
                *columns.iter().min().expect("some"),
                *columns.iter().max().expect("some"),
            )
        };
        let ((reds, _, red_right), (blues, blue_left, _)) = (of([255, 0, 0]), of([0, 0, 255]));
        assert!(reds > 5_000 && blues > 5_000 && red_right < blue_left, "{reds} {blues}");
    }

    #[test]
    fn letters_are_drawn_on_a_machine_without_fonts() {
        let mut bare = figure();
        for panel in &mut bare.panels {
            panel.title = String::new();
        }
        let dark = |figure: &Figure| {
            let picture = image::load_from_memory(&draw(figure).expect("drawn").png)
                .expect("a PNG")
                .to_rgb8();
            picture.pixels().filter(|pixel| pixel.0.iter().all(|c| *c < 90)).count()
        };
        assert!(dark(&figure()) > dark(&bare) + 60);
    }
}
