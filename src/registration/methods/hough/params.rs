//! The numbers that the method goes by, each with its unit, and where its default comes from.

use serde::{Deserialize, Serialize};

use super::features::Features;
use super::raster::bounds;

/// Parameters of the method `hough`. Lengths hold for maps of 0.05 m a cell or finer; where they follow the cell size
/// the field says so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HoughParameters {
    /// How far a wall may lie from where it is looked for, metres, at least 10 cells. Design value.
    pub reach_m: f64,
    /// Rotation candidates modulo half a turn, 1 to 24. The true one is among 6 in all of 93 pairs, among 4 in 98 %.
    pub rotations: usize,
    /// Weights of disagreement of the two lists of shifts. Design values: 2 finds low overlaps, 0.5 bent maps.
    pub lambdas: [f32; 2],
    /// Local maxima taken of each rotation for each lambda.
    pub shifts_per_rotation: usize,
    /// Shifts kept over all rotations for each lambda.
    pub kept_shifts: [usize; 2],
    /// Wall samples of each map in the coarse refinement.
    pub coarse_samples: usize,
    /// Wall samples of each map in the fine refinement.
    pub fine_samples: usize,
    /// Wall samples of each map by which a fine result is scored; all of them once more for the best.
    pub scored_samples: usize,
    /// Fine results that are refined and scored once more with all samples.
    pub polished: usize,
    /// Coarse results kept by each criterion of the shortlist.
    pub shortlist: usize,
    /// Metres of wall that a map must have to be registered.
    pub structure_m: f64,
    /// When to accept.
    pub decision: DecisionParameters,
}

impl Default for HoughParameters {
    fn default() -> Self {
        Self {
            reach_m: 0.5,
            rotations: 6,
            lambdas: [2.0, 0.5],
            shifts_per_rotation: 25,
            kept_shifts: [50, 25],
            coarse_samples: 300,
            fine_samples: 400,
            scored_samples: 2000,
            polished: 4,
            shortlist: 8,
            structure_m: 5.0,
            decision: DecisionParameters::default(),
        }
    }
}

/// Parameters of the decision; see `decision` for what the rules are. Where the defaults come from: the labelled maps of
/// the project (real and simulated), each rule's bounds set a tenth inside of where the first wrong merge appears.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DecisionParameters {
    /// Maps as robots make them.
    pub plain: RuleParameters,
    /// Clean maps.
    pub strict: RuleParameters,
    /// Wide or cluttered places at coarse cells.
    pub coarse: CoarseParameters,
    /// Great maps that fit only in part.
    pub bent: BentParameters,
    /// Metres of wall in a map from which on the least scores grow with the map.
    pub extent_m: f32,
    /// A hypothesis is outdone when another finds so many times more wall ...
    pub outdone_ratio: f32,
    /// ... and has itself a plain score above this.
    pub outdone_score: f32,
    /// Where the best other plain score is above this share of its own, a strict winner ...
    pub strict_plain_ratio: f32,
    /// ... must leave the best other strict score below this share.
    pub strict_settled_ratio: f32,
    /// A plain winner's straight walls deep in free space are at most this share of what it finds.
    pub deep_max: f32,
}

/// When one score is distinct.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RuleParameters {
    /// The least score.
    pub score_min: f32,
    /// Metres of wall that must hold the weaker direction.
    pub support_min_m: f32,
    /// A runner-up below this share of the best score leaves it distinct.
    pub ratio_max: f32,
    /// Same, where the runner-up is also below `rival_max`.
    pub ratio_weak_max: f32,
    /// A runner-up above this stands by itself, whatever the best has: two self-consistent explanations.
    pub rival_max: f32,
}

/// Rule 3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoarseParameters {
    /// The runner-up's share at most.
    pub ratio_max: f32,
    /// Share of the walls in known space that is found, at least.
    pub share_min: f32,
    /// Straight walls deep in free space, at most this share of what is found.
    pub deep_max: f32,
    /// Metres of wall that must hold the weaker direction.
    pub support_min_m: f32,
    /// Least significance against the chance rate of the two maps.
    pub significance_min: f32,
}

/// Rule 4.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BentParameters {
    /// Metres of wall found at least, contradictions subtracted by a quarter.
    pub wall_min_m: f32,
    /// The runner-up's share at most.
    pub ratio_max: f32,
    /// Share of the walls in known space that is found, at least.
    pub share_min: f32,
    /// The same, at most: better maps are for the other rules.
    pub share_max: f32,
}

impl Default for DecisionParameters {
    fn default() -> Self {
        Self {
            plain: RuleParameters {
                score_min: 30.0,
                support_min_m: 1.7,
                ratio_max: 0.17,
                ratio_weak_max: 0.48,
                rival_max: 90.0,
            },
            strict: RuleParameters {
                score_min: 12.0,
                support_min_m: 1.7,
                ratio_max: 0.09,
                ratio_weak_max: 0.55,
                rival_max: 115.0,
            },
            coarse: CoarseParameters {
                ratio_max: 0.3,
                share_min: 0.72,
                deep_max: 0.1,
                support_min_m: 3.0,
                significance_min: 12.0,
            },
            bent: BentParameters {
                wall_min_m: 100.0,
                ratio_max: 0.63,
                share_min: 0.28,
                share_max: 0.7,
            },
            extent_m: 300.0,
            outdone_ratio: 1.6,
            outdone_score: 12.0,
            strict_plain_ratio: 0.45,
            strict_settled_ratio: 0.18,
            deep_max: 0.07,
        }
    }
}

