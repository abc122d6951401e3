//! The legend of a panel: a sample and the name of each labelled series, above the plotting area, where it hides nothing.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::FONT;
use super::chart::{color_of, told};
use super::layout::{LEGEND_ROW, PAD, SAMPLE, legend_rows};
use crate::experiments::figure::{Mark, Panel, Series};

const TEXT: i32 = 14;

/// Draws the legend, when a series has a label, from its left upper pixel on.
pub(super) fn legend<DB: DrawingBackend>(
    root: &DrawingArea<DB, Shift>,
    panel: &Panel,
    (left, top): (i32, i32),
) -> Result<(), String> {
    let style = (FONT, TEXT).into_text_style(root);
    let pixels = |of: u32| i32::try_from(of).unwrap_or(0);
    let tops = (0..).map(|row| top + row * pixels(LEGEND_ROW));
    for (row, y) in legend_rows(panel).into_iter().zip(tops) {
        let middle = y + pixels(LEGEND_ROW) / 2;
        for (at, label, series) in row {
            let x = left + pixels(at);
            sample(root, (x, middle), series)?;
            let words = (x + pixels(SAMPLE + PAD) - 2, middle - TEXT / 2 + 1);
            root.draw(&Text::new(label.to_owned(), words, style.clone()))
                .map_err(told)?;
        }
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
    let length = i32::try_from(SAMPLE).unwrap_or(0);
    let (end, middle) = (x + length, (x + length / 2, y));
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
