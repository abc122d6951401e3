//! Figures 16 and 17: a known world cut into two maps that overlap by 10 to 90 %, and how well they are put together.

use rayon::prelude::*;

use super::figure::{Axis, Figure, Mark, PALETTE, Panel, Series};
use super::numbers::{mean, percent, quantile, share};
use super::outcome::{Claim, Outcome, Table, Verdict};
use super::picture::{map_panel, merged_panel};
use super::steps::Steps;
use super::superiority::median_error_m;
use super::sweep::{Cut, Judged, Methods, contestants, drawn, halves, superiority, told};
use super::worlds::{cluttered_map, cut, similarity};
use super::{ExperimentError, ExperimentName, Settings};
use crate::geometry::Pose2;
use crate::registration::Control;
use crate::simulation::Random;

/// From this similarity on, the merged map shows the world, in the sense of the paper's "acceptable".
const ACCEPTABLE: f64 = 0.9;

#[expect(
    clippy::too_many_lines,
    reason = "an experiment reads from its worlds to its claims like its section of the paper"
)]
#[expect(
    clippy::unnecessary_wraps,
    reason = "experiments have one signature, and others can fail"
)]
pub(super) fn run(settings: &Settings, control: &dyn Control) -> Result<Outcome, ExperimentError> {
    let (overlaps, seeds): (Vec<u32>, u64) = if settings.quick {
        (vec![10, 50, 90], 2)
    } else {
        ((10..=90).step_by(10).collect(), 20)
    };
    let methods = contestants();
    let cases: Vec<(u32, u64)> = overlaps
        .iter()
        .flat_map(|o| (0..seeds).map(move |seed| (*o, seed)))
        .collect();
    let steps = Steps::new(control, cases.len());
    // one world a seed, the same at every overlap
    let measured: Vec<(u32, f64, Vec<Option<Judged>>)> = cases
        .par_iter()
        .map(|(overlap, seed)| {
            let world = cluttered_map(settings.seed.wrapping_mul(100) + seed);
            let mut random = Random::new(settings.seed, &[17, *seed, u64::from(*overlap)]);
            let parts = cut(&world, f64::from(*overlap) / 100.0);
            let alone = similarity(&world, &[(&parts[0], Pose2::IDENTITY)]);
            let pair = Cut::new(parts, &mut random);
            let judged = pair.judged(&methods, *seed, &world, control);
            steps.step();
            (*overlap, alone, judged)
        })
        .collect();

    let mut table = Table::new(
        "overlap",
        "Similarity of the merged map to the known world, by overlap and method, over all seeds. Merged: the method itself \
         would merge. Right: and the pose is within 0.5 m RMS.",
        &[
            "overlap [%]",
            "method",
            "pairs",
            "similarity, mean",
            "similarity, lower quartile",
            "similarity, median",
            "similarity, upper quartile",
            "error, median [m]",
            "pose right [share]",
            "merged and right [share]",
            "merged and wrong [share]",
            "V, mean",
        ],
    );
    let mut lines: Vec<Vec<[f64; 2]>> = vec![Vec::new(); methods.len()];
    let mut spreads: Vec<Vec<[f64; 2]>> = vec![Vec::new(); methods.len()];
    let mut right: Vec<Vec<[f64; 2]>> = vec![Vec::new(); methods.len()];
    let mut alone_line = Vec::new();
    for overlap in &overlaps {
        let at: Vec<&(u32, f64, Vec<Option<Judged>>)> = measured.iter().filter(|case| case.0 == *overlap).collect();
        let x = f64::from(*overlap);
        alone_line.push([x, 100.0 * mean(&at.iter().map(|case| case.1).collect::<Vec<_>>())]);
        for (k, method) in methods.iter().enumerate() {
            let of: Vec<&Judged> = at.iter().filter_map(|case| case.2[k].as_ref()).collect();
            let similarities: Vec<f64> = of.iter().map(|judged| judged.similarity).collect();
            let indices: Vec<f64> = of
                .iter()
                .filter_map(|judged| judged.answer.verification_index)
                .collect();
            let quartiles = [0.25, 0.5, 0.75].map(|q| quantile(&similarities, q));
            lines[k].push([x, 100.0 * mean(&similarities)]);
            spreads[k].push([100.0 * quartiles[0], 100.0 * quartiles[2]]);
            right[k].push([x, 100.0 * share(&of, |judged| judged.answer.pose_is_right())]);
            table.push(vec![
                (*overlap as usize).into(),
                method.name.into(),
                of.len().into(),
                mean(&similarities).into(),
                quartiles[0].into(),
                quartiles[1].into(),
                quartiles[2].into(),
                median_error_m(of.iter().map(|judged| &judged.answer)).into(),
                share(&of, |judged| judged.answer.pose_is_right()).into(),
                share(&of, |judged| judged.answer.is_correct()).into(),
                share(&of, |judged| judged.answer.is_wrong()).into(),
                mean(&indices).into(),
            ]);
        }
    }
    let claims = claims(&methods, &overlaps, &lines, &right, &measured);
    let chart = |title: &str, label: &str, series: &[Vec<[f64; 2]>]| {
        let x = Axis::new("overlap [% of the world]", 5.0, 95.0);
        let mut panel = Panel::new(title, x, Axis::new(label, 0.0, 105.0));
        for (k, name, color) in drawn(&methods) {
            panel = panel.with(Series::new(name, color, Mark::LineAndDots, series[k].clone()));
        }
        panel
    };
    let mut similar = chart("Similarity to the known world", "similarity [%]", &lines);
    for (series, (k, _, _)) in similar.series.iter_mut().zip(drawn(&methods)) {
        series.spread.clone_from(&spreads[k]);
    }
    let similar = similar.with(Series::new("the first map alone", PALETTE[7], Mark::Dashed, alone_line));
    let caption = format!(
        "Figure 17 of the paper: mean over {seeds} worlds, with quartiles; and the share of pairs whose best pose is within \
         0.5 m of the truth."
    );
    let figure_17 = Figure::new(
        "figure-17",
        caption,
        2,
        vec![similar, chart("Poses within 0.5 m of the truth", "pairs [%]", &right)],
    );
    Ok(Outcome {
        name: ExperimentName::OverlapSweep,
        method: format!(
            "Cluttered worlds of 640 x 480 cells, known throughout, {seeds} seeds. Each is cut into a left and a right map \
             with the stated share of the world in both; the right one is told in a frame turned by any angle and moved by \
             up to 20 cells on each axis, and drawn on cells anew. Each method's best pose counts, also where it would \
             refuse to merge; without any pose the first map stands alone (dashed). Similarity: the share of the world's \
             cells that the merged map has in the same state. The table has every method; random-walk and map-segmentation, \
             which take long, in the first 5 worlds."
        ),
        claims,
        tables: vec![table],
        figures: vec![figure_16(settings), figure_17],
    })
}

