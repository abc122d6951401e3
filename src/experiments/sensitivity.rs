//! Section 6.1: every parameter of table 2 changed by 15 %, one at a time.

use rayon::prelude::*;

use super::answer::{Answer, answer};
use super::bars::{Bars, bar_panel};
use super::figure::{Figure, PALETTE};
use super::numbers::{mean, percent, quantile, real, share};
use super::outcome::{Claim, Outcome, Table, Verdict};
use super::pairs::near_pairs;
use super::steps::Steps;
use super::{ExperimentError, ExperimentName, Settings};
use crate::registration::Control;
use crate::registration::methods::HoughPeaksParams;
use crate::registration::methods::hough_peaks::HoughPeaks;

/// One setting of the parameters.
struct Variant {
    name: &'static str,
    params: HoughPeaksParams,
}

/// The nominal values, and each of table 2 by -15 % and +15 %. Whole cells cannot follow: 10 becomes 8 and 12, which is
/// 20 %. V cannot exceed 1, so that the threshold's +15 % is 1.
fn variants() -> Vec<Variant> {
    let nominal = HoughPeaksParams::default();
    let of = |name, change: fn(&mut HoughPeaksParams)| {
        let mut params = nominal.clone();
        change(&mut params);
        Variant { name, params }
    };
    vec![
        of("nominal", |_| ()),
        of("v_gate 8.5", |p| p.v_gate = 8.5),
        of("v_gate 11.5", |p| p.v_gate = 11.5),
        of("Lambda 0.85 deg", |p| p.lambda_degrees = 0.85),
        of("Lambda 1.15 deg", |p| p.lambda_degrees = 1.15),
        of("d_gate 25.5", |p| p.d_gate = 25.5),
        of("d_gate 34.5", |p| p.d_gate = 34.5),
        of("Delta x 8", |p| p.delta_x = 8),
        of("Delta x 12", |p| p.delta_x = 12),
        of("Delta y 8", |p| p.delta_y = 8),
        of("Delta y 12", |p| p.delta_y = 12),
        of("threshold 0.782", |p| p.verification_threshold = 0.782),
        of("threshold 1", |p| p.verification_threshold = 1.0),
    ]
}

/// What one setting does on all pairs.
struct Quality {
    recall: f64,
    wrong: usize,
    falsely: usize,
    posed: f64,
    v: f64,
    error: f64,
}

