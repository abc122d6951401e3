//! What the paper says of each reading, and what was measured.

use super::pipeline::Row;
use super::stages::Measured;
use crate::experiments::numbers::{mean, percent, quantile, share};
use crate::experiments::outcome::{Claim, Verdict};

impl Measured<'_> {
    #[expect(clippy::too_many_lines, reason = "one row after the other, as the page shows them")]
    pub(super) fn claims(&self, rows: &[Row]) -> Vec<Claim> {
        let pipeline = |name: &str| rows.iter().find(|row| row.name == name);
        let posed = |name: &str| pipeline(name).map_or("-".to_owned(), |row| percent(row.posed));
        let (differences, wrong) = (self.differences(), self.wrong());
        let claim = |claim: &str, paper: &str, ours: String, verdict: Verdict| Claim {
            claim: claim.to_owned(),
            paper: paper.to_owned(),
            ours,
            verdict,
        };
        let v = [self.v_at_truth(0), self.v_at_truth(1)];
        vec![
            claim(
                "psi-hat chooses the rotation among the candidates (l. 11, eq. 26).",
                "\"it can help to select the best rotation\"",
                format!(
                    "It chooses the true one in {} (as printed), in {} (circular mean); by chance it would be one of eight. Poses \
                     right in the whole pipeline: {} and {}, with all candidates verified {}.",
                    percent(self.share(|s| s.chosen[0])),
                    percent(self.share(|s| s.chosen[1])),
                    posed("one rotation, by psi-hat as printed"),
                    posed("one rotation, by a circular psi-hat"),
                    posed("ours")
                ),
                Verdict::when(self.share(|s| s.chosen[0]) >= 0.8),
            ),
            claim(
                "max is the best f.",
                "max; the mean and the entropy are off by 25 degrees",
                format!(
                    "Truth first among the maxima, modulo 180 degrees: max {}, mean of non-zeros {}, entropy {}; among the first \
                     four {}, {}, {}.",
                    percent(self.ranked(0, 1)),
                    percent(self.ranked(1, 1)),
                    percent(self.ranked(2, 1)),
                    percent(self.ranked(0, 4)),
                    percent(self.ranked(1, 4)),
                    percent(self.ranked(2, 4))
                ),
                Verdict::when((1..3).all(|f| self.ranked(0, 1) >= self.ranked(f, 1))),
            ),
            claim(
                "Tuning around psi_o +- Lambda (l. 16-18) improves the rotation.",
                "-5 degrees becomes -5.5 degrees",
                format!(
                    "Median error: candidate {:.2} degrees, window as printed {:.2}, windows at the walls' directions {:.2}.",
                    self.tuning(0),
                    self.tuning(2),
                    self.tuning(1)
                ),
                Verdict::when(self.tuning(2) < self.tuning(0)),
            ),
            claim(
                "v_gate = 10: the same wall has the same votes in both maps.",
                "values of peaks are lengths of walls",
                format!(
                    "Of {} walls that both maps show, {} lie within the gate; the median difference is {:.0} votes, the upper \
                     quartile {:.0}.",
                    differences.len(),
                    percent(share(&differences, |d| *d < 10.0)),
                    quantile(&differences, 0.5),
                    quantile(&differences, 0.75)
                ),
                Verdict::when(share(&differences, |d| *d < 10.0) >= 0.8),
            ),
            claim(
                "d_gate = 30 cells: no initial estimate is needed.",
                "\"no initial estimate is available\"",
                format!(
                    "At the true rotation T_o is within 10 cells in {} when the frames lie within 20 cells of each other, and in \
                     {} when they lie anywhere.",
                    percent(self.near_translation(0)),
                    percent(self.near_translation(1))
                ),
                Verdict::when(
                    self.near_translation(1) >= 0.8 * self.near_translation(0) && self.near_translation(0) > 0.0,
                ),
            ),
            claim(
                "The least entropy is at the right translation (eq. 31, 32).",
                "figure 10 c)",
                format!(
                    "At the true rotation, starting within 5 cells: the least entropy is within 1.5 cells of the truth in {} and at \
                     the border of the search in {}; the greatest V within 1.5 cells in {}.",
                    percent(self.share(|s| s.optimum[0] <= 1.5)),
                    percent(self.share(|s| s.at_border[0])),
                    percent(self.share(|s| s.optimum[1] <= 1.5))
                ),
                Verdict::when(self.share(|s| s.optimum[0] <= 1.5) >= 0.8),
            ),
            claim(
                "dis counts cells known in at least one map (eq. 33), and V >= 92 % accepts.",
                "V = 92 to 94 % at 31 to 70 % of overlap",
                format!(
                    "V at the truth by these words: median {:.0} %, at least 92 % in {}. Over cells known in both: median {:.0} \
                     %, at least 92 % in {}.",
                    100.0 * quantile(&v[1], 0.5),
                    percent(share(&v[1], |v| *v >= 0.92)),
                    100.0 * quantile(&v[0], 0.5),
                    percent(share(&v[0], |v| *v >= 0.92))
                ),
                Verdict::when(share(&v[1], |v| *v >= 0.92) >= 0.8),
            ),
            claim(
                "V >= 92 % tells a right transformation from a wrong one.",
                "\"very likely that the transformation matrix that has been found is correct\"",
                format!(
                    "{} of {} wrong hypotheses have V >= 92 % (mean {:.0} %). In the whole pipeline {} matching pairs are merged \
                     wrongly, and {} pairs of two buildings merged.",
                    percent(share(&wrong, |v| *v >= 0.92)),
                    wrong.len(),
                    100.0 * mean(&wrong),
                    pipeline("ours").map_or(0, |row| row.wrong),
                    pipeline("ours").map_or(0, |row| row.falsely)
                ),
                Verdict::when(share(&wrong, |v| *v >= 0.92) < 0.05),
            ),
            claim(
                "The pipeline as printed solves such pairs.",
                "four experiments, V = 92 to 94 %",
                format!(
                    "Poses right: {} as printed, {} with our readings.",
                    posed("all as printed"),
                    posed("ours")
                ),
                Verdict::when(pipeline("all as printed").is_some_and(|row| row.posed >= 0.8)),
            ),
        ]
    }
}
