//! Where panels stand in a picture, how large they are, and where their ticks are.

use crate::experiments::figure::{Axis, Figure, Panel, Series};
use crate::experiments::numbers::{index, real};

/// Pixels around the plotting area of a panel.
const LEFT: u32 = 74;
pub(super) const RIGHT: u32 = 26;
pub(super) const TITLE: u32 = 34;
pub(super) const BOTTOM: u32 = 56;
pub(super) const MARGIN: u32 = 8;

/// Pixels of the plotting area.
const PLOT_WIDTH: f64 = 470.0;
const PLOT_HEIGHT: f64 = 330.0;
const PLOT_HEIGHT_MAX: f64 = 560.0;
/// Pixels of a named row, where its bars are to be told apart.
const ROW_HEIGHT: f64 = 30.0;
/// No letter of a tick or of a legend is wider in the mean, in pixels.
const LETTER: f64 = 8.0;

/// Sizes in pixels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) panels: Vec<Place>,
}

/// Where one panel stands, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) left: u32,
    pub(super) top: u32,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Room left of the plotting area for the labels of the upright axis.
    pub(super) labels: u32,
    /// Room above the plotting area for the legend.
    pub(super) legend: u32,
}

impl Layout {
    pub(super) fn of(figure: &Figure) -> Self {
        let columns = figure.columns.min(figure.panels.len().max(1));
        let labels = figure.panels.iter().map(label_width).max().unwrap_or(LEFT);
        let width = labels + RIGHT + 2 * MARGIN + index(PLOT_WIDTH);
        let mut panels = Vec::new();
        let mut top = 0;
        for row in figure.panels.chunks(columns) {
            let plot = row.iter().map(plot_height).fold(0.0, f64::max);
            let legend = row
                .iter()
                .map(|panel| legend_height(&legend_rows(panel)))
                .max()
                .unwrap_or(0);
            let height = TITLE + legend + BOTTOM + 2 * MARGIN + index(plot);
            panels.extend((0..row.len()).map(|column| Place {
                left: index(real(column)) * width,
                top,
                width,
                height,
                labels,
                legend,
            }));
            top += height;
        }
        Self {
            width: index(real(columns)) * width,
            height: top.max(1),
            panels,
        }
    }
}

/// Pixels that a text takes at most.
fn text_width(text: &str) -> u32 {
    index(LETTER * real(text.chars().count()))
}

fn label_width(panel: &Panel) -> u32 {
    let named = panel.y.ticks.iter().map(|(_, name)| text_width(name) + 16);
    named.max().unwrap_or(0).max(LEFT)
}

fn plot_height(panel: &Panel) -> f64 {
    if panel.square {
        let aspect = (panel.y.high - panel.y.low) / (panel.x.high - panel.x.low);
        (PLOT_WIDTH * aspect).clamp(120.0, PLOT_HEIGHT_MAX)
    } else {
        PLOT_HEIGHT.max(ROW_HEIGHT * real(panel.y.ticks.len()))
    }
}

/// Pixels of a row of a legend, of the sample in it, and of the room around both.
pub(super) const LEGEND_ROW: u32 = 20;
pub(super) const SAMPLE: u32 = 26;
pub(super) const PAD: u32 = 8;

/// An entry of a legend: from where on in its row, in pixels, and what it names.
pub(super) type Entry<'a> = (u32, &'a str, &'a Series);

/// The labelled series of a panel in rows that are no wider than its plotting area.
pub(super) fn legend_rows(panel: &Panel) -> Vec<Vec<Entry<'_>>> {
    let mut rows: Vec<Vec<Entry<'_>>> = Vec::new();
    let mut at = 0;
    for series in &panel.series {
        let Some(label) = series.label.as_deref() else {
            continue;
        };
        let wide = SAMPLE + text_width(label) + 2 * PAD;
        match rows.last_mut() {
            Some(row) if f64::from(at + wide) <= PLOT_WIDTH => row.push((at, label, series)),
            _ => {
                at = 0;
                rows.push(vec![(0, label, series)]);
            }
        }
        at += wide;
    }
    rows
}