#[expect(
    clippy::unnecessary_wraps,
    reason = "experiments have one signature, and others can fail"
)]
pub(super) fn run(settings: &Settings, control: &dyn Control) -> Result<Outcome, ExperimentError> {
    let (matching, different) = if settings.quick { (4, 2) } else { (64, 24) };
    let pairs = near_pairs(settings.seed ^ 0x600, matching, different);
    let variants = variants();
    let steps = Steps::new(control, variants.len());
    let mut table = Table::new(
        "sensitivity",
        "Each parameter of table 2 changed by 15 % alone, on the same pairs. Merged and right: share of the matching pairs. \
         Merged wrongly: matching pairs at a wrong pose. Merged falsely: pairs of two buildings. Pose right: the best pose is \
         within 0.5 m, merged or not. V and error: over the pairs merged rightly.",
        &[
            "parameters",
            "matching pairs",
            "pairs of two buildings",
            "merged and right [share]",
            "merged wrongly",
            "merged falsely",
            "pose right [share]",
            "V, mean",
            "error, median [m]",
        ],
    );
    let (together, apart): (Vec<_>, Vec<_>) = pairs.iter().partition(|pair| pair.truth.is_some());
    let mut qualities: Vec<(&str, Quality)> = Vec::new();
    for variant in &variants {
        let method = HoughPeaks::new(variant.params.clone()).expect("invariant: 15 % stay within the ranges");
        let judge =
            |pair: &&super::pairs::LabelledPair| answer(&method, &pair.fixed, &pair.moving, pair.truth, control);
        let of_matching: Vec<Answer> = together.par_iter().map(judge).collect();
        let of_different: Vec<Answer> = apart.par_iter().map(judge).collect();
        let right: Vec<&Answer> = of_matching.iter().filter(|answer| answer.is_correct()).collect();
        let quality = Quality {
            recall: share(&of_matching, Answer::is_correct),
            wrong: of_matching.iter().filter(|answer| answer.is_wrong()).count(),
            falsely: of_different.iter().filter(|answer| answer.merged).count(),
            posed: share(&of_matching, Answer::pose_is_right),
            v: mean(
                &right
                    .iter()
                    .filter_map(|answer| answer.verification_index)
                    .collect::<Vec<_>>(),
            ),
            error: quantile(
                &right.iter().filter_map(|answer| answer.error_m).collect::<Vec<_>>(),
                0.5,
            ),
        };
        table.push(vec![
            variant.name.into(),
            of_matching.len().into(),
            of_different.len().into(),
            quality.recall.into(),
            quality.wrong.into(),
            quality.falsely.into(),
            quality.posed.into(),
            quality.v.into(),
            quality.error.into(),
        ]);
        qualities.push((variant.name, quality));
        steps.step();
    }
    let claims = claims(&qualities, together.len());
    let names: Vec<String> = qualities.iter().map(|(name, _)| (*name).to_owned()).collect();
    let bars = |label, color, value: fn(&Quality) -> f64| Bars {
        label,
        color,
        values: qualities.iter().map(|(_, quality)| value(quality)).collect(),
    };
    let right = bar_panel(
        "Merged and right",
        "matching pairs [%]",
        &names,
        vec![bars("", PALETTE[0], |q| 100.0 * q.recall)],
    );
    let wrong = bar_panel(
        "Merges that are wrong",
        "pairs",
        &names,
        vec![
            bars("matching pairs merged wrongly", PALETTE[1], |q| real(q.wrong)),
            bars("two buildings merged", PALETTE[5], |q| real(q.falsely)),
        ],
    );
    let caption = "Each parameter of table 2 changed by 15 % alone, on the same pairs.";
    let figure = Figure::new("sensitivity", caption, 2, vec![right, wrong]);
    Ok(Outcome {
        name: ExperimentName::Sensitivity,
        method: format!(
            "{} matching pairs of simulated maps of eight kinds of worlds (overlap 10 to 92 %) and {} pairs of two buildings, \
             frames within 20 cells at any rotation; hough-peaks with the nominal values, and with each of table 2 changed by \
             15 % alone (whole cells: 10 becomes 8 and 12).",
            together.len(),
            apart.len()
        ),
        claims,
        tables: vec![table],
        figures: vec![figure],
    })
}

fn claims(qualities: &[(&str, Quality)], matching: usize) -> Vec<Claim> {
    let nominal = &qualities[0].1;
    let of = |with_threshold: bool| {
        let all = qualities
            .iter()
            .skip(1)
            .filter(move |(name, _)| name.starts_with("threshold") == with_threshold);
        all.max_by(|a, b| {
            let change = |q: &Quality| (q.recall - nominal.recall).abs();
            change(&a.1).total_cmp(&change(&b.1))
        })
    };
    let told = |most: Option<&(&str, Quality)>| {
        most.map_or("-".to_owned(), |(name, q)| {
            format!(
                "{name}: {} merged and right instead of {}, {} wrong or false instead of {}",
                percent(q.recall),
                percent(nominal.recall),
                q.wrong + q.falsely,
                nominal.wrong + nominal.falsely
            )
        })
    };
    let little = |most: Option<&(&str, Quality)>| {
        // one pair of the few dozens is noise
        most.is_some_and(|(_, q)| (q.recall - nominal.recall).abs() <= (0.05_f64).max(1.5 / real(matching.max(1))))
    };
    vec![
        Claim {
            claim: "Changing a gate or an interval of table 2 by 15 % hardly changes the quality.".into(),
            paper: "not significantly".into(),
            ours: format!("Greatest change by {}.", told(of(false))),
            verdict: Verdict::when(little(of(false))),
        },
        Claim {
            claim: "So does changing the verification threshold of 92 %.".into(),
            paper: "not significantly".into(),
            ours: format!("Greatest change by {}.", told(of(true))),
            verdict: Verdict::when(little(of(true))),
        },
    ]
}
