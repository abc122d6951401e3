//! The method `hough`, the default: the Hough spectrum gives the rotations, a signed correlation the shifts, the walls the
//! rest, and the free space the truth.
//!
//! Imports `geometry`, `grid` and what is beside `methods` in the room. Pure.
//!
//! **Convention.** `pose_fixed_moving`: `p_fixed = pose_fixed_moving * p_moving`. The search itself works between the maps'
//! local frames (`placement`), with the map of less structure as the moving one, so that an inverse pair gives the
//! inverse pose and a map posed anew gives nothing but another pose.
//!
//! **Method.** Of each map once: states and nearest walls of all cells (`cells`), walls with their directions (`walls`), the
//! Hough spectrum (`spectrum`). Of a pair: (1) rotations (`rotation`); (2) shifts for each (`translation`); (3) all refined
//! with few samples, the better ones further (`refine`, `score`, `shortlist`); (4) the decision (`decision`).
//!
//! **Shapes and units.** Metres and radians. Walls are counted in samples of 0.1 m. Windows follow the cell size.
//!
//! **Cost.** One thread, the least of five times, median over 98 pairs of maps of about 500 x 800 cells: features 2.7 ms a
//! map; rotation 0.02, translation 4.4, coarse refinement 1.3, fine 0.9, polish 0.5, the answer 0.3; 13.6 ms together (18.3 in
//! an hour when the machine was slower, and then on two threads 11.0).
//! `benches/registration.rs` tells it by stage and by size; maps of 4000 x 4000 cells, full of walls: features 85 ms a map,
//! search 66 ms (106 and 81 in the slower hour, and then on two threads 64 and 49). How far each is from its floor:
//!
//! * Features: the floor is memory, 2 bytes a cell read and 5 written, 0.3 ms at 10 GB/s, which the passes over all cells
//!   keep to; the rest follows the wall: windows and labels 0.6 ms, the spectrum 0.6 (180 directions, each one addition in
//!   the first cache for each sample).
//! * Translation: the floor is 2 + 3 R transforms of 5 N log2 N flops for N padded cells and R rotations (in the median 83,000
//!   and 2), 1.4 ms of the time. Above it
//!   stand the products (0.6), peaks (0.9) and transposed stores (0.4), bound by the second cache, and the rasters (0.5).
//! * Refinement and score: the floor is two dependent gathers a sample; 64 samples' first gathers are under way at once.
//!   Most of the time is spent waiting for them: a map's cells are larger than the second cache.
//!
//! Memory: 1 byte a cell of the known area while features are made, 4 afterwards, of which unknown areas are never touched,
//! 32 bytes an occupied cell, and for each thread two and a half complex arrays of the padded coarse size.
//!
//! **Fails when** a building repeats itself and the maps show no more than what repeats: two equal rooms are equal. It then
//! answers `Ambiguous` if it sees both, and is wrong if it sees only one of them.
//!
//! **Differences from the paper.** All rotation candidates are kept; shifts come from a signed correlation of walls and free
//! space instead of peak pairs; the pose is refined on walls, not by entropy; V accepts nothing (54 % of
//! refined wrong hypotheses have V above 92 %), it only speaks against.
//!
//! **How far to trust it.** "Bad" is a wrong or a false merge. The probability of the decision was fitted with the data in
//! ten parts, all maps of a building in one part, each part judged by the weights fitted to the others. At the default
//! threshold, without the part's own buildings:
//!
//! * 103 matching pairs of 18 buildings, 52 others, 50 pairs of six kinds of difficulty, 27 of one building without common
//!   area: 0 bad; recall .958 at overlap 0.3 or more, .813 below (.844 with the default weights), .7 where the furniture was
//!   changed (.8), .9 or more for the other difficulties. Two bent buildings (97 and 8 pairs, by the rule for bent maps
//!   alone, which was fitted to them):
//!   0 bad, recall .71.
//! * 910 simulated pairs of eight kinds of buildings (400 matching, 360 of one building without common area, 150 of two): 8
//!   bad, 7 of them in buildings that repeat themselves; recall .84.
//! * 910 more that no weight was ever fitted to: 10 bad, 8 of them in buildings that repeat themselves; recall .82 (three
//!   rules of thumb with bounds fitted by hand, before: 19 bad, recall .77).
//! * 910 of a third seed, made when all weights and rules stood: 12 bad, all of them in buildings that repeat themselves
//!   (equal rooms at equal corridors, cell by cell but for the noise); of 350 matching pairs of the seven other kinds 313
//!   right and none wrong, of 446 others none merged; recall .80.
//! * 910 of a fourth (`mapweld simulate --seed 3 --matching 400 --same-building 360 --different 150`): 11 bad, 9 of them in
//!   buildings that repeat themselves; in the seven other kinds 309 of 350 right and none wrong, of 446 others 2 merged, with
//!   probabilities of .67 and .73; recall .79.
//!
//! `benches/fit_decision.py` fits and judges so. Given the labelled pairs and those of one seed alone, all of them left
//! out in turn, it finds the same as the first line for the labelled ones, and for the third seed 12 bad, 11 of them in
//! buildings that repeat themselves, and a recall of .80; for the fourth 10 bad, 8 of them there, and .79.
//!
//! The default weights are those fitted to all of these pairs but the bent ones. Tried and dropped: a placement for each
//! piece of a bent map (a wrong hypothesis gains as much by bending as the right one does: of 97 bent pairs 19 instead of
//! 69 could be accepted without a bad one); long walls in free space apart from furniture, boosted trees, and
//! weights fitted with the bent maps among the rest (none better in left-out buildings).

