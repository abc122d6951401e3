//! Table 3: all methods on the four experiments, with what the paper does not show, the true error; and on recorded maps.

mod bars;
mod cases;
mod claims;
mod compared;
mod printed;
mod recorded_maps;

use std::sync::Arc;

use super::answer::{Answer, WithDeadline, answer};
use super::outcome::Outcome;
use super::steps::Steps;
use super::{ExperimentError, ExperimentName, Settings};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::registration::{Control, Method, MethodName, MethodSpec};
use cases::{Case, cases_of};
use compared::Compared;
use recorded_maps::Recorded;
/// No single registration may take longer; a method that does counts as refusing.
const SECONDS_MAX: f64 = 20.0;
/// The same where only the way is looked at, not the answers.
const QUICK_SECONDS_MAX: f64 = 4.0;

pub(super) fn run(settings: &Settings, control: &dyn Control) -> Result<Outcome, ExperimentError> {
    let (seeds, seconds_max) = if settings.quick {
        (1, QUICK_SECONDS_MAX)
    } else {
        (3, SECONDS_MAX)
    };
    let mut cases = Vec::new();
    for seed in 0..seeds {
        cases.extend(cases_of(settings.seed + seed, settings.quick)?);
    }
    let methods: Vec<(MethodName, Arc<dyn Method>)> = MethodName::ALL
        .into_iter()
        .map(|name| (name, MethodSpec::default_of(name).build()))
        .collect();
    let steps = Steps::new(control, (cases.len() + settings.recorded.len()) * methods.len());
    // one registration after the other, each with the whole machine: only so do the times compare
    let ask = |fixed: &OccupancyGrid, moving: &OccupancyGrid, truth: Option<Pose2>| -> Vec<Answer> {
        let ask = |(_, method): &(MethodName, Arc<dyn Method>)| {
            let limited = WithDeadline::new(control, seconds_max);
            let answer = answer(&**method, fixed, moving, truth, &limited);
            steps.step();
            answer
        };
        methods.iter().map(ask).collect()
    };
    let answered: Vec<(Case, Vec<Answer>)> = cases
        .into_iter()
        .map(|case| {
            let answers = ask(&case.fixed, &case.moving, case.truth);
            (case, answers)
        })
        .collect();
    let names: Vec<MethodName> = methods.iter().map(|(name, _)| *name).collect();
    let simulated = Compared {
        names: &names,
        answered: &answered,
    };
    let mut tables = vec![simulated.table()];
    let mut claims = simulated.claims();
    let mut figures = vec![simulated.figure()];
    if !settings.recorded.is_empty() {
        let answers: Vec<Vec<Answer>> = settings
            .recorded
            .iter()
            .map(|pair| ask(&pair.fixed, &pair.moving, pair.truth))
            .collect();
        let recorded = Recorded {
            names: &names,
            settings,
            answers: &answers,
        };
        tables.push(recorded.table());
        claims.push(recorded.claim());
        figures.push(recorded.figure());
    }
    Ok(Outcome {
        name: ExperimentName::Comparison,
        method: format!(
            "Every method with its default parameters, one registration after the other on the whole machine; time of \
             features and search together, V of the best pose over cells known in both maps, and the RMS error of the best \
             pose over the moving map's walls. Four experiments with {seeds} seeds each, every pair once with frames within \
             20 cells of each other and once with frames 5 to 15 m apart on each axis; and pairs of maps of two of the \
             places. A decision is right when matching maps are merged within 0.5 m and others are refused; of maps that \
             have less than 10 % in common either will do. A registration that takes over {seconds_max} s is cut off{}.",
            if settings.recorded.is_empty() {
                "; no recorded maps were given (--maps)".to_owned()
            } else {
                format!("; and {} pairs of recorded maps", settings.recorded.len())
            }
        ),
        claims,
        tables,
        figures,
    })
}
