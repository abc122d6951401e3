//! Where the paper's text is ambiguous or wrong: each reading measured on simulated pairs, alone and in the whole pipeline.

use rayon::prelude::*;

use super::answer::{Answer, RIGHT_WITHIN_M, answer};
use super::figure::{Axis, Corner, Figure, Mark, PALETTE, Panel, Series};
use super::frames::far;
use super::numbers::{mean, percent, quantile, real, share};
use super::outcome::{Claim, Outcome, Table, Verdict};
use super::pairs::{LabelledPair, near_pairs};
use super::steps::Steps;
use super::{ExperimentError, ExperimentName, Settings};
use crate::fusion::Moments;
use crate::geometry::{Angle, Pose2};
use crate::registration::methods::HoughPeaksParams;
use crate::registration::methods::hough_peaks::{
    Disagreement, HoughPeaks, Objective, Pairing, PsiHat, RotationChoice, RotationTuning, Spectrum, TranslationTrace,
    TranslationTuning,
};
use crate::registration::overlap::{StateMap, compare};
use crate::registration::{Control, Registration, register};
use crate::simulation::Random;

#[expect(
    clippy::unnecessary_wraps,
    reason = "experiments have one signature, and others can fail"
)]
pub(super) fn run(settings: &Settings, control: &dyn Control) -> Result<Outcome, ExperimentError> {
    let (matching, different) = if settings.quick { (3, 1) } else { (64, 24) };
    let pairs = near_pairs(settings.seed ^ 0x700, matching, different);
    let (together, apart): (Vec<&LabelledPair>, Vec<&LabelledPair>) = pairs.iter().partition(|p| p.truth.is_some());
    let variants = variants();
    let steps = Steps::new(control, together.len() + variants.len());
    let sights: Vec<Sight> = together
        .par_iter()
        .filter_map(|pair| {
            let sight = Sight::of(pair, settings.seed);
            steps.step();
            sight
        })
        .collect();
    let mut rows = Vec::new();
    for (name, params) in &variants {
        let method = HoughPeaks::new(params.clone()).expect("invariant: both readings are in range");
        let judge = |pair: &&LabelledPair| answer(&method, &pair.fixed, &pair.moving, pair.truth, control);
        let of_matching: Vec<Answer> = together.par_iter().map(judge).collect();
        let of_different: Vec<Answer> = apart.par_iter().map(judge).collect();
        rows.push(Row {
            name,
            pairs: of_matching.len(),
            posed: share(&of_matching, Answer::pose_is_right),
            right: share(&of_matching, Answer::is_correct),
            wrong: of_matching.iter().filter(|answer| answer.is_wrong()).count(),
            falsely: of_different.iter().filter(|answer| answer.merged).count(),
        });
        steps.step();
    }
    let measured = Measured { sights: &sights };
    Ok(Outcome {
        name: ExperimentName::Readings,
        method: format!(
            "{} matching pairs of simulated maps of eight kinds of worlds (overlap 10 to 92 %), frames within 20 cells of each \
             other at any rotation, and {} pairs of two buildings. Each stage is looked at alone, with the stages before it \
             right; then the whole pipeline runs with one reading at a time as printed.",
            together.len(),
            apart.len()
        ),
        claims: measured.claims(&rows),
        tables: vec![measured.table(), pipeline_table(&rows)],
        figures: vec![measured.figure(), pipeline_figure(&rows)],
    })
}

