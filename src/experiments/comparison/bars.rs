//! Table 3 as bars.

use super::compared::{Compared, Row};
use super::printed::printed_ratio;
use crate::experiments::bars::{Bars, bar_panel};
use crate::experiments::figure::{Figure, PALETTE, Panel};
use crate::experiments::numbers::real;

impl Compared<'_> {
    pub(super) fn figure(&self) -> Figure {
        let names: Vec<String> = self.names.iter().map(ToString::to_string).collect();
        let bars = |title: &str, label: &str, value: &dyn Fn(usize, bool) -> f64| -> Panel {
            let group = |near: bool, words: &'static str, color| Bars {
                label: words,
                color,
                values: (0..names.len()).map(|k| value(k, near)).collect(),
            };
            let groups = vec![
                group(true, "frames within 20 cells", PALETTE[0]),
                group(false, "frames anywhere", PALETTE[1]),
            ];
            bar_panel(title, label, &names, groups)
        };
        let posed = |k: usize, near: bool| {
            let rows: Vec<Row> = self
                .kinds()
                .into_iter()
                .filter(|(experiment, of)| *of == near && *experiment < 4)
                .map(|(experiment, of)| self.of(k, experiment, of))
                .collect();
            let pairs: usize = rows.iter().map(|row| row.pairs).sum();
            100.0 * rows.iter().map(|row| row.posed * real(row.pairs)).sum::<f64>() / real(pairs.max(1))
        };
        let ratios = |of: &dyn Fn(usize) -> f64, label: &'static str, color| Bars {
            label,
            color,
            values: (0..names.len()).map(of).collect(),
        };
        let measured = |k: usize| self.mean_ratio(self.names[k]).unwrap_or(f64::NAN);
        let printed = |k: usize| printed_ratio(self.names[k]).unwrap_or(f64::NAN);
        let time = bar_panel(
            "Time of a pair over that of hough-peaks",
            "ratio",
            &names,
            vec![
                ratios(&measured, "here", PALETTE[2]),
                ratios(&printed, "the paper's table 3", PALETTE[7]),
            ],
        );
        let panels = vec![
            bars("Right decisions", "pairs [%]", &|k, near| {
                100.0 * self.over_all(k, near).0
            }),
            bars("Best pose within 0.5 m of the truth", "matching pairs [%]", &posed),
            bars("Merged wrongly", "pairs", &|k, near| real(self.over_all(k, near).1)),
            time,
        ];
        let caption = "Table 3 of the paper as bars, over all pairs of the four experiments. Right decisions and wrong merges \
                       also count the pairs of maps of two places.";
        Figure::new("table-3", caption, 2, panels)
    }
}
