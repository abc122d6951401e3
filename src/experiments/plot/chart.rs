//! Panels as charts of the plotting library, on any of its backends.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;

use super::FONT;
use super::layout::{BOTTOM, Layout, MARGIN, Place, RIGHT, TITLE, squared, ticks};
use super::legend::legend;
use super::raster::Placed;
use crate::experiments::figure::{Figure, Mark, Panel, Rgb, Series};

type Plane = Cartesian2d<Scale, Scale>;

/// An axis between two values with ticks where we want them; the library's own choice knows neither names nor degrees.
struct Scale {
    low: f64,
    high: f64,
    ticks: Vec<f64>,
}

impl Scale {
    fn new([low, high]: [f64; 2], ticks: &[(f64, String)]) -> Self {
        Self {
            low,
            high,
            ticks: ticks.iter().map(|(at, _)| *at).collect(),
        }
    }
}

impl Ranged for Scale {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (first, last): (i32, i32)) -> i32 {
        let share = (value - self.low) / (self.high - self.low);
        let place = f64::from(first) + share * f64::from(last - first);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the saturating cast is what is meant: far beyond the picture"
        )]
        let pixel = place.round().clamp(-1e6, 1e6) as i32;
        pixel
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.ticks.clone()
        }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

/// Draws all panels; `paint` lays a panel's raster under its series.
pub(super) fn panels<DB: DrawingBackend>(
    root: &DrawingArea<DB, Shift>,
    figure: &Figure,
    layout: &Layout,
    mut paint: impl FnMut(&DrawingArea<DB, Shift>, &Placed<'_>) -> Result<(), String>,
) -> Result<(), String> {
    root.fill(&WHITE).map_err(told)?;
    for (panel, place) in figure.panels.iter().zip(&layout.panels) {
        draw(root, place, panel, &mut paint)?;
    }
    Ok(())
}

pub(super) fn told(error: impl std::error::Error) -> String {
    error.to_string()
}

fn draw<DB: DrawingBackend>(
    root: &DrawingArea<DB, Shift>,
    place: &Place,
    panel: &Panel,
    paint: &mut impl FnMut(&DrawingArea<DB, Shift>, &Placed<'_>) -> Result<(), String>,
) -> Result<(), String> {
    let area = &root
        .clone()
        .shrink((place.left, place.top), (place.width, place.height));
    let above = TITLE + place.legend;
    let plot = [
        f64::from(place.width - place.labels - RIGHT - 2 * MARGIN),
        f64::from(place.height - above - BOTTOM - 2 * MARGIN),
    ];
    let [x, y] = squared(panel, plot);
    let (x_ticks, y_ticks) = (ticks(&panel.x, x, 6.0), ticks(&panel.y, y, 6.0));
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .margin_right(MARGIN + RIGHT)
        .margin_top(MARGIN + above)
        .x_label_area_size(BOTTOM)
        .y_label_area_size(place.labels)
        .build_cartesian_2d(Scale::new(x, &x_ticks), Scale::new(y, &y_ticks))
        .map_err(told)?;
    title(area, &panel.title)?;
    if let Some(raster) = &panel.ground {
        let (left, top) = chart.backend_coord(&(x[0], y[1]));
        let (right, bottom) = chart.backend_coord(&(x[1], y[0]));
        let corners = [left, top, right, bottom];
        paint(root, &Placed { raster, corners })?;
    }
    if let Some(raster) = &panel.raster {
        let (left, top) = chart.backend_coord(&(panel.x.low, panel.y.high));
        let (right, bottom) = chart.backend_coord(&(panel.x.high, panel.y.low));
        let corners = [left, top, right, bottom];
        paint(root, &Placed { raster, corners })?;
    }
    let label = |ticks: Vec<(f64, String)>| {
        move |value: &f64| {
            let near = ticks
                .iter()
                .find(|(at, _)| (at - value).abs() < 1e-9 * (1.0 + at.abs()));
            near.map_or_else(String::new, |(_, label)| label.clone())
        }
    };
    let (x_label, y_label) = (label(x_ticks), label(y_ticks));
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(panel.x.label.as_str())
        .y_desc(panel.y.label.as_str())
        .axis_desc_style((FONT, 16))
        .label_style((FONT, 14))
        .axis_style(RGBColor(70, 70, 70))
        .bold_line_style(RGBColor(222, 222, 222))
        .x_label_formatter(&x_label)
        .y_label_formatter(&y_label);
    if panel.raster.is_some() {
        mesh.disable_mesh();
    }
    mesh.draw().map_err(told)?;
    for series in &panel.series {
        add(&mut chart, series).map_err(told)?;
    }
    let (left, top) = chart.backend_coord(&(x[0], y[1]));
    legend(root, panel, (left, top - i32::try_from(place.legend).unwrap_or(0)))
}

/// In the middle above the plotting area, smaller where it would not fit.
fn title<DB: DrawingBackend>(area: &DrawingArea<DB, Shift>, text: &str) -> Result<(), String> {
    let (width, _) = area.dim_in_pixel();
    let fits = |size: &f64| {
        let drawn = area.estimate_text_size(text, &(FONT, *size).into_text_style(area));
        drawn.is_ok_and(|(wide, _)| wide + 2 * MARGIN <= width)
    };
    let size = [18.0, 16.0, 14.0, 12.0].into_iter().find(fits).unwrap_or(11.0);
    let anchor = plotters::style::text_anchor::Pos::new(
        plotters::style::text_anchor::HPos::Center,
        plotters::style::text_anchor::VPos::Top,
    );
    let style = (FONT, size).into_text_style(area).pos(anchor);
    let middle = i32::try_from(width / 2).unwrap_or(0);
    area.draw(&Text::new(text.to_owned(), (middle, 14), style))
        .map_err(told)
}

type Chart<'a, DB> = ChartContext<'a, DB, Plane>;
type Drawing<DB> = Result<(), plotters::drawing::DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

pub(super) fn color_of([r, g, b]: Rgb) -> RGBColor {
    RGBColor(r, g, b)
}

fn add<'a, DB: DrawingBackend + 'a>(chart: &mut Chart<'a, DB>, series: &Series) -> Drawing<DB> {
    let color = color_of(series.color);
    let points: Vec<(f64, f64)> = series
        .points
        .iter()
        .filter(|[x, y]| x.is_finite() && y.is_finite())
        .map(|[x, y]| (*x, *y))
        .collect();
    let thin = color.stroke_width(1);
    let wide = color.stroke_width(2);
    for ([x, y], [low, high]) in series.points.iter().zip(&series.spread) {
        if low.is_finite() && high.is_finite() {
            chart.draw_series([ErrorBar::new_vertical(*x, *low, *y, *high, thin, 8)])?;
        }
    }
    match series.mark {
        Mark::Line => {
            chart.draw_series(LineSeries::new(points, wide))?;
        }
        Mark::Dashed => {
            chart.draw_series(DashedLineSeries::new(points, 6, 4, wide))?;
        }
        Mark::LineAndDots => {
            chart.draw_series(LineSeries::new(points.iter().copied(), wide))?;
            chart.draw_series(points.into_iter().map(|at| Circle::new(at, 3, color.filled())))?;
        }
        Mark::Dot => {
            chart.draw_series(points.into_iter().map(|at| Circle::new(at, 3, color.filled())))?;
        }
        Mark::Circle => {
            chart.draw_series(points.into_iter().map(|at| Circle::new(at, 6, wide)))?;
        }
        Mark::Cross => {
            chart.draw_series(points.into_iter().map(|at| Cross::new(at, 6, wide)))?;
        }
        Mark::Square => {
            let square = |at| EmptyElement::at(at) + Rectangle::new([(-5, -5), (5, 5)], thin);
            chart.draw_series(points.into_iter().map(square))?;
        }
        Mark::Bar(hundredths) => {
            let half = f64::from(hundredths) / 200.0;
            let bar = |(x, y): &(f64, f64)| Rectangle::new([(0.0, y - half), (*x, y + half)], color.filled());
            chart.draw_series(points.iter().map(bar))?;
            let value = |at: (f64, f64)| EmptyElement::at(at) + Text::new(short(at.0), (5, -6), (FONT, 13).into_font());
            chart.draw_series(points.into_iter().map(value))?;
        }
    }
    Ok(())
}

/// A number as it stands behind its bar.
fn short(value: f64) -> String {
    if value >= 10.0 || (value - value.round()).abs() < 1e-9 {
        format!("{value:.0}")
    } else {
        format!("{value:.2}")
    }
}