/// The pipeline with one reading as printed.
fn variants() -> Vec<(&'static str, HoughPeaksParams)> {
    let ours = HoughPeaksParams::default();
    let of = |name, change: fn(&mut HoughPeaksParams)| {
        let mut params = ours.clone();
        change(&mut params);
        (name, params)
    };
    vec![
        of("ours", |_| ()),
        of("one rotation, by psi-hat as printed", |p| {
            p.rotation_choice = RotationChoice::NearestToPsiHat;
            p.psi_hat = PsiHat::MeanOfTangents;
        }),
        of("one rotation, by a circular psi-hat", |p| {
            p.rotation_choice = RotationChoice::NearestToPsiHat;
            p.psi_hat = PsiHat::CircularMean;
        }),
        of("f = mean of non-zeros", |p| p.spectrum = Spectrum::MeanOfNonZeros),
        of("f = entropy", |p| p.spectrum = Spectrum::Entropy),
        of("tuning window as printed", |p| {
            p.rotation_tuning = RotationTuning::PaperWindow;
        }),
        of("lines one cell wide", |p| p.line_width_cells = 1),
        of("one couple a direction", |p| p.pairing = Pairing::BestPerAngle),
        of("peaks matched once", |p| p.matching_rounds = 1),
        of("v_gate 50 votes", |p| p.v_gate = 50.0),
        of("d_gate 100 cells", |p| p.d_gate = 100.0),
        of("translation by entropy", |p| {
            p.translation_tuning = TranslationTuning::Entropy;
        }),
        of("dis over cells known in one", |p| {
            p.disagreement = Disagreement::KnownInOne;
        }),
        ("all as printed", HoughPeaksParams::literal()),
    ]
}

/// What one variant of the pipeline does.
struct Row {
    name: &'static str,
    pairs: usize,
    posed: f64,
    right: f64,
    wrong: usize,
    falsely: usize,
}

fn pipeline_table(rows: &[Row]) -> Table {
    let mut table = Table::new(
        "pipeline",
        "The whole pipeline with one reading at a time as printed. Pose right: the best pose is within 0.5 m, merged or not.",
        &[
            "reading",
            "matching pairs",
            "pose right [share]",
            "merged rightly [share]",
            "merged wrongly",
            "two buildings merged",
        ],
    );
    for row in rows {
        table.push(vec![
            row.name.into(),
            row.pairs.into(),
            row.posed.into(),
            row.right.into(),
            row.wrong.into(),
            row.falsely.into(),
        ]);
    }
    table
}

fn pipeline_figure(rows: &[Row]) -> Figure {
    let names: Vec<String> = (0..rows.len()).map(|k| k.to_string()).collect();
    let x = Axis::of_names("reading: row of the table, 0 = ours", &names);
    let bars = |value: fn(&Row) -> f64, shift: f64| {
        rows.iter()
            .enumerate()
            .map(|(k, row)| [real(k) + shift, value(row)])
            .collect()
    };
    let panel = Panel::new(
        "One reading at a time as printed",
        x,
        Axis::new("matching pairs [%]", 0.0, 115.0),
    )
    .with(Series::new(
        "pose right",
        PALETTE[0],
        Mark::Bar(34),
        bars(|row| 100.0 * row.posed, -0.18),
    ))
    .with(Series::new(
        "merged rightly",
        PALETTE[2],
        Mark::Bar(34),
        bars(|row| 100.0 * row.right, 0.18),
    ));
    Figure::new("pipeline", "Rows in the order of the table.", 1, vec![panel])
}

/// What the stages see of one pair, each with the stages before it right.
struct Sight {
    /// Rank of the true rotation among the candidates by f, from 0; `None` when it is not among them.
    rank: [Option<usize>; 3],
    /// Whether psi-hat chooses the true rotation among the candidates and their half turns: as printed, circular.
    chosen: [bool; 2],
    /// Error of the candidate and of the tuned rotations in degrees: candidate, ours, as printed.
    tuning: [f64; 3],
    /// Peaks of the fixed map that are in the moving map as well, and how their votes differ.
    vote_differences: Vec<f64>,
    /// Errors of `T_o` in cells at the true rotation: in near frames, in frames anywhere; `None` without a `T_o`.
    translation: [Option<f64>; 2],
    /// Distance in cells of the objective's optimum from the truth: entropy, V over both, V over either.
    optimum: [f64; 3],
    /// Whether that optimum lies on the border of the search.
    at_border: [bool; 3],
    /// V at the truth: over cells known in both, over cells known in one.
    v_at_truth: [f64; 2],
    /// V of hypotheses that are wrong.
    v_wrong: Vec<f64>,
}

