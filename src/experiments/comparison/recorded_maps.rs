//! The same methods on recorded maps.

use crate::experiments::Settings;
use crate::experiments::answer::Answer;
use crate::experiments::bars::{Bars, bar_panel};
use crate::experiments::figure::{Figure, PALETTE};
use crate::experiments::numbers::{quantile, real};
use crate::experiments::outcome::{Claim, Table, Verdict};
use crate::registration::MethodName;
/// The answers on recorded maps.
pub(super) struct Recorded<'a> {
    pub(super) names: &'a [MethodName],
    pub(super) settings: &'a Settings,
    pub(super) answers: &'a [Vec<Answer>],
}

/// What one method does on recorded maps.
struct RecordedRow {
    matching: usize,
    correct: usize,
    wrong: usize,
    different: usize,
    falsely: usize,
    error: f64,
    seconds: f64,
}

impl Recorded<'_> {
    fn of(&self, k: usize) -> RecordedRow {
        let mut row = RecordedRow {
            matching: 0,
            correct: 0,
            wrong: 0,
            different: 0,
            falsely: 0,
            error: f64::NAN,
            seconds: f64::NAN,
        };
        let mut errors = Vec::new();
        for (pair, answers) in self.settings.recorded.iter().zip(self.answers) {
            let answer = &answers[k];
            if pair.truth.is_none() {
                row.different += 1;
                row.falsely += usize::from(answer.merged);
                continue;
            }
            row.matching += 1;
            let right = answer.error_m.is_some_and(|error| error <= pair.tolerance_m);
            row.correct += usize::from(answer.merged && right);
            row.wrong += usize::from(answer.merged && !right);
            errors.extend(answer.error_m.filter(|_| answer.merged && right));
        }
        let seconds: Vec<f64> = self.answers.iter().map(|answers| answers[k].seconds).collect();
        row.error = quantile(&errors, 0.5);
        row.seconds = quantile(&seconds, 0.5);
        row
    }

    pub(super) fn table(&self) -> Table {
        let mut table = Table::new(
            "recorded",
            "The same methods on recorded maps in the frames that they have: an evenly spread part of the list. Wrong: \
             matching maps merged at a wrong pose. False: maps of different places merged.",
            &[
                "method",
                "matching pairs",
                "recall",
                "wrong",
                "pairs of different places",
                "false",
                "error of the right ones, median [m]",
                "time of a pair, median [s]",
            ],
        );
        for (k, name) in self.names.iter().enumerate() {
            let row = self.of(k);
            table.push(vec![
                name.as_str().into(),
                row.matching.into(),
                (real(row.correct) / real(row.matching.max(1))).into(),
                row.wrong.into(),
                row.different.into(),
                row.falsely.into(),
                row.error.into(),
                row.seconds.into(),
            ]);
        }
        table
    }

    pub(super) fn claim(&self) -> Claim {
        let rows: Vec<(MethodName, RecordedRow)> = self
            .names
            .iter()
            .enumerate()
            .map(|(k, name)| (*name, self.of(k)))
            .collect();
        let told = rows.iter().map(|(name, row)| {
            format!(
                "{name}: {} of {} right, {} wrong or false",
                row.correct,
                row.matching,
                row.wrong + row.falsely
            )
        });
        let ours = rows
            .iter()
            .find(|(name, _)| *name == MethodName::ALL[0])
            .map(|(_, row)| row);
        let first = ours.is_some_and(|ours| {
            let others = rows.iter().filter(|(name, _)| *name != MethodName::ALL[0]);
            others
                .into_iter()
                .all(|(_, row)| ours.correct >= row.correct && ours.wrong + ours.falsely <= row.wrong + row.falsely)
        });
        Claim {
            claim: "Ours: on recorded maps too the default engine merges more pairs rightly and fewer wrongly than every other."
                .into(),
            paper: "-".into(),
            ours: told.collect::<Vec<_>>().join("; "),
            verdict: Verdict::when(first),
        }
    }

    pub(super) fn figure(&self) -> Figure {
        let names: Vec<String> = self.names.iter().map(ToString::to_string).collect();
        let rows: Vec<RecordedRow> = (0..names.len()).map(|k| self.of(k)).collect();
        let bars = |label, color, value: fn(&RecordedRow) -> f64| Bars {
            label,
            color,
            values: rows.iter().map(value).collect(),
        };
        let decided = bar_panel(
            "Merges of recorded maps",
            "pairs",
            &names,
            vec![
                bars("merged rightly", PALETTE[2], |row| real(row.correct)),
                bars("merged wrongly or falsely", PALETTE[1], |row| {
                    real(row.wrong + row.falsely)
                }),
            ],
        );
        let time = bar_panel(
            "Time of a pair",
            "median [s]",
            &names,
            vec![bars("", PALETTE[0], |row| row.seconds)],
        );
        let (matching, different) = rows.first().map_or((0, 0), |row| (row.matching, row.different));
        let caption = format!(
            "Merges of recorded maps by method, of {matching} matching pairs and {different} pairs of different places."
        );
        Figure::new("recorded", caption, 2, vec![decided, time])
    }
}
