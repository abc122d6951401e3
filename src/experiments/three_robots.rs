//! Figure 13: three maps whose merging closes a loop.

use super::outcome::{Claim, Outcome, Table, Verdict};
use super::steps::Steps;
use super::{ExperimentError, ExperimentName, Settings, team, worlds};
use crate::fusion::Moments;
use crate::registration::Control;

pub(super) fn run(settings: &Settings, control: &dyn Control) -> Result<Outcome, ExperimentError> {
    let steps = Steps::new(control, 3);
    let robots = worlds::three_robots(settings.seed)?;
    steps.step();
    let pairs = team::pairs(&robots);
    let (pair_table, answers) = team::pair_table(&robots, &pairs, control);
    steps.step();
    let welds = team::welds(&robots, settings.seed, control)?;
    steps.step();
    let [area, _] = team::coverage_m2(&robots);
    let driven: Vec<String> = robots.iter().map(|robot| format!("{:.0} m", robot.driven_m)).collect();
    let overlaps: Vec<String> = pairs
        .iter()
        .map(|pair| format!("{:.0} %", 100.0 * pair.common.overlap))
        .collect();

    // pairs are (1, 2), (1, 3), (2, 3): going round by 1 -> 2 -> 3 must end where 1 -> 3 does
    let mut table = Table::new(
        "loop",
        "Going from map 1 to map 3 by map 2, against going directly: RMS distance over the walls of map 3.",
        &["method", "all three pairs have a pose", "loop misses by [m]"],
    );
    let gaps: Vec<Option<f64>> = ["hough-peaks", "hough"]
        .into_iter()
        .enumerate()
        .map(|(k, method)| {
            let poses: Option<Vec<_>> = answers.iter().map(|of| of[k].pose).collect();
            let gap = poses.map(|poses| Moments::of(&robots[2].map).distance(poses[0] * poses[2], poses[1]));
            table.push(vec![method.into(), gap.is_some().into(), gap.into()]);
            gap
        })
        .collect();
    let fused = |k: usize| welds[k].words();
    let told = |gap: Option<f64>| gap.map_or("no loop".to_owned(), |gap| format!("misses by {gap:.3} m"));
    let closed = |k: usize| welds[k].count() == 3 && welds[k].worst_m() <= super::answer::RIGHT_WITHIN_M;
    let claims = vec![
        Claim {
            claim: "The setting: covered area, trajectories, overlap.".into(),
            paper: "about 600 m2; about 60, 35 and 55 m; about 38 %".into(),
            ours: format!("{area:.0} m2; {}; {}", driven.join(", "), overlaps.join(", ")),
            verdict: Verdict::when((area - 600.0).abs() < 60.0),
        },
        Claim {
            claim: "By merging the maps the loop is closed (hough-peaks).".into(),
            paper: "V = 94 %".into(),
            ours: format!("{}; the loop of the three pairs {}", fused(0), told(gaps[0])),
            verdict: Verdict::when(closed(0)),
        },
        Claim {
            claim: "Ours: the default engine closes it too.".into(),
            paper: "-".into(),
            ours: format!(
                "{}; the loop of the three pairs {}. In frames anywhere: {}",
                fused(1),
                told(gaps[1]),
                fused(3)
            ),
            verdict: Verdict::when(closed(1) && closed(3)),
        },
    ];
    let caption = "Figure 13 of the paper: the three partial maps with the robots' ways, and all three fused into the frame \
                   of the first; walls of several maps in black.";
    Ok(Outcome {
        name: ExperimentName::ThreeRobots,
        method: "A ring of corridors with rooms and alcoves. Each robot drives a part of the ring and overlaps with both \
                 others at its ends, so that only all three maps together go round. Lidars reach 8 m. Frames within 20 cells \
                 of each other at any rotation."
            .into(),
        claims,
        tables: vec![pair_table, table, team::weld_table(&robots, &welds)],
        figures: vec![team::figure("figure-13", caption, &robots, &welds)],
    })
}