mod agreement;
mod cells;
mod correlation;
mod cropped;
mod decision;
mod features;
pub(crate) mod fft;
mod num;
mod params;
mod peaks;
mod placement;
mod raster;
mod refine;
mod report;
mod rotation;
mod samples;
mod score;
mod shortlist;
mod simd;
mod spectrum;
#[cfg(test)]
mod tests;
mod translation;
mod walls;

use std::time::Duration;

use rayon::prelude::*;
use serde::Serialize;

pub use params::{BentParameters, DecisionParameters, HoughParameters, HoughParametersError, PosteriorTerms};
pub use score::{Score, Tally};

use super::{Method, MethodName};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::registration::{Control, MapFeatures, Reason, Registration, Rejection, StageTime, Unhurried};
use decision::{Finalist, confirm, decide, rank, terms};
use features::Features;
use params::Tolerances;
use placement::Placement;
use refine::{COARSE, FINE, POLISH, refine};
use report::{Pair, no_structure};
use samples::Thinned;
use score::score;
use shortlist::shortlist;

/// The method of this module.
pub struct Hough {
    parameters: HoughParameters,
    planner: fft::Planner,
}

impl Default for Hough {
    fn default() -> Self {
        Self {
            parameters: HoughParameters::default(),
            planner: fft::Planner::new(),
        }
    }
}

