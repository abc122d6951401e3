//! Figures 18 and 19: both maps bent by eq. 40, and how well they are still put together.

use rayon::prelude::*;

use super::figure::{Axis, Figure, Mark, Panel, Series};
use super::numbers::{mean, quantile, share};
use super::outcome::{Claim, Outcome, Table, Verdict};
use super::picture::{map_panel, merged_panel};
use super::steps::Steps;
use super::superiority::median_error_m;
use super::sweep::{Cut, Judged, Methods, contestants, drawn, halves, superiority, told};
use super::worlds::{cluttered_map, cut, distorted};
use super::{ExperimentError, ExperimentName, Settings};
use crate::geometry::Angle;
use crate::grid::OccupancyGrid;
use crate::registration::Control;
use crate::simulation::Random;

/// Thousandths of a degree for each cell of distance from the middle.
const ALPHAS: [u32; 6] = [0, 20, 40, 60, 80, 100];
const OVERLAPS: [u32; 2] = [40, 70];

#[expect(
    clippy::too_many_lines,
    reason = "an experiment reads from its worlds to its claims like its section of the paper"
)]
#[expect(
    clippy::unnecessary_wraps,
    reason = "experiments have one signature, and others can fail"
)]
pub(super) fn run(settings: &Settings, control: &dyn Control) -> Result<Outcome, ExperimentError> {
    let (alphas, seeds): (&[u32], u64) = if settings.quick { (&[0, 100], 2) } else { (&ALPHAS, 20) };
    let methods = contestants();
    let cases: Vec<(u32, u32, u64)> = OVERLAPS
        .into_iter()
        .flat_map(|overlap| alphas.iter().map(move |alpha| (overlap, *alpha)))
        .flat_map(|(overlap, alpha)| (0..seeds).map(move |seed| (overlap, alpha, seed)))
        .collect();
    let steps = Steps::new(control, cases.len());
    let measured: Vec<(u32, u32, Vec<Option<Judged>>)> = cases
        .par_iter()
        .map(|(overlap, alpha, seed)| {
            let world = cluttered_map(settings.seed.wrapping_mul(100) + seed);
            let mut random = Random::new(settings.seed, &[19, *seed, u64::from(*overlap)]);
            let parts = cut(&world, f64::from(*overlap) / 100.0).map(|part| distorted(&part, degrees(*alpha)));
            let pair = Cut::new(parts, &mut random);
            let judged = pair.judged(&methods, *seed, &world, control);
            steps.step();
            (*overlap, *alpha, judged)
        })
        .collect();
    let at = |overlap: u32, alpha: u32, k: usize| -> Vec<&Judged> {
        let cases = measured.iter().filter(|case| case.0 == overlap && case.1 == alpha);
        cases.filter_map(|case| case.2[k].as_ref()).collect()
    };
    let mut table = Table::new(
        "distortion",
        "V at the method's best pose, similarity of the merged map to the undistorted world, and how far the pose is off, \
         over all seeds. The distortion at the rim is that of a map of 640 x 480 cells.",
        &[
            "overlap [%]",
            "alpha [deg/cell]",
            "distortion at the rim [deg]",
            "method",
            "pairs",
            "V, mean",
            "V, lower quartile",
            "V, upper quartile",
            "similarity, mean",
            "error, median [m]",
            "pose right [share]",
            "merged and right [share]",
            "merged and wrong [share]",
        ],
    );
    for overlap in OVERLAPS {
        for alpha in alphas {
            for (k, method) in methods.iter().enumerate() {
                let of = at(overlap, *alpha, k);
                let v = indices(&of);
                table.push(vec![
                    (overlap as usize).into(),
                    degrees(*alpha).degrees().into(),
                    (400.0 * degrees(*alpha).degrees()).into(),
                    method.name.into(),
                    of.len().into(),
                    mean(&v).into(),
                    quantile(&v, 0.25).into(),
                    quantile(&v, 0.75).into(),
                    mean(&of.iter().map(|judged| judged.similarity).collect::<Vec<_>>()).into(),
                    median_error_m(of.iter().map(|judged| &judged.answer)).into(),
                    share(&of, |judged| judged.answer.pose_is_right()).into(),
                    share(&of, |judged| judged.answer.is_correct()).into(),
                    share(&of, |judged| judged.answer.is_wrong()).into(),
                ]);
            }
        }
    }
    let chart = |title: &str, label: &str, value: &dyn Fn(&[&Judged]) -> [f64; 3]| {
        let x = Axis::new("alpha [deg/cell]", -0.004, 0.104);
        let mut panel = Panel::new(title, x, Axis::new(label, 0.0, 105.0));
        for (k, name, color) in drawn(&methods) {
            for (overlap, mark) in OVERLAPS.into_iter().zip([Mark::Dashed, Mark::LineAndDots]) {
                let values: Vec<(f64, [f64; 3])> = alphas
                    .iter()
                    .map(|alpha| (degrees(*alpha).degrees(), value(&at(overlap, *alpha, k))))
                    .collect();
                let points = values.iter().map(|(alpha, of)| [*alpha, 100.0 * of[1]]).collect();
                let spread = values.iter().map(|(_, of)| [100.0 * of[0], 100.0 * of[2]]).collect();
                let series = Series::new(format!("{name}, {overlap} %"), color, mark, points);
                panel = panel.with(series.with_spread(spread));
            }
        }
        panel
    };
    let similar = chart("Similarity to the undistorted world", "similarity [%]", &|of| {
        let values: Vec<f64> = of.iter().map(|judged| judged.similarity).collect();
        [quantile(&values, 0.25), mean(&values), quantile(&values, 0.75)]
    });
    let verified = chart("Verification index V at the best pose", "V [%]", &|of| {
        let values = indices(of);
        [quantile(&values, 0.25), mean(&values), quantile(&values, 0.75)]
    });
    let right = chart("Poses within 0.5 m of the truth", "pairs [%]", &|of| {
        let so = share(of, |judged| judged.answer.pose_is_right());
        [f64::NAN, so, f64::NAN]
    });
    let caption = format!(
        "Figure 19 of the paper, mean over {seeds} worlds with quartiles, for maps that overlap by 40 % (dashed) and 70 % \
         (dots). At alpha = 0.1 the rim is bent by 40 degrees."
    );
    let claims = claims(&methods, alphas, &at);
    Ok(Outcome {
        name: ExperimentName::DistortionSweep,
        method: format!(
            "As the overlap sweep, {seeds} seeds, at 40 % and 70 % of overlap; before the second map is moved, both are bent \
             about their own middles by eq. 40. The table has every method; random-walk and map-segmentation, which take long, \
             in the first 5 worlds."
        ),
        claims,
        tables: vec![table],
        figures: vec![
            figure_18(settings),
            Figure::new("figure-19", caption, 3, vec![similar, verified, right]),
        ],
    })
}

