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
    /// Rotation candidates modulo half a turn at most, 1 to 24; of most pairs there are two or three. The true one is among
    /// the first 4 in 98 % of 386 pairs; of a five-sided building it may be the eighth.
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
    /// Wall samples of each map by which a fine result is scored; more of them once more for the best.
    pub scored_samples: usize,
    /// Fine results that are refined and scored once more with all samples.
    pub polished: usize,
    /// Wall samples of each map in that last look, at most: more tell the pose no better than a millimetre.
    pub polished_samples: usize,
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
            rotations: 8,
            lambdas: [2.0, 0.5],
            shifts_per_rotation: 25,
            kept_shifts: [50, 25],
            coarse_samples: 300,
            fine_samples: 400,
            scored_samples: 2000,
            polished: 4,
            polished_samples: 10_000,
            shortlist: 8,
            structure_m: 5.0,
            decision: DecisionParameters::default(),
        }
    }
}

/// Parameters of the decision; see `decision` for what the rules are and the module's root for what they were fitted to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DecisionParameters {
    /// Least probability of being right that is accepted, 0 to 1. Where the figures of left-out buildings had no bad merge
    /// among the labelled maps, and no more than one in 300 among simulated buildings that do not repeat themselves.
    pub posterior_min: f32,
    /// How the probability is made up.
    pub weights: PosteriorTerms,
    /// Metres of wall that must hold the weaker direction.
    pub support_min_m: f32,
    /// A best plain score up to this is told as "no overlap"; a known pose must exceed it to be confirmed.
    pub score_min: f32,
    /// A known pose is confirmed when at least this share of the walls in known space is found.
    pub share_min: f32,
    /// Walls in free space, clutter counted half, must be less than this share of what is found.
    pub against_max: f32,
    /// A rival whose strict score is above this, and ...
    pub rival_min: f32,
    /// ... above this share of the best one's, is a second self-consistent explanation.
    pub rival_share_max: f32,
    /// A hypothesis is outdone when another finds more than so many times its wall, contradictions subtracted by a quarter.
    pub outdone_ratio: f32,
    /// A map is great from so many metres of wall on. ...
    pub extent_m: f32,
    /// ... Of the greater of two maps no more counts than so many times the wall of the other, which can agree no more than
    /// whole: of 36 simulated robots' maps in the map of eleven others 33 are placed rightly with this bound and 20 without,
    /// 2 wrongly and of 144 strangers none either way. ...
    pub extent_times: f32,
    /// ... The plain score must exceed so much for every metre beyond: more wall, more chances.
    pub score_per_m: f32,
    /// V of an accepted pose, at least. Of 240 right ones the lowest was 0.91; walls alone can agree by chance where the maps
    /// have hardly a wall in common.
    pub verification_min: f32,
    /// Maps are the same when at most this share of their walls is not found in the other. Equal rooms that two simulated
    /// robots saw differ in 4 % or more.
    pub same_max: f32,
    /// Great maps that fit only in part.
    pub bent: BentParameters,
}

/// What speaks for and against a hypothesis, a number each: what it has of each, or the weights, in logarithms of odds; see
/// `decision`. The weights were fitted by penalised logistic regression (`benches/fit_decision.py`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosteriorTerms {
    /// 1; its weight are the odds of a hypothesis without evidence.
    pub constant: f32,
    /// ln(plain score + 5).
    pub plain: f32,
    /// ln(deep score + 5).
    pub deep: f32,
    /// ln(samples of 0.1 m that hold the weaker direction + 1).
    pub support: f32,
    /// ln((best rival's plain score + 5) / (own + 5)).
    pub plain_ratio: f32,
    /// The same of the strict scores.
    pub strict_ratio: f32,
    /// The same of the lax scores.
    pub lax_ratio: f32,
    /// The share of all wall that is found: maps that show nothing but what they share are those of places that repeat.
    pub cover: f32,
    /// The greatest share found of a rival of comparable extent.
    pub chance: f32,
    /// The share of straight wall in what is found: clutter is seldom alike by chance.
    pub straight: f32,
    /// The clutter in free space, in shares of what is found.
    pub clutter: f32,
}

impl PosteriorTerms {
    /// The weights by their fields.
    fn named(&self) -> [(&'static str, f32); 11] {
        [
            ("decision.weights.constant", self.constant),
            ("decision.weights.plain", self.plain),
            ("decision.weights.deep", self.deep),
            ("decision.weights.support", self.support),
            ("decision.weights.plain_ratio", self.plain_ratio),
            ("decision.weights.strict_ratio", self.strict_ratio),
            ("decision.weights.lax_ratio", self.lax_ratio),
            ("decision.weights.cover", self.cover),
            ("decision.weights.chance", self.chance),
            ("decision.weights.straight", self.straight),
            ("decision.weights.clutter", self.clutter),
        ]
    }

    /// w . x.
    pub(super) fn dot(&self, other: &Self) -> f32 {
        let pairs = self.named().into_iter().zip(other.named());
        pairs.map(|((_, a), (_, b))| a * b).sum()
    }
}

/// Rule 5.
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
            posterior_min: 0.6,
            weights: PosteriorTerms {
                constant: -3.5328,
                plain: 1.1130,
                deep: 1.1946,
                support: 0.8070,
                plain_ratio: -0.6099,
                strict_ratio: -1.0305,
                lax_ratio: -0.9241,
                cover: -11.0039,
                chance: -7.6009,
                straight: -4.2348,
                clutter: -6.8417,
            },
            support_min_m: 1.7,
            score_min: 30.0,
            share_min: 0.72,
            against_max: 0.3,
            rival_min: 40.0,
            rival_share_max: 0.5,
            outdone_ratio: 6.0,
            extent_m: 500.0,
            extent_times: 2.0,
            score_per_m: 0.5,
            verification_min: 0.9,
            same_max: 0.02,
            bent: BentParameters {
                wall_min_m: 100.0,
                ratio_max: 0.63,
                share_min: 0.28,
                share_max: 0.7,
            },
        }
    }
}

impl DecisionParameters {
    /// Those that are at least 0.
    fn not_negative(&self) -> [(&'static str, f32); 17] {
        let bent = &self.bent;
        [
            ("decision.posterior_min", self.posterior_min),
            ("decision.support_min_m", self.support_min_m),
            ("decision.score_min", self.score_min),
            ("decision.share_min", self.share_min),
            ("decision.against_max", self.against_max),
            ("decision.rival_min", self.rival_min),
            ("decision.rival_share_max", self.rival_share_max),
            ("decision.outdone_ratio", self.outdone_ratio),
            ("decision.extent_m", self.extent_m),
            ("decision.extent_times", self.extent_times),
            ("decision.score_per_m", self.score_per_m),
            ("decision.verification_min", self.verification_min),
            ("decision.same_max", self.same_max),
            ("decision.bent.wall_min_m", bent.wall_min_m),
            ("decision.bent.ratio_max", bent.ratio_max),
            ("decision.bent.share_min", bent.share_min),
            ("decision.bent.share_max", bent.share_max),
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
        within(
            "polished_samples",
            count(self.polished_samples),
            20.0,
            1e6,
            "within 20 and 1000000",
        )?;
        within("shortlist", count(self.shortlist), 1.0, 100.0, "within 1 and 100")?;
        within("structure_m", self.structure_m, 1.0, 1e6, "within 1 and 1000000 m")?;
        for (name, value) in self.decision.not_negative() {
            within(name, value.into(), 0.0, 1e9, "at least 0")?;
        }
        for (name, value) in self.decision.weights.named() {
            within(name, value.into(), -1e3, 1e3, "within -1000 and 1000")?;
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