impl Hough {
    /// The method with parameters of the caller's.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(parameters: HoughParameters) -> Result<Self, HoughParametersError> {
        Ok(Self {
            parameters: parameters.checked()?,
            planner: fft::Planner::new(),
        })
    }

    /// The finalists of the search, best first; or why there are none.
    fn search(&self, pair: &Pair, stages: &mut Stages) -> Result<Vec<Finalist>, Reason> {
        let (fixed, moving, parameters) = (pair.fixed, pair.moving, &self.parameters);
        let rotations = rotation::candidates(&fixed.spectrum, &moving.spectrum, parameters.rotations);
        stages.end("rotation")?;

        let tolerances = Tolerances::of(fixed, moving);
        let thinned = |most| (Thinned::new(fixed, most), Thinned::new(moving, most));
        let (shifts, [few, more, fine, scored, polished]) = rayon::join(
            || translation::shifts(&self.planner, fixed, moving, &rotations, parameters),
            || {
                let samples = [
                    parameters.coarse_samples / 2,
                    parameters.coarse_samples,
                    parameters.fine_samples,
                    parameters.scored_samples,
                    parameters.polished_samples,
                ];
                samples.map(thinned)
            },
        );
        stages.end("translation")?;

        // Half of the way with half of the samples for all, the rest for those that got somewhere.
        let (first, second) = COARSE.split_at(COARSE.len() / 2);
        let refine_and_score = |start: Placement, schedule, (fixed, moving): &(Thinned, Thinned)| {
            let refined = refine(fixed, moving, start, schedule, tolerances.stretch);
            (refined.placement, score(fixed, moving, refined.placement, tolerances))
        };
        let begun: Vec<(Placement, Score)> = shifts
            .par_iter()
            .map(|shift| refine_and_score(shift.placement, first, &few))
            .collect();
        let chosen = shortlist(&begun, moving.moments, 2 * parameters.shortlist);
        let coarse: Vec<(Placement, Score)> = chosen
            .par_iter()
            .map(|&index| refine_and_score(begun[index].0, second, &more))
            .collect();
        stages.end("coarse refinement")?;

        let chosen = shortlist(&coarse, moving.moments, parameters.shortlist);
        let finalists: Vec<Finalist> = chosen
            .par_iter()
            .map(|&index| {
                let refined = refine(&fine.0, &fine.1, coarse[index].0, &FINE, tolerances.stretch);
                Finalist::new(refined, score(&scored.0, &scored.1, refined.placement, tolerances))
            })
            .collect();
        let mut ranked = rank(finalists, moving.moments);
        stages.end("fine refinement")?;

        // All samples, or nearly, for the few that the answer may be about.
        let (fixed, moving) = polished;
        ranked.par_iter_mut().take(parameters.polished).for_each(|finalist| {
            let refined = refine(&fixed, &moving, finalist.placement(), &POLISH, tolerances.stretch);
            *finalist = Finalist::new(refined, score(&fixed, &moving, refined.placement, tolerances));
        });
        let ranked = rank(ranked, pair.moving.moments);
        stages.end("polish")?;
        if ranked.is_empty() {
            return Err(Reason::NoOverlap {
                score: 0.0,
                needed: parameters.decision.score_min.into(),
            });
        }
        Ok(ranked)
    }

    /// All hypotheses that the search looked at closely, best first: for fitting the decision.
    #[must_use]
    pub fn examine(&self, fixed: &MapFeatures, moving: &MapFeatures) -> Vec<Hypothesis> {
        let (Some(fixed), Some(moving)) = (fixed.of::<Option<Features>>(), moving.of::<Option<Features>>()) else {
            return Vec::new();
        };
        let pair = ordered(fixed, moving);
        let ranked = self.search(&pair, &mut Stages::new(&Unhurried)).unwrap_or_default();
        let hypotheses = ranked.iter().enumerate().map(|(index, finalist)| {
            let pose = finalist.placement().between_maps(pair.fixed.frame, pair.moving.frame);
            Hypothesis {
                pose: if pair.swapped { pose.inverse() } else { pose },
                score: finalist.score,
                terms: terms(&ranked, index, pair.moving.moments),
            }
        });
        hypotheses.collect()
    }
}

/// A pose that the search looked at closely.
#[derive(Debug, Clone, Serialize)]
pub struct Hypothesis {
    /// Pose of the moving map's frame in the fixed map's.
    pub pose: Pose2,
    /// What the walls of both maps meet there.
    pub score: Score,
    /// What speaks for and against it.
    pub terms: PosteriorTerms,
}

impl Method for Hough {
    fn name(&self) -> MethodName {
        MethodName::Hough
    }

    fn features(&self, map: &OccupancyGrid) -> MapFeatures {
        MapFeatures::new(Features::new(map, &self.parameters))
    }

