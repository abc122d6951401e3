//! The legend of a panel: a sample and the name of each labelled series, in a corner of the plotting area.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::FONT;
use super::chart::{color_of, told};
use crate::experiments::figure::{Corner, Mark, Panel, Series};

const TEXT: i32 = 14;
const ROW: i32 = 20;
const SAMPLE: i32 = 26;
const PAD: i32 = 8;

/// Draws the legend, when a series has a label. `corners` are the plotting area's left, top, right and bottom pixels.
pub(super) fn legend<DB: DrawingBackend>(
    root: &DrawingArea<DB, Shift>,
    panel: &Panel,
    [left, top, right, bottom]: [i32; 4],
) -> Result<(), String> {
    let labelled: Vec<(&str, &Series)> = panel
        .series
        .iter()
        .filter_map(|series| series.label.as_deref().map(|label| (label, series)))
        .collect();
    if labelled.is_empty() {
        return Ok(());
    }
    let style = (FONT, TEXT).into_text_style(root);
    let wide = |label: &str| root.estimate_text_size(label, &style).map_or(0, |(wide, _)| wide);
    let text = labelled.iter().map(|(label, _)| wide(label)).max().unwrap_or(0);
    let width = PAD + SAMPLE + 6 + i32::try_from(text).unwrap_or(0) + PAD;
    let height = PAD + ROW * i32::try_from(labelled.len()).unwrap_or(0) + PAD / 2;
    let (x, y) = match panel.legend {
        Corner::UpperLeft => (left + PAD, top + PAD),
        Corner::UpperRight => (right - PAD - width, top + PAD),
        Corner::LowerLeft => (left + PAD, bottom - PAD - height),
        Corner::LowerRight => (right - PAD - width, bottom - PAD - height),
    };
    let frame = [(x, y), (x + width, y + height)];
    root.draw(&Rectangle::new(frame, WHITE.mix(0.88).filled()))
        .map_err(told)?;
    root.draw(&Rectangle::new(frame, RGBColor(150, 150, 150)))
        .map_err(told)?;
    for ((label, series), row) in labelled.into_iter().zip(0..) {
        let middle = y + PAD + ROW * row + ROW / 2 - 2;
        sample(root, (x + PAD, middle), series)?;
        let at = (x + PAD + SAMPLE + 6, middle - TEXT / 2 + 3);
        root.draw(&Text::new(label.to_owned(), at, style.clone()))
            .map_err(told)?;
    }
    Ok(())
}

/// The mark of a series as it looks in the chart.
fn sample<DB: DrawingBackend>(
    root: &DrawingArea<DB, Shift>,
    (x, y): (i32, i32),
    series: &Series,
) -> Result<(), String> {
    let color = color_of(series.color);
    let wide = color.stroke_width(2);
    let (end, middle) = (x + SAMPLE, (x + SAMPLE / 2, y));
    let line = |from: i32, to: i32| {
        root.draw(&PathElement::new(vec![(from, y), (to, y)], wide))
            .map_err(told)
    };
    match series.mark {
        Mark::Line => line(x, end),
        Mark::Dashed => line(x, x + 9).and_then(|()| line(end - 9, end)),
        Mark::LineAndDots => {
            line(x, end)?;
            root.draw(&Circle::new(middle, 3, color.filled())).map_err(told)
        }
        Mark::Dot => root.draw(&Circle::new(middle, 3, color.filled())).map_err(told),
        Mark::Circle => root.draw(&Circle::new(middle, 6, wide)).map_err(told),
        Mark::Cross => root.draw(&Cross::new(middle, 6, wide)).map_err(told),
        Mark::Square => {
            let corners = [(middle.0 - 5, y - 5), (middle.0 + 5, y + 5)];
            root.draw(&Rectangle::new(corners, wide)).map_err(told)
        }
        Mark::Bar(_) => {
            let corners = [(middle.0 - 8, y - 5), (middle.0 + 8, y + 5)];
            root.draw(&Rectangle::new(corners, color.filled())).map_err(told)
        }
    }
}
