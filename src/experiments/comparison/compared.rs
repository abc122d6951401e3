//! The answers of all methods on the four experiments, counted.

use super::cases::{Case, EXPERIMENTS};
use super::printed::printed;
use crate::experiments::answer::Answer;
use crate::experiments::numbers::{mean, real, share};
use crate::experiments::outcome::Table;
use crate::experiments::superiority::median_error_m;
use crate::registration::MethodName;
/// The answers on the four experiments.
pub(super) struct Compared<'a> {
    pub(super) names: &'a [MethodName],
    pub(super) answered: &'a [(Case, Vec<Answer>)],
}

/// Figures of one method in one row of the table.
pub(super) struct Row {
    pub(super) pairs: usize,
    pub(super) seconds: f64,
    pub(super) v: f64,
    pub(super) error: f64,
    pub(super) posed: f64,
    pub(super) right: usize,
    pub(super) wrong: usize,
    pub(super) decisions: f64,
}

impl Compared<'_> {
    pub(super) fn of(&self, k: usize, experiment: usize, near: bool) -> Row {
        let cases: Vec<(&Case, &Answer)> = self
            .answered
            .iter()
            .filter(|(case, _)| case.experiment == experiment && case.near == near)
            .map(|(case, answers)| (case, &answers[k]))
            .collect();
        let of = |value: fn(&Answer) -> Option<f64>| cases.iter().filter_map(|(_, a)| value(a)).collect::<Vec<f64>>();
        let decided = |(case, answer): &(&Case, &Answer)| {
            if case.faint {
                !answer.is_wrong()
            } else {
                answer.decides_well(case.truth.is_some())
            }
        };
        Row {
            pairs: cases.len(),
            seconds: mean(&of(|a| Some(a.seconds))),
            v: mean(&of(|a| a.verification_index)),
            error: median_error_m(cases.iter().map(|(_, answer)| *answer)),
            posed: share(&cases, |(_, answer)| answer.pose_is_right()),
            right: cases.iter().filter(|(_, answer)| answer.is_correct()).count(),
            wrong: cases.iter().filter(|(_, answer)| answer.is_wrong()).count(),
            decisions: share(&cases, decided),
        }
    }

    /// Rows that exist: the four experiments in both kinds of frames, then maps of two places.
    pub(super) fn kinds(&self) -> Vec<(usize, bool)> {
        let all = (0..5).flat_map(|experiment| [(experiment, true), (experiment, false)]);
        all.filter(|(experiment, near)| {
            self.answered
                .iter()
                .any(|(case, _)| case.experiment == *experiment && case.near == *near)
        })
        .collect()
    }

    pub(super) fn table(&self) -> Table {
        let mut table = Table::new(
            "table-3",
            "Table 3 of the paper beside ours. Time: mean of a pair; the ratio is to hough-peaks in the same run, the \
             paper's likewise. V: mean at the best pose. Error: median of the best pose, merged or not; none where half of the pairs have no pose. Merged wrongly also \
             counts maps of two places.",
            &[
                "experiment",
                "frames",
                "method",
                "pairs",
                "time [s]",
                "time ratio",
                "time ratio, paper",
                "V [%]",
                "V, paper [%]",
                "error, median [m]",
                "pose right [share]",
                "merged rightly",
                "merged wrongly",
                "right decisions [share]",
            ],
        );
        let peaks = self.names.iter().position(|name| *name == MethodName::HoughPeaks);
        for (experiment, near) in self.kinds() {
            let reference = peaks.map_or(f64::NAN, |k| self.of(k, experiment, near).seconds);
            for (k, name) in self.names.iter().enumerate() {
                let row = self.of(k, experiment, near);
                let (ratio, v) = printed(*name, experiment);
                table.push(vec![
                    EXPERIMENTS[experiment].into(),
                    if near { "within 20 cells" } else { "anywhere" }.into(),
                    name.as_str().into(),
                    row.pairs.into(),
                    row.seconds.into(),
                    (row.seconds / reference).into(),
                    ratio,
                    (100.0 * row.v).into(),
                    v,
                    row.error.into(),
                    row.posed.into(),
                    row.right.into(),
                    row.wrong.into(),
                    row.decisions.into(),
                ]);
            }
        }
        table
    }

    /// Right decisions, wrong merges and median error over all pairs in one kind of frames (maps of two places in both).
    pub(super) fn over_all(&self, k: usize, near: bool) -> (f64, usize) {
        let kinds: Vec<Row> = self
            .kinds()
            .into_iter()
            .filter(|(experiment, of)| *of == near || *experiment == 4)
            .map(|(experiment, of)| self.of(k, experiment, of))
            .collect();
        let pairs: usize = kinds.iter().map(|row| row.pairs).sum();
        let decided: f64 = kinds.iter().map(|row| row.decisions * real(row.pairs)).sum();
        (decided / real(pairs.max(1)), kinds.iter().map(|row| row.wrong).sum())
    }

    pub(super) fn mean_ratio(&self, name: MethodName) -> Option<f64> {
        let k = self.names.iter().position(|n| *n == name)?;
        let peaks = self.names.iter().position(|n| *n == MethodName::HoughPeaks)?;
        let kinds: Vec<(usize, bool)> = self
            .kinds()
            .into_iter()
            .filter(|(experiment, _)| *experiment < 4)
            .collect();
        let ratio = |(experiment, near): &(usize, bool)| {
            self.of(k, *experiment, *near).seconds / self.of(peaks, *experiment, *near).seconds
        };
        Some(mean(&kinds.iter().map(ratio).collect::<Vec<_>>()))
    }
}