    fn register(&self, fixed: &MapFeatures, moving: &MapFeatures, control: &dyn Control) -> Registration {
        let mut stages = Stages::new(control);
        let maps = [
            fixed.of::<Option<Features>>().as_ref(),
            moving.of::<Option<Features>>().as_ref(),
        ];
        let reject = |reason, stages: Stages| {
            Registration::Rejected(Rejection {
                reason,
                candidates: Vec::new(),
                stages: stages.times,
            })
        };
        if let Err(reason) = stages.go_on() {
            return reject(reason, stages);
        }
        if let Some(reason) = no_structure(maps, self.parameters.structure_m) {
            return reject(reason, stages);
        }
        let [Some(fixed), Some(moving)] = maps else {
            unreachable!("invariant: a map without features has no structure");
        };
        let pair = ordered(fixed, moving);
        let mut ranked = match self.search(&pair, &mut stages) {
            Ok(ranked) => ranked,
            Err(reason) => return reject(reason, stages),
        };
        let verdict = decide(&mut ranked, pair.moving.moments, &self.parameters.decision);
        let mut answer = pair.tell(&ranked, verdict, &self.parameters.decision);
        if let Err(reason) = stages.end("decision") {
            return reject(reason, stages);
        }
        match &mut answer {
            Registration::Accepted(acceptance) => acceptance.stages = stages.times,
            Registration::Rejected(rejection) => rejection.stages = stages.times,
        }
        answer
    }

    fn required_verification(&self) -> Option<f64> {
        None // asked by the decision itself
    }

    fn verify_at(
        &self,
        fixed: &MapFeatures,
        moving: &MapFeatures,
        pose_fixed_moving: Pose2,
        control: &dyn Control,
    ) -> Registration {
        let mut stages = Stages::new(control);
        let maps = [
            fixed.of::<Option<Features>>().as_ref(),
            moving.of::<Option<Features>>().as_ref(),
        ];
        let rejected = |reason, stages: Stages| {
            Registration::Rejected(Rejection {
                reason,
                candidates: Vec::new(),
                stages: stages.times,
            })
        };
        if let Some(reason) = stages.go_on().err().or(no_structure(maps, self.parameters.structure_m)) {
            return rejected(reason, stages);
        }
        let [Some(fixed), Some(moving)] = maps else {
            unreachable!("invariant: a map without features has no structure");
        };
        let pair = ordered(fixed, moving);
        let pose = if pair.swapped {
            pose_fixed_moving.inverse()
        } else {
            pose_fixed_moving
        };
        let start = Placement::of_maps(pose, pair.fixed.frame, pair.moving.frame);
        let tolerances = Tolerances::of(pair.fixed, pair.moving);
        let thinned = |most| (Thinned::new(pair.fixed, most), Thinned::new(pair.moving, most));
        let (few, all) = (
            thinned(self.parameters.fine_samples),
            thinned(self.parameters.polished_samples),
        );
        let near = refine(&few.0, &few.1, start, &COARSE[2..], tolerances.stretch);
        let refined = refine(&few.0, &few.1, near.placement, &FINE, tolerances.stretch);
        let score = score(&all.0, &all.1, refined.placement, tolerances);
        let ranked = [Finalist::new(refined, score)];
        let verdict = confirm(&ranked[0], start, pair.moving.moments, &self.parameters.decision);
        let mut answer = pair.tell(&ranked, verdict, &self.parameters.decision);
        if let Err(reason) = stages.end("verification") {
            return rejected(reason, stages);
        }
        match &mut answer {
            Registration::Accepted(acceptance) => acceptance.stages = stages.times,
            Registration::Rejected(rejection) => rejection.stages = stages.times,
        }
        answer
    }
}

/// The map with less structure moves: both ways round the search is the same, and the answers are each other's inverse.
fn ordered<'a>(fixed: &'a Features, moving: &'a Features) -> Pair<'a> {
    if fixed.order < moving.order {
        Pair {
            fixed: moving,
            moving: fixed,
            swapped: true,
        }
    } else {
        Pair {
            fixed,
            moving,
            swapped: false,
        }
    }
}

/// Times the stages and asks between them whether to go on.
struct Stages<'a> {
    control: &'a dyn Control,
    since: Duration,
    times: Vec<StageTime>,
}

impl<'a> Stages<'a> {
    fn new(control: &'a dyn Control) -> Self {
        Self {
            control,
            since: control.now(),
            times: Vec::new(),
        }
    }

    fn go_on(&self) -> Result<(), Reason> {
        self.control.should_stop().map_or(Ok(()), |stop| Err(stop.into()))
    }

    fn end(&mut self, stage: &'static str) -> Result<(), Reason> {
        let now = self.control.now();
        self.times.push(StageTime {
            stage,
            duration: now.saturating_sub(self.since),
        });
        self.since = now;
        self.go_on()
    }
}