fn claims(
    methods: &Methods,
    overlaps: &[u32],
    lines: &[Vec<[f64; 2]>],
    right: &[Vec<[f64; 2]>],
    measured: &[(u32, f64, Vec<Option<Judged>>)],
) -> Vec<Claim> {
    let ends = |k: usize| {
        (
            lines[k].first().map_or(0.0, |p| p[1]),
            lines[k].last().map_or(0.0, |p| p[1]),
        )
    };
    let acceptable = |k: usize, there: &dyn Fn(u32) -> bool| {
        let cases = measured.iter().filter(|case| there(case.0));
        let judged: Vec<&Judged> = cases.filter_map(|case| case.2[k].as_ref()).collect();
        share(&judged, |judged| judged.similarity >= ACCEPTABLE)
    };
    let above_half = |k: usize| acceptable(k, &|overlap| overlap > 50);
    let at_most_half = |k: usize| acceptable(k, &|overlap| overlap <= 50);
    let told = |of: &dyn Fn(usize) -> String| told(methods, of);
    let rising = drawn(methods).filter(|(k, _, _)| ends(*k).1 > ends(*k).0).count();
    vec![
        Claim {
            claim: "The similarity rises with the overlap.".into(),
            paper: "figure 17 rises".into(),
            ours: told(&|k| format!("{:.0} % to {:.0} %", ends(k).0, ends(k).1)),
            verdict: match rising {
                0 => Verdict::Fails,
                all if all == drawn(methods).count() => Verdict::Holds,
                _ => Verdict::InPart,
            },
        },
        Claim {
            claim: "In a highly cluttered world merging is acceptable when more than 50 % overlap.".into(),
            paper: "above 50 % of overlap".into(),
            ours: format!(
                "Similarity of at least {} above 50 % of overlap: {}. At 50 % and below: {}.",
                percent(ACCEPTABLE),
                told(&|k| percent(above_half(k))),
                told(&|k| percent(at_most_half(k)))
            ),
            verdict: match above_half(0) {
                s if s >= 0.9 => Verdict::Holds,
                s if s >= 0.5 => Verdict::InPart,
                _ => Verdict::Fails,
            },
        },
        Claim {
            claim: "Ours: the default engine needs no more overlap than the others.".into(),
            paper: "-".into(),
            ours: told(&|k| {
                let enough = right[k]
                    .iter()
                    .find(|[x, _]| right[k].iter().filter(|p| p[0] >= *x).all(|p| p[1] >= 90.0));
                enough.map_or_else(
                    || "no overlap from which on 90 % of the poses are right".to_owned(),
                    |[x, _]| format!("90 % of the poses are right from {x:.0} % of overlap on"),
                )
            }),
            verdict: Verdict::when({
                let area = |k: usize| right[k].iter().map(|p| p[1]).sum::<f64>();
                (0..methods.len() - 1).all(|k| area(methods.len() - 1) >= area(k))
            }),
        },
        superiority(
            methods,
            overlaps.iter().map(|overlap| {
                let there = |k: usize| {
                    let cases = measured.iter().filter(|case| case.0 == *overlap);
                    cases.filter_map(|case| case.2[k].as_ref()).collect()
                };
                (
                    format!("{overlap} % of overlap"),
                    (0..methods.len()).map(there).collect(),
                )
            }),
        ),
    ]
}

/// One cut at 10 % as in figure 16, and what the default engine makes of it.
fn figure_16(settings: &Settings) -> Figure {
    let world = cluttered_map(settings.seed.wrapping_mul(100));
    let [left, right] = cut(&world, 0.1);
    let mut whole = map_panel("The world and the two maps cut from it at 10 %", &world);
    for (map, color, label) in [(&left, PALETTE[1], "map 1"), (&right, PALETTE[0], "map 2")] {
        let corners = map.lattice().corners();
        let closed: Vec<[f64; 2]> = corners.into_iter().chain([corners[0]]).collect();
        whole = whole.with(Series::new(label, color, Mark::Line, closed));
    }
    let merged = merged_panel(
        "Both maps at their true poses; black: walls of both",
        &halves(&left, &right),
    );
    let caption = "Figure 16 of the paper: a cluttered world of 640 x 480 cells, cut with 10 % of it in both maps.";
    Figure::new("figure-16", caption, 2, vec![whole, merged])
}
