//! Where the paper's text is ambiguous or wrong: each reading measured on simulated pairs, alone and in the whole pipeline.

mod claims;
mod pipeline;
mod sight;
mod stages;

use rayon::prelude::*;

use super::answer::{Answer, answer};
use super::numbers::share;
use super::outcome::Outcome;
use super::pairs::{LabelledPair, near_pairs};
use super::steps::Steps;
use super::{ExperimentError, ExperimentName, Settings};
use crate::registration::Control;
use crate::registration::methods::hough_peaks::HoughPeaks;
use pipeline::{Row, pipeline_figure, pipeline_table, variants};
use sight::Sight;
use stages::Measured;
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