impl Sight {
    fn of(pair: &LabelledPair, seed: u64) -> Option<Self> {
        let truth = pair.truth?;
        let (fixed, moving) = (&pair.fixed, &pair.moving);
        let ours = HoughPeaks::new(HoughPeaksParams::default()).ok()?;
        let printed = HoughPeaks::new(HoughPeaksParams {
            rotation_tuning: RotationTuning::PaperWindow,
            ..HoughPeaksParams::default()
        })
        .ok()?;
        let rotations = ours.rotation_trace(fixed, moving);
        let rank = [0, 1, 2].map(|f: usize| {
            let candidates = &rotations.spectra[f].candidates;
            candidates
                .iter()
                .position(|candidate| modulo_half_turn(*candidate - truth.yaw()) <= 2.0)
        });
        let candidates = &rotations.spectra[0].candidates;
        let chosen = [rotations.psi_hat_tangents, rotations.psi_hat_circular].map(|psi| {
            psi.and_then(|psi| nearest(candidates, psi))
                .is_some_and(|c| (c - truth.yaw()).degrees().abs() <= 2.0)
        });
        let candidate = nearest(candidates, truth.yaw())?;
        let off = |angle: Angle| (angle - truth.yaw()).degrees().abs();
        let tuned = [&ours, &printed].map(|method| off(method.tuned_rotation(fixed, moving, candidate)));
        let cell = fixed.lattice().resolution().max(moving.lattice().resolution());
        let trace = ours.translation_trace(fixed, moving, truth.yaw());
        let mut random = Random::new(seed, &[22, fixed.cells().len() as u64]);
        let (elsewhere, far_truth) = far(moving, truth, &mut random);
        let far_trace = ours.translation_trace(fixed, &elsewhere, far_truth.yaw());
        let around = Self::search(&ours, pair, truth, &mut random);
        let maps = [fixed, moving].map(StateMap::new);
        let at_truth = compare(&maps[0], &maps[1], truth);
        Some(Self {
            rank,
            chosen,
            tuning: [off(candidate), tuned[0], tuned[1]],
            vote_differences: vote_differences(&trace, truth, cell),
            translation: [miss(&trace, truth, cell), miss(&far_trace, far_truth, cell)],
            optimum: around.map(|(distance, _)| distance),
            at_border: around.map(|(_, border)| border),
            v_at_truth: [
                at_truth.verification_index().unwrap_or(f64::NAN),
                at_truth.verification_index_over_union().unwrap_or(f64::NAN),
            ],
            v_wrong: wrong_hypotheses(pair, truth),
        })
    }

