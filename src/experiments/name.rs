//! The experiments by name.

use std::fmt;
use std::str::FromStr;

/// The names of the experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ExperimentName {
    /// Figure 3 and properties 1 to 3.
    HoughProperties,
    /// Figures 8 to 10.
    TwoMapsStepByStep,
    /// Figure 11 and table 1.
    FourRobots,
    /// Figure 12.
    TwoRobots,
    /// Figure 13.
    ThreeRobots,
    /// Figures 16 and 17.
    OverlapSweep,
    /// Figures 18 and 19.
    DistortionSweep,
    /// Section 6.1 and table 2.
    Sensitivity,
    /// Table 3.
    Comparison,
    /// Where the paper's text is ambiguous or wrong: each reading measured.
    Readings,
}

impl ExperimentName {
    /// All experiments, in the order in which they run and stand in the report.
    pub const ALL: [Self; 10] = [
        Self::HoughProperties,
        Self::TwoMapsStepByStep,
        Self::FourRobots,
        Self::TwoRobots,
        Self::ThreeRobots,
        Self::OverlapSweep,
        Self::DistortionSweep,
        Self::Sensitivity,
        Self::Comparison,
        Self::Readings,
    ];

    /// As on the command line and in file names.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::HoughProperties => "hough-properties",
            Self::TwoMapsStepByStep => "two-maps-step-by-step",
            Self::FourRobots => "four-robots",
            Self::TwoRobots => "two-robots",
            Self::ThreeRobots => "three-robots",
            Self::OverlapSweep => "overlap-sweep",
            Self::DistortionSweep => "distortion-sweep",
            Self::Sensitivity => "sensitivity",
            Self::Comparison => "comparison",
            Self::Readings => "readings",
        }
    }

    /// A heading.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::HoughProperties => "Properties of the Hough image (figure 3)",
            Self::TwoMapsStepByStep => "Two maps, step by step (section 5.1, figures 8 to 10)",
            Self::FourRobots => "Four robots among thirty blocks (section 5.2, figure 11, table 1)",
            Self::TwoRobots => "Two robots in a basement (section 5.3, figure 12)",
            Self::ThreeRobots => "Three robots close a loop (section 5.4, figure 13)",
            Self::OverlapSweep => "How much overlap is needed (section 6.4, figures 16 and 17)",
            Self::DistortionSweep => "How much distortion is borne (section 6.5, figures 18 and 19)",
            Self::Sensitivity => "Do the parameters matter? (section 6.1, table 2)",
            Self::Comparison => "All methods compared (section 6.2, table 3)",
            Self::Readings => "Readings of the paper's text, measured",
        }
    }
}

impl fmt::Display for ExperimentName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// There is no experiment of this name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no experiment {0:?}; the experiments are: {names}", names = ExperimentName::ALL.map(ExperimentName::as_str).join(", "))]
pub struct UnknownExperiment(pub String);

impl FromStr for ExperimentName {
    type Err = UnknownExperiment;

    fn from_str(name: &str) -> Result<Self, UnknownExperiment> {
        let named = Self::ALL.into_iter().find(|experiment| experiment.as_str() == name);
        named.ok_or_else(|| UnknownExperiment(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn experiments_are_found_by_their_names_and_others_refused_with_all_names() {
        for name in ExperimentName::ALL {
            assert_eq!(name.as_str().parse(), Ok(name));
        }
        let refusal = "magic"
            .parse::<ExperimentName>()
            .expect_err("no such experiment")
            .to_string();
        assert!(
            refusal.contains("magic") && refusal.contains("overlap-sweep"),
            "{refusal}"
        );
    }
}