fn degrees(thousandths: u32) -> Angle {
    Angle::from_degrees(f64::from(thousandths) / 1000.0)
}

fn indices(of: &[&Judged]) -> Vec<f64> {
    of.iter()
        .filter_map(|judged| judged.answer.verification_index)
        .collect()
}

fn claims<'a>(methods: &Methods, alphas: &[u32], at: &dyn Fn(u32, u32, usize) -> Vec<&'a Judged>) -> Vec<Claim> {
    let (straight, most_bent) = (alphas[0], alphas[alphas.len() - 1]);
    let bent = alphas.iter().copied().find(|alpha| *alpha > 20).unwrap_or(most_bent);
    let similarity = |overlap, alpha, k| {
        let values: Vec<f64> = at(overlap, alpha, k).iter().map(|judged| judged.similarity).collect();
        mean(&values)
    };
    let v = |overlap, alpha, k| mean(&indices(&at(overlap, alpha, k)));
    let fall = |of: &dyn Fn(u32, u32, usize) -> f64, alpha: u32, k: usize| {
        let [low, high] = OVERLAPS.map(|overlap| (100.0 * of(overlap, straight, k), 100.0 * of(overlap, alpha, k)));
        format!(
            "{:.0} to {:.0} % at 40 %, {:.0} to {:.0} % at 70 %",
            low.0, low.1, high.0, high.1
        )
    };
    let told = |of: &dyn Fn(usize) -> String| told(methods, of);
    let drop_of = |of: &dyn Fn(u32, u32, usize) -> f64| {
        OVERLAPS
            .map(|overlap| of(overlap, straight, 0) - of(overlap, bent, 0))
            .into_iter()
            .fold(0.0, f64::max)
    };
    let alpha_words = format!("alpha 0 to {:.2} degrees", degrees(bent).degrees());
    vec![
        Claim {
            claim: "Beyond a distortion of 8 degrees at the rim (alpha = 0.02) merging degrades markedly.".into(),
            paper: "figure 19: the score falls".into(),
            ours: format!(
                "Similarity, {alpha_words}: {}. V, the same: {}.",
                told(&|k| fall(&similarity, bent, k)),
                told(&|k| fall(&v, bent, k))
            ),
            verdict: match (drop_of(&similarity) > 0.1, drop_of(&v) > 0.1) {
                (true, true) => Verdict::Holds,
                (false, false) => Verdict::Fails,
                _ => Verdict::InPart,
            },
        },
        Claim {
            claim: "High distortion together with low overlap is worst.".into(),
            paper: "figure 19".into(),
            ours: told(&|k| {
                let [low, high] = OVERLAPS.map(|overlap| 100.0 * similarity(overlap, most_bent, k));
                format!("{low:.0} % at 40 % of overlap, {high:.0} % at 70 %, both at the greatest alpha")
            }),
            verdict: Verdict::when(similarity(OVERLAPS[0], most_bent, 0) <= similarity(OVERLAPS[1], most_bent, 0)),
        },
        Claim {
            claim: "Ours: what a method cannot place it should refuse.".into(),
            paper: "-".into(),
            ours: told(&|k| {
                let all: Vec<&Judged> = OVERLAPS
                    .into_iter()
                    .flat_map(|overlap| alphas.iter().flat_map(move |alpha| at(overlap, *alpha, k)))
                    .collect();
                let wrong = all.iter().filter(|judged| judged.answer.is_wrong()).count();
                let right = all.iter().filter(|judged| judged.answer.is_correct()).count();
                format!("{right} merged and right, {wrong} merged and wrong of {}", all.len())
            }),
            verdict: {
                let wrong = |k: usize| {
                    let every = OVERLAPS
                        .into_iter()
                        .flat_map(|overlap| alphas.iter().flat_map(move |a| at(overlap, *a, k)));
                    every.filter(|judged| judged.answer.is_wrong()).count()
                };
                Verdict::when(wrong(methods.len() - 1) == 0)
            },
        },
        superiority(
            methods,
            OVERLAPS.into_iter().flat_map(|overlap| {
                alphas.iter().map(move |alpha| {
                    let there = |k: usize| at(overlap, *alpha, k);
                    let words = format!("{overlap} % of overlap, alpha {:.2}", degrees(*alpha).degrees());
                    (words, (0..methods.len()).map(there).collect())
                })
            }),
        ),
    ]
}

/// A map and the same map bent by 0.04 degrees a cell, as in figure 18; and both bent parts at the true pose.
fn figure_18(settings: &Settings) -> Figure {
    let world = cluttered_map(settings.seed.wrapping_mul(100));
    let bend = |map: &OccupancyGrid| distorted(map, degrees(40));
    let [left, right] = cut(&world, 0.4).map(|part| bend(&part));
    let merged = merged_panel("c) Two bent parts at their true poses (40 %)", &halves(&left, &right));
    let caption = "Figure 18 of the paper: a map, and the same bent by alpha = 0.04 degrees a cell, 16 degrees at the rim. \
                   c): bent about their own middles, two parts no longer fit each other anywhere.";
    let panels = vec![
        map_panel("a) No distortion", &world),
        map_panel("b) alpha = 0.04 deg/cell", &bend(&world)),
        merged,
    ];
    Figure::new("figure-18", caption, 3, panels)
}