    /// The optima of the search that begins within 5 cells of the truth: distance from it in cells, and whether on the border.
    fn search(method: &HoughPeaks, pair: &LabelledPair, truth: Pose2, random: &mut Random) -> [(f64, bool); 3] {
        let cell = pair.fixed.lattice().resolution();
        let start = [random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)];
        let pose = Pose2::new(truth.x() + start[0] * cell, truth.y() + start[1] * cell, truth.yaw());
        let objective = method.objective_around(&pair.fixed, &pair.moving, pose);
        // shifts are along the axes of the fixed map's lattice
        let axes = Pose2::new(0.0, 0.0, -pair.fixed.lattice().origin().yaw());
        let [x, y] = axes.apply(start.map(|cells| -cells));
        let reach = objective.iter().flat_map(|o| o.shift).max().unwrap_or(0);
        let values: [fn(&Objective) -> Option<f64>; 3] = [
            |o| Some(o.entropy),
            |o| o.verification_index.map(|v| -v),
            |o| o.verification_index_over_union.map(|v| -v),
        ];
        values.map(|value| {
            let best = objective
                .iter()
                .filter_map(|o| value(o).map(|v| (v, o.shift)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            best.map_or((f64::INFINITY, true), |(_, shift)| {
                let distance = (f64::from(shift[0]) - x).hypot(f64::from(shift[1]) - y);
                (distance, shift.iter().any(|s| s.abs() == reach))
            })
        })
    }
}

/// Degrees between directions of lines.
fn modulo_half_turn(angle: Angle) -> f64 {
    let degrees = angle.degrees().abs();
    degrees.min(180.0 - degrees)
}

/// The candidate, or its half turn, that is nearest to a rotation.
fn nearest(candidates: &[Angle], rotation: Angle) -> Option<Angle> {
    let turned = candidates.iter().flat_map(|c| [*c, *c + Angle::HALF_TURN]);
    turned.min_by(|a, b| (*a - rotation).magnitude().total_cmp(&(*b - rotation).magnitude()))
}

/// How far `T_o` is from the truth, in cells.
fn miss(trace: &TranslationTrace, truth: Pose2, cell: f64) -> Option<f64> {
    let [x, y] = trace.approximate?;
    Some((x - truth.x() / cell).hypot(y - truth.y() / cell))
}

/// Differences of the votes of walls that both maps have: peaks within 1 degree and 2 cells of each other at the truth.
fn vote_differences(trace: &TranslationTrace, truth: Pose2, cell: f64) -> Vec<f64> {
    let turn = Pose2::new(0.0, 0.0, truth.yaw());
    let [mx, my] = turn.apply(trace.moving.center);
    // from the fixed image's centre to the moving one's, at the truth
    let offset = [
        mx + truth.x() / cell - trace.fixed.center[0],
        my + truth.y() / cell - trace.fixed.center[1],
    ];
    trace
        .fixed_peaks
        .iter()
        .filter_map(|peak| {
            let same = trace.moving_peaks.iter().filter(|other| {
                let (sin, cos) = other.theta.sin_cos();
                let rho = other.rho + offset[0] * cos + offset[1] * sin;
                (other.theta - peak.theta).degrees().abs() <= 1.0 && (rho - peak.rho).abs() <= 2.0
            });
            same.map(|other| (other.votes - peak.votes).abs())
                .min_by(f64::total_cmp)
        })
        .collect()
}

/// V of the hypotheses that the pipeline verified and that are wrong.
fn wrong_hypotheses(pair: &LabelledPair, truth: Pose2) -> Vec<f64> {
    // a threshold that only a perfect agreement meets: all hypotheses are told
    let params = HoughPeaksParams {
        verification_threshold: 1.0,
        ..HoughPeaksParams::default()
    };
    let method = HoughPeaks::new(params).expect("invariant: 1 is a share");
    let moments = Moments::of(&pair.moving);
    match register(&method, &pair.fixed, &pair.moving, &crate::registration::Unhurried) {
        Registration::Accepted(_) => Vec::new(),
        Registration::Rejected(rejection) => rejection
            .candidates
            .iter()
            .filter(|candidate| moments.distance(candidate.pose_fixed_moving, truth) > RIGHT_WITHIN_M)
            .filter_map(|candidate| candidate.evidence.verification_index)
            .collect(),
    }
}

/// The stages over all pairs.
struct Measured<'a> {
    sights: &'a [Sight],
}

impl Measured<'_> {
    fn share(&self, so: impl Fn(&Sight) -> bool) -> f64 {
        share(self.sights, so)
    }

    fn ranked(&self, f: usize, within: usize) -> f64 {
        self.share(|sight| sight.rank[f].is_some_and(|rank| rank < within))
    }

    fn tuning(&self, k: usize) -> f64 {
        quantile(
            &self.sights.iter().map(|sight| sight.tuning[k]).collect::<Vec<_>>(),
            0.5,
        )
    }

    fn differences(&self) -> Vec<f64> {
        self.sights
            .iter()
            .flat_map(|sight| sight.vote_differences.iter().copied())
            .collect()
    }

    fn wrong(&self) -> Vec<f64> {
        self.sights
            .iter()
            .flat_map(|sight| sight.v_wrong.iter().copied())
            .collect()
    }

    fn v_at_truth(&self, k: usize) -> Vec<f64> {
        self.sights
            .iter()
            .map(|sight| sight.v_at_truth[k])
            .filter(|v| v.is_finite())
            .collect()
    }

    fn near_translation(&self, k: usize) -> f64 {
        self.share(|sight| sight.translation[k].is_some_and(|cells| cells <= 10.0))
    }

    #[expect(clippy::too_many_lines, reason = "one row after the other, as the page shows them")]
    fn table(&self) -> Table {
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

    #[expect(clippy::too_many_lines, reason = "one row after the other, as the page shows them")]
    fn claims(&self, rows: &[Row]) -> Vec<Claim> {
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

    /// Where the optima of the search lie: the share of pairs within so many cells of the truth.
    fn figure(&self) -> Figure {
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
        )
        .legend_at(Corner::LowerRight);
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
        .legend_at(Corner::LowerLeft)
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
