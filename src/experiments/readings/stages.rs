//! The stages over all pairs, as a table and as curves.

use super::sight::Sight;
use crate::experiments::figure::{Axis, Figure, Mark, PALETTE, Panel, Series};
use crate::experiments::numbers::{quantile, real, share};
use crate::experiments::outcome::Table;
/// The stages over all pairs.
pub(super) struct Measured<'a> {
    pub(super) sights: &'a [Sight],
}

impl Measured<'_> {
    pub(super) fn share(&self, so: impl Fn(&Sight) -> bool) -> f64 {
        share(self.sights, so)
    }

    pub(super) fn ranked(&self, f: usize, within: usize) -> f64 {
        self.share(|sight| sight.rank[f].is_some_and(|rank| rank < within))
    }

    pub(super) fn tuning(&self, k: usize) -> f64 {
        quantile(
            &self.sights.iter().map(|sight| sight.tuning[k]).collect::<Vec<_>>(),
            0.5,
        )
    }

    pub(super) fn differences(&self) -> Vec<f64> {
        self.sights
            .iter()
            .flat_map(|sight| sight.vote_differences.iter().copied())
            .collect()
    }

    pub(super) fn wrong(&self) -> Vec<f64> {
        self.sights
            .iter()
            .flat_map(|sight| sight.v_wrong.iter().copied())
            .collect()
    }

    pub(super) fn v_at_truth(&self, k: usize) -> Vec<f64> {
        self.sights
            .iter()
            .map(|sight| sight.v_at_truth[k])
            .filter(|v| v.is_finite())
            .collect()
    }

    pub(super) fn near_translation(&self, k: usize) -> f64 {
        self.share(|sight| sight.translation[k].is_some_and(|cells| cells <= 10.0))
    }

    #[expect(clippy::too_many_lines, reason = "one row after the other, as the page shows them")]
    pub(super) fn table(&self) -> Table {
        let mut table = Table::new(
            "stages",
            "Each stage alone, the stages before it right. Shares are of the matching pairs.",
            &["stage", "reading", "measure", "value"],
        );
        let mut row = |stage: &str, reading: &str, measure: &str, value: f64| {
            table.push(vec![stage.into(), reading.into(), measure.into(), value.into()]);
        };
        for (k, reading) in ["mean of tangents, as printed", "circular mean"]
            .into_iter()
            .enumerate()
        {
            row(
                "psi-hat (l. 11, eq. 26)",
                reading,
                "chooses the true rotation [share]",
                self.share(|s| s.chosen[k]),
            );
        }
        for (f, name) in ["max", "mean of non-zeros", "entropy"].into_iter().enumerate() {
            for within in [1, 2, 4] {
                let measure = format!("truth among the best {within} of the correlation, modulo 180 deg [share]");
                row("f (eq. 22-25)", name, &measure, self.ranked(f, within));
            }
        }
        for (k, reading) in ["candidate", "windows at the walls", "window as printed"]
            .into_iter()
            .enumerate()
        {
            row(
                "tuning (l. 16-19)",
                reading,
                "error of the rotation, median [deg]",
                self.tuning(k),
            );
        }
        let differences = self.differences();
        row(
            "v_gate (table 2)",
            "10 votes",
            "walls of both maps within the gate [share]",
            share(&differences, |d| *d < 10.0),
        );
        row(
            "v_gate (table 2)",
            "-",
            "difference of votes of one wall, median",
            quantile(&differences, 0.5),
        );
        row(
            "v_gate (table 2)",
            "-",
            "difference of votes of one wall, upper quartile",
            quantile(&differences, 0.75),
        );
        row(
            "d_gate (table 2)",
            "frames within 20 cells",
            "T_o within 10 cells at the true rotation [share]",
            self.near_translation(0),
        );
        row(
            "d_gate (table 2)",
            "frames anywhere",
            "T_o within 10 cells at the true rotation [share]",
            self.near_translation(1),
        );
        for (k, reading) in [
            "entropy, as printed",
            "V over cells known in both",
            "V over cells known in one",
        ]
        .into_iter()
        .enumerate()
        {
            row(
                "search (eq. 32)",
                reading,
                "optimum within 1.5 cells of the truth [share]",
                self.share(|s| s.optimum[k] <= 1.5),
            );
            row(
                "search (eq. 32)",
                reading,
                "optimum at the border of the search [share]",
                self.share(|s| s.at_border[k]),
            );
        }
        for (k, reading) in ["known in both", "known in one, as printed"].into_iter().enumerate() {
            let v = self.v_at_truth(k);
            row("dis (eq. 33)", reading, "V at the truth, median", quantile(&v, 0.5));
            row(
                "dis (eq. 33)",
                reading,
                "V at the truth at least 0.92 [share]",
                share(&v, |v| *v >= 0.92),
            );
        }
        let wrong = self.wrong();
        row(
            "V >= 92 % (section 4.3)",
            "known in both",
            "wrong hypotheses with V >= 0.92 [share]",
            share(&wrong, |v| *v >= 0.92),
        );
        row(
            "V >= 92 % (section 4.3)",
            "known in both",
            "wrong hypotheses looked at",
            real(wrong.len()),
        );
        table
    }

    /// Where the optima of the search lie: the share of pairs within so many cells of the truth.
    pub(super) fn figure(&self) -> Figure {
        let curve = |k: usize| {
            (0..=60_u32)
                .map(|d| f64::from(d) / 4.0)
                .map(|cells| [cells, 100.0 * self.share(|s| s.optimum[k] <= cells)])
                .collect()
        };
        let mut panel = Panel::new(
            "Optimum of the search at the true rotation",
            Axis::new("distance from the truth [cells]", 0.0, 15.0),
            Axis::new("pairs within [%]", 0.0, 105.0),
        );
        let names = [
            "least entropy, as printed",
            "greatest V, known in both",
            "greatest V, known in one",
        ];
        for (k, name) in names.into_iter().enumerate() {
            panel = panel.with(Series::new(name, PALETTE[k], Mark::Line, curve(k)));
        }
        let values = self.wrong();
        let truths = [self.v_at_truth(0), self.v_at_truth(1)];
        let below = |of: &[f64]| {
            (0..=50_u32)
                .map(|k| 2.0 * f64::from(k))
                .map(|v| [v, 100.0 * share(of, |x| 100.0 * *x >= v)])
                .collect::<Vec<[f64; 2]>>()
        };
        let threshold = Series::new("92 %", PALETTE[7], Mark::Dashed, vec![[92.0, 0.0], [92.0, 105.0]]);
        let v = Panel::new(
            "V at the truth and at wrong hypotheses",
            Axis::new("V [%]", 0.0, 100.0),
            Axis::new("hypotheses with at least this V [%]", 0.0, 105.0),
        )
        .with(Series::new(
            "truth, known in both",
            PALETTE[2],
            Mark::Line,
            below(&truths[0]),
        ))
        .with(Series::new(
            "truth, known in one",
            PALETTE[0],
            Mark::Line,
            below(&truths[1]),
        ))
        .with(Series::new(
            "wrong, known in both",
            PALETTE[1],
            Mark::Line,
            below(&values),
        ))
        .with(threshold);
        let caption = "Left: the search of eq. 32 started within 5 cells of the truth. Right: V decides nothing where the green \
                       and the orange line run together, and can be met nowhere where the blue line has fallen.";
        Figure::new("search-and-v", caption, 2, vec![panel, v])
    }
}
