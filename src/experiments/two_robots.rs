//! Figure 12: two robots, little overlap, corridors of nearly equal size outside of it, rotation near 90 degrees.

use rayon::prelude::*;

use super::answer::{Answer, answer};
use super::numbers::mean;
use super::outcome::{Claim, Outcome, Table, Verdict};
use super::steps::Steps;
use super::{ExperimentError, ExperimentName, Settings, team, worlds};
use crate::registration::{Control, MethodName, MethodSpec};

pub(super) fn run(settings: &Settings, control: &dyn Control) -> Result<Outcome, ExperimentError> {
    let seeds: u64 = if settings.quick { 2 } else { 20 };
    let steps = Steps::new(control, 3);
    let robots = worlds::two_robots(settings.seed)?;
    steps.step();
    let pairs = team::pairs(&robots);
    let (pair_table, answers) = team::pair_table(&robots, &pairs, control);
    steps.step();
    let welds = team::welds(&robots, settings.seed, control)?;
    steps.step();
    let repeated = repeated(settings.seed, seeds, control)?;
    let [area, common] = team::coverage_m2(&robots);
    let [peaks, ours] = &answers[0];
    let error = |answer: &Answer| answer.error_m.map_or("none".to_owned(), |e| format!("{e:.3} m"));
    let shown = |answer: &Answer| {
        let v = answer
            .verification_index
            .map_or("-".to_owned(), |v| format!("{:.0} %", 100.0 * v));
        let merged = if answer.merged { "merged" } else { answer.reason };
        format!("{merged}, V {v}, error {}", error(answer))
    };
    let claims = vec![
        Claim {
            claim: "The setting: total area, overlap of it, trajectories, rotation.".into(),
            paper: "81.02 m2, 31 %, 22.5 m and 25.9 m, close to 90 degrees".into(),
            ours: format!(
                "{area:.1} m2, {:.0} %, {:.1} m and {:.1} m, {:.0} degrees",
                100.0 * common / area,
                robots[0].driven_m,
                robots[1].driven_m,
                pairs[0].truth.yaw().degrees()
            ),
            verdict: Verdict::when((common / area - 0.31).abs() < 0.05 && (area - 81.0).abs() < 8.0),
        },
        Claim {
            claim: "Hough peak matching finds the transformation by the overlap, and rejects the corridors of nearly equal \
                    size outside of it."
                .into(),
            paper: "V = 92 %".into(),
            ours: format!("{}. {}", shown(peaks), repeated.told(0)),
            verdict: repeated.verdict(0),
        },
        Claim {
            claim: "Ours: the default engine merges the two maps rightly.".into(),
            paper: "-".into(),
            ours: format!("{}. {}", shown(ours), repeated.told(1)),
            verdict: repeated.verdict(1),
        },
    ];
    let caption = "Figure 12 of the paper: a) and b) the two maps and the robots' ways; c) and d) both maps fused, walls of \
                   both in black.";
    Ok(Outcome {
        name: ExperimentName::TwoRobots,
        method: "A basement of 81 m2 carved out of solid ground: a short passage and a room that both robots see, and two \
                 corridors of 15.5 m and 12.2 m that one robot sees each. Lidars reach 5 m. Frames within 20 cells of each \
                 other, turned by 88 degrees. Repeated with other noise and other frames."
            .into(),
        claims,
        tables: vec![pair_table, repeated.table(), team::weld_table(&robots, &welds)],
        figures: vec![team::figure("figure-12", caption, &robots, &welds)],
    })
}

/// The same place again and again, with other noise and other frames.
struct Repeated {
    /// By method: the paper's, the default.
    answers: Vec<[Answer; 2]>,
}

fn repeated(seed: u64, seeds: u64, control: &dyn Control) -> Result<Repeated, ExperimentError> {
    let answers = (0..seeds)
        .into_par_iter()
        .map(|k| {
            let robots = worlds::two_robots(seed.wrapping_mul(1000) + k)?;
            let truth = robots[0].pose_of(&robots[1]);
            Ok([MethodName::HoughPeaks, MethodName::Hough].map(|name| {
                let method = MethodSpec::default_of(name).build();
                answer(&*method, &robots[0].map, &robots[1].map, Some(truth), control)
            }))
        })
        .collect::<Result<_, ExperimentError>>()?;
    Ok(Repeated { answers })
}

impl Repeated {
    fn right(&self, k: usize) -> usize {
        self.answers.iter().filter(|of| of[k].is_correct()).count()
    }

    fn wrong(&self, k: usize) -> usize {
        self.answers.iter().filter(|of| of[k].is_wrong()).count()
    }

    fn told(&self, k: usize) -> String {
        let pairs = self.answers.len();
        format!(
            "Of {pairs} repetitions {} are merged rightly and {} wrongly",
            self.right(k),
            self.wrong(k)
        )
    }

    fn verdict(&self, k: usize) -> Verdict {
        match self.right(k) {
            0 => Verdict::Fails,
            right if right == self.answers.len() => Verdict::Holds,
            _ => Verdict::InPart,
        }
    }

    fn table(&self) -> Table {
        let mut table = Table::new(
            "repeated",
            "The same place with other noise of the lidars and other frames (within 20 cells of each other).",
            &[
                "method",
                "repetitions",
                "merged rightly",
                "merged wrongly",
                "refused",
                "V of the wrong ones, mean",
            ],
        );
        for (k, name) in [MethodName::HoughPeaks, MethodName::Hough].into_iter().enumerate() {
            let (all, right, wrong) = (self.answers.len(), self.right(k), self.wrong(k));
            let of_wrong = self.answers.iter().filter(|of| of[k].is_wrong());
            let v: Vec<f64> = of_wrong.filter_map(|of| of[k].verification_index).collect();
            table.push(vec![
                name.as_str().into(),
                all.into(),
                right.into(),
                wrong.into(),
                (all - right - wrong).into(),
                mean(&v).into(),
            ]);
        }
        table
    }
}
