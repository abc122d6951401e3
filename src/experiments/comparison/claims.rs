//! What table 3 claims, and what we claim of the default engine.

use super::cases::EXPERIMENTS;
use super::compared::{Compared, Row};
use super::printed::printed_ratio;
use crate::experiments::answer::Answer;
use crate::experiments::numbers::percent;
use crate::experiments::outcome::{Claim, Verdict};
use crate::experiments::superiority::{self, Score, better_than};
use crate::registration::MethodName;

impl Compared<'_> {
    pub(super) fn claims(&self) -> Vec<Claim> {
        let (mut beaten, mut comparisons) = (Vec::new(), 0);
        for (experiment, near) in self.kinds() {
            let scores: Vec<Score> = (0..self.names.len())
                .map(|k| {
                    let row = self.of(k, experiment, near);
                    Score {
                        method: self.names[k].to_string(),
                        decisions: row.decisions,
                        error_m: row.error,
                    }
                })
                .collect();
            let Some(ours) = scores.iter().find(|score| score.method == MethodName::ALL[0].as_str()) else {
                continue;
            };
            let frames = if near { "near" } else { "anywhere" };
            let place = format!("{}, frames {frames}", EXPERIMENTS[experiment]);
            beaten.extend(better_than(ours, &scores, &place));
            comparisons += 2 * (scores.len() - 1);
        }
        let told = |near: bool| {
            let each = self.names.iter().enumerate().map(|(k, name)| {
                let (decided, wrong) = self.over_all(k, near);
                format!("{name} {} ({wrong} wrong)", percent(decided))
            });
            each.collect::<Vec<_>>().join(", ")
        };
        let wrong: Vec<&Answer> = self
            .answered
            .iter()
            .filter(|(case, _)| !case.faint)
            .flat_map(|(_, answers)| answers)
            .filter(|answer| answer.pose.is_some() && !answer.pose_is_right())
            .collect();
        let verified = wrong
            .iter()
            .filter(|a| a.verification_index.is_some_and(|v| v >= 0.92))
            .count();
        let summary = format!(
            "Right decisions over all pairs, frames within 20 cells: {}. Frames anywhere: {}.",
            told(true),
            told(false)
        );
        let ours = [
            superiority::claim(&beaten, comparisons, &summary),
            Claim {
                claim: "V of at least 92 % verifies a result (section 4.3).".into(),
                paper: "\"it is very likely that the transformation matrix that has been found is correct\"".into(),
                ours: format!(
                    "{verified} of {} wrong best poses (all methods, maps of two places among them) have V of at least 92 %",
                    wrong.len()
                ),
                verdict: Verdict::when(verified * 20 < wrong.len()),
            },
        ];
        ours.into_iter()
            .chain(self.speed_claim())
            .chain(self.spectrum_claim())
            .collect()
    }

    /// Of methods that are there.
    fn speed_claim(&self) -> Option<Claim> {
        let ratios: Vec<(MethodName, f64)> = self
            .names
            .iter()
            .filter_map(|name| self.mean_ratio(*name).map(|r| (*name, r)))
            .collect();
        let printed: Vec<String> = self
            .names
            .iter()
            .filter_map(|name| printed_ratio(*name).map(|ratio| format!("{name} {ratio:.1}")))
            .collect();
        let slow = ["map-segmentation", "random-walk"];
        let compared: Vec<f64> = ratios
            .iter()
            .filter(|(n, _)| slow.contains(&n.as_str()))
            .map(|(_, r)| *r)
            .collect();
        (!compared.is_empty()).then(|| Claim {
            claim: "Hough peak matching is much faster than the random walk and the map segmentation.".into(),
            paper: format!("time over that of hough-peaks: {}", printed.join(", ")),
            ours: ratios
                .iter()
                .map(|(name, r)| format!("{name} {r:.2}"))
                .collect::<Vec<_>>()
                .join(", "),
            verdict: match compared.iter().filter(|r| **r > 1.5).count() {
                0 => Verdict::Fails,
                n if n == slow.len() => Verdict::Holds,
                _ => Verdict::InPart,
            },
        })
    }

    /// Of methods that are there.
    fn spectrum_claim(&self) -> Option<Claim> {
        let of: Vec<(&str, Row)> = self
            .names
            .iter()
            .enumerate()
            .filter(|(_, name)| ["hough-spectrum", "fourier-hough", "hough-peaks"].contains(&name.as_str()))
            .map(|(k, name)| (name.as_str(), self.of(k, 2, true)))
            .collect();
        let told = of
            .iter()
            .map(|(name, row)| format!("{name}: pose right in {} of {} pairs", percent(row.posed), row.pairs));
        let rivals_fail = of
            .iter()
            .filter(|(name, _)| *name != "hough-peaks")
            .all(|(_, row)| row.posed < 0.5);
        let peaks_win = of.iter().any(|(name, row)| *name == "hough-peaks" && row.posed >= 0.5);
        (of.len() > 1).then(|| Claim {
            claim: "With two robots and little overlap the Hough spectrum and Fourier-Hough fail, and peak matching does not."
                .into(),
            paper: "both fail in experiment 3, hough-peaks has V = 92 %".into(),
            ours: told.collect::<Vec<_>>().join("; "),
            verdict: match (rivals_fail, peaks_win) {
                (true, true) => Verdict::Holds,
                (false, false) => Verdict::Fails,
                _ => Verdict::InPart,
            },
        })
    }
}