fn legend_height(rows: &[Vec<Entry<'_>>]) -> u32 {
    if rows.is_empty() {
        0
    } else {
        index(real(rows.len())) * LEGEND_ROW + PAD / 2
    }
}

/// The ends of both axes, widened until a unit of x is as long as one of y on an area of this size in pixels.
pub(super) fn squared(panel: &Panel, [width, height]: [f64; 2]) -> [[f64; 2]; 2] {
    let ends = |axis: &Axis| [axis.low, axis.high];
    let [mut x, mut y] = [ends(&panel.x), ends(&panel.y)];
    if panel.square {
        let per_pixel = ((x[1] - x[0]) / width).max((y[1] - y[0]) / height);
        for (axis, pixels) in [(&mut x, width), (&mut y, height)] {
            let more = (per_pixel * pixels - (axis[1] - axis[0])) / 2.0;
            *axis = [axis[0] - more, axis[1] + more];
        }
    }
    [x, y]
}

/// Ticks at round numbers, about `wanted` of them, with their labels.
pub(super) fn ticks(axis: &Axis, [low, high]: [f64; 2], wanted: f64) -> Vec<(f64, String)> {
    if !axis.ticks.is_empty() {
        return axis.ticks.clone();
    }
    let raw = (high - low) / wanted;
    let unit = 10.0_f64.powf(raw.log10().floor());
    let factors = if axis.label.contains("deg") && raw > 10.0 {
        [1.5, 3.0, 4.5, 9.0]
    } else {
        [1.0, 2.0, 5.0, 10.0]
    };
    let step = factors
        .into_iter()
        .map(|f| f * unit)
        .find(|step| *step >= raw)
        .unwrap_or(10.0 * unit);
    let first = (low / step - 1e-9).ceil();
    let decimals = [0, 1, 2, 3, 4]
        .into_iter()
        .find(|decimals| {
            let shifted = step * 10.0_f64.powi(*decimals);
            (shifted - shifted.round()).abs() < 1e-6
        })
        .unwrap_or(5);
    let decimals = usize::try_from(decimals).unwrap_or(0);
    (0..40_u32)
        .map(|k| (first + f64::from(k)) * step)
        .take_while(|at| *at <= high + 1e-9 * step.abs())
        .map(|at| (at, format!("{:.decimals$}", at + 0.0)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::figure::Mark;

    #[test]
    fn ticks_are_round_numbers_within_the_axis() {
        let labels = |low: f64, high: f64| {
            let axis = Axis::new("V [%]", low, high);
            ticks(&axis, [low, high], 6.0)
                .into_iter()
                .map(|(_, label)| label)
                .collect::<Vec<_>>()
        };
        assert_eq!(labels(0.0, 100.0), ["0", "20", "40", "60", "80", "100"]);
        assert_eq!(labels(0.0, 0.1), ["0.00", "0.02", "0.04", "0.06", "0.08", "0.10"]);
        let degrees = Axis::new("theta [deg]", -90.0, 90.0);
        let at: Vec<f64> = ticks(&degrees, [-90.0, 90.0], 6.0)
            .into_iter()
            .map(|(at, _)| at)
            .collect();
        assert_eq!(at, [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0]);
    }

    #[test]
    fn a_legend_has_its_own_room_and_no_row_of_it_is_wider_than_the_plot() {
        let series = |label: &str| Series::new(label, [0; 3], Mark::Line, Vec::new());
        let mut panel = Panel::new("", Axis::new("x", 0.0, 1.0), Axis::new("y", 0.0, 1.0));
        let bare = Layout::of(&Figure::new("f", "", 1, vec![panel.clone()]));
        for label in ["hough, 40 %", "hough-peaks, as printed, 40 %", "", "hough-peaks, 70 %"] {
            panel = panel.with(series(label));
        }
        let rows = legend_rows(&panel);
        let named: Vec<Vec<&str>> = rows
            .iter()
            .map(|row| row.iter().map(|(_, label, _)| *label).collect())
            .collect();
        assert_eq!(
            named,
            [
                vec!["hough, 40 %", "hough-peaks, as printed, 40 %"],
                vec!["hough-peaks, 70 %"]
            ]
        );
        let with_legend = Layout::of(&Figure::new("f", "", 1, vec![panel]));
        assert_eq!(with_legend.height, bare.height + 2 * LEGEND_ROW + PAD / 2);
    }

    #[test]
    fn square_panels_have_units_of_one_length() {
        let mut panel = Panel::new("", Axis::new("x", 0.0, 10.0), Axis::new("y", 0.0, 2.0));
        panel.square = true;
        let [x, y] = squared(&panel, [500.0, 250.0]);
        assert!(((x[1] - x[0]) / 500.0 - (y[1] - y[0]) / 250.0).abs() < 1e-12);
        assert_eq!(x, [0.0, 10.0]);
    }
}
