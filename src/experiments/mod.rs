//! The paper's experiments, each in a file of its own: what was claimed, what comes out, and whether it holds.
//!
//! Imports `geometry`, `grid`, `registration`, `fusion` and `simulation`. Pure: values in, values out; the same seed gives
//! the same numbers, but for times. [`run`] computes an [`Outcome`]; [`plot::draw`] makes pictures of its figures, and
//! [`report::page`] a page of it all, as bytes; only `cli` writes them to files.
//!
//! "The paper" is S. Saeedi, L. Paull, M. Trentini, M. Seto, H. Li: Map merging for multiple robots using Hough peak
//! matching. Its recorded data sets are not at hand; its worlds are rebuilt by simulation after its words and numbers
//! (`worlds`), so its absolute values can be compared in kind only.

mod answer;
mod bars;
mod comparison;
mod distortion_sweep;
pub mod figure;
mod four_robots;
mod frames;
mod hough_properties;
mod name;
mod numbers;
mod outcome;
mod overlap_sweep;
mod pairs;
mod picture;
pub mod plot;
mod readings;
mod recorded;
pub mod report;
mod rotations;
mod sensitivity;
mod step_by_step;
mod steps;
mod superiority;
mod sweep;
mod team;
mod three_robots;
mod two_robots;
mod worlds;

pub use name::{ExperimentName, UnknownExperiment};
pub use outcome::{Cell, Claim, Outcome, Table, Verdict};
pub use recorded::{RecordedLabel, RecordedPair, chosen};

use crate::fusion::WeldError;
use crate::registration::Control;
use crate::simulation::SimulationError;

/// How experiments are run.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Seed of everything.
    pub seed: u64,
    /// Fewer seeds and sizes: a minute in all, for tests.
    pub quick: bool,
    /// Labelled pairs of recorded maps, for the comparison; may be empty.
    pub recorded: Vec<RecordedPair>,
}

/// Why an experiment has no outcome.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// The simulation could not make its maps.
    #[error("the maps cannot be simulated: {0}")]
    Simulation(#[from] SimulationError),
    /// The maps could not be welded.
    #[error("the maps cannot be welded: {0}")]
    Weld(#[from] WeldError),
    /// The caller stopped it.
    #[error("the experiment was stopped")]
    Stopped,
}

/// Runs one experiment. Tells its progress, and the time, by `control`.
///
/// # Errors
/// [`ExperimentError`] when its maps cannot be made, or the caller stops it.
pub fn run(name: ExperimentName, settings: &Settings, control: &dyn Control) -> Result<Outcome, ExperimentError> {
    use ExperimentName as Name;
    let outcome = match name {
        Name::HoughProperties => hough_properties::run(settings, control),
        Name::TwoMapsStepByStep => step_by_step::run(settings, control),
        Name::FourRobots => four_robots::run(settings, control),
        Name::TwoRobots => two_robots::run(settings, control),
        Name::ThreeRobots => three_robots::run(settings, control),
        Name::OverlapSweep => overlap_sweep::run(settings, control),
        Name::DistortionSweep => distortion_sweep::run(settings, control),
        Name::Sensitivity => sensitivity::run(settings, control),
        Name::Comparison => comparison::run(settings, control),
        Name::Readings => readings::run(settings, control),
    }?;
    if control.should_stop().is_some() {
        return Err(ExperimentError::Stopped);
    }
    Ok(outcome)
}

#[cfg(test)]
mod tests;