impl DecisionParameters {
    fn all(&self) -> [(&'static str, f32); 25] {
        let (plain, strict, coarse, bent) = (&self.plain, &self.strict, &self.coarse, &self.bent);
        [
            ("decision.plain.score_min", plain.score_min),
            ("decision.plain.support_min_m", plain.support_min_m),
            ("decision.plain.ratio_max", plain.ratio_max),
            ("decision.plain.ratio_weak_max", plain.ratio_weak_max),
            ("decision.plain.rival_max", plain.rival_max),
            ("decision.strict.score_min", strict.score_min),
            ("decision.strict.support_min_m", strict.support_min_m),
            ("decision.strict.ratio_max", strict.ratio_max),
            ("decision.strict.ratio_weak_max", strict.ratio_weak_max),
            ("decision.strict.rival_max", strict.rival_max),
            ("decision.coarse.ratio_max", coarse.ratio_max),
            ("decision.coarse.share_min", coarse.share_min),
            ("decision.coarse.support_min_m", coarse.support_min_m),
            ("decision.coarse.significance_min", coarse.significance_min),
            ("decision.bent.wall_min_m", bent.wall_min_m),
            ("decision.bent.ratio_max", bent.ratio_max),
            ("decision.bent.share_max", bent.share_max),
            ("decision.extent_m", self.extent_m),
            ("decision.outdone_ratio", self.outdone_ratio),
            ("decision.outdone_score", self.outdone_score),
            ("decision.strict_plain_ratio", self.strict_plain_ratio),
            ("decision.strict_settled_ratio", self.strict_settled_ratio),
            ("decision.deep_max", self.deep_max),
            ("decision.coarse.deep_max", coarse.deep_max),
            ("decision.bent.share_min", bent.share_min),
        ]
    }
}

/// A parameter is out of its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("parameter {name} of the method hough is {value}; it must be {range}")]
pub struct HoughParametersError {
    /// The field.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// What it may be.
    pub range: &'static str,
}

impl HoughParameters {
    /// These parameters, if all are in range.
    ///
    /// # Errors
    /// Names the first field that is not.
    pub fn checked(self) -> Result<Self, HoughParametersError> {
        let count = super::num::real64;
        let within = |name, value: f64, least: f64, most: f64, range| {
            if (least..=most).contains(&value) {
                Ok(())
            } else {
                Err(HoughParametersError { name, value, range })
            }
        };
        within("reach_m", self.reach_m, 0.05, 5.0, "within 0.05 and 5 m")?;
        within("rotations", count(self.rotations), 1.0, 24.0, "within 1 and 24")?;
        for lambda in self.lambdas {
            within("lambdas", f64::from(lambda), 0.0, 100.0, "within 0 and 100")?;
        }
        within(
            "shifts_per_rotation",
            count(self.shifts_per_rotation),
            1.0,
            1000.0,
            "within 1 and 1000",
        )?;
        for kept in self.kept_shifts {
            within("kept_shifts", count(kept), 1.0, 10_000.0, "within 1 and 10000")?;
        }
        within(
            "coarse_samples",
            count(self.coarse_samples),
            20.0,
            1e6,
            "within 20 and 1000000",
        )?;
        within(
            "fine_samples",
            count(self.fine_samples),
            20.0,
            1e6,
            "within 20 and 1000000",
        )?;
        within(
            "scored_samples",
            count(self.scored_samples),
            20.0,
            1e6,
            "within 20 and 1000000",
        )?;
        within("polished", count(self.polished), 1.0, 100.0, "within 1 and 100")?;
        within("shortlist", count(self.shortlist), 1.0, 100.0, "within 1 and 100")?;
        within("structure_m", self.structure_m, 1.0, 1e6, "within 1 and 1000000 m")?;
        within(
            "decision.extent_m",
            self.decision.extent_m.into(),
            1.0,
            1e9,
            "at least 1 m",
        )?;
        for (name, value) in self.decision.all() {
            within(name, value.into(), 0.0, 1e9, "at least 0")?;
        }
        Ok(self)
    }

    /// Cell of the translation search, metres: finer for small maps, where it costs little, coarser for huge ones; never
    /// finer than two cells of the coarser map.
    pub(super) fn coarse_cell(fixed: &Features, moving: &Features) -> f64 {
        let side = |map| {
            let (_, width, height) = bounds(map, 0.0, 1.0);
            width.max(height)
        };
        let (a, b) = (side(fixed), side(moving));
        let cell: f64 = match (a + b, a.max(b)) {
            (..=40, _) => 0.15,
            (..=70, _) => 0.2,
            (_, ..=120) => 0.25,
            _ => 0.4,
        };
        cell.max(2.0 * f64::from(fixed.cells.cell.max(moving.cells.cell)))
    }
}

/// Distances at which a wall is found, missed and contradicted, for one pair of maps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tolerances {
    /// A wall at most so far away is found, metres.
    pub(super) found: f32,
    /// A wall farther away, with free space in its place, is contradicted, metres.
    pub(super) missed: f32,
    /// Scale of the weight of a found wall by its distance, metres.
    pub(super) soft: f32,
    /// By what the schedules of the refinement are stretched; 1 for cells of 0.05 m or less.
    pub(super) stretch: f32,
}

impl Tolerances {
    pub(super) fn of(fixed: &Features, moving: &Features) -> Self {
        let cell = fixed.cells.cell.max(moving.cells.cell).max(0.05);
        let stretch = 0.5 + 0.5 * cell / 0.05;
        Self {
            found: 0.10 * stretch,
            missed: 0.20 * stretch,
            soft: 0.06 * stretch,
            stretch,
        }
    }
}
