//! The course of a registration that is common to the methods after the paper: two maps in cells of one size, a method's
//! search for poses, their verification, the verdict.
//!
//! **Convention.** A search sees the map of more structure as the fixed one when its method promises that an inverse pair
//! has the inverse answer ([`Order::ByStructure`]), else the maps as they were given.

use std::cmp::Ordering;
use std::time::Duration;

use rayon::prelude::*;

use super::map::{Map, Prepared};
use super::verification::{Rule, inverted, ranked, verified};
use crate::geometry::Pose2;
use crate::registration::{Acceptance, Candidate, Control, Reason, Registration, Rejection, StageTime};

/// What a registration asks of a search and of its result.
#[derive(Debug)]
pub(crate) struct Question<'a, P> {
    pub(crate) params: &'a P,
    /// When a pose is accepted.
    pub(crate) rule: Rule,
    /// Metres of occupied cells that each map needs.
    pub(crate) wall_min_m: f64,
    pub(crate) order: Order,
}

/// Which of two maps a search moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// The one that the caller moves.
    AsGiven,
    /// The one of less structure: an inverse pair then has the inverse answer, unless the maps are equal to the cell.
    ByStructure,
}

/// A pose that a search has found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found {
    pub(crate) pose_fixed_moving: Pose2,
    /// Metres of wall that hold it in its weaker direction, where the search knows.
    pub(crate) support_m: Option<f64>,
}

impl From<Pose2> for Found {
    fn from(pose_fixed_moving: Pose2) -> Self {
        Self {
            pose_fixed_moving,
            support_m: None,
        }
    }
}

/// Takes the time of each stage and looks whether to go on.
pub(crate) struct Stages<'a> {
    control: &'a dyn Control,
    since: Duration,
    times: Vec<StageTime>,
}

impl<'a> Stages<'a> {
    fn start(control: &'a dyn Control) -> Self {
        Self {
            control,
            since: control.now(),
            times: Vec::new(),
        }
    }

    /// The stage that ran since the last one has ended.
    pub(crate) fn done(&mut self, stage: &'static str) -> Result<(), Reason> {
        let now = self.control.now();
        let duration = now.saturating_sub(self.since);
        self.times.push(StageTime { stage, duration });
        self.since = now;
        self.go_on()
    }

    /// Whether the caller wants the work to end: asked between the parts of a long stage, from any thread.
    pub(crate) fn go_on(&self) -> Result<(), Reason> {
        self.control.should_stop().map_or(Ok(()), |stop| Err(stop.into()))
    }
}

/// Registers two maps: the search finds poses, the verification chooses among them.
pub(crate) fn register<F: Prepared>(
    fixed: &F,
    moving: &F,
    control: &dyn Control,
    question: &Question<'_, F::Params>,
    search: impl FnOnce(&F, &F, &mut Stages<'_>) -> Result<Vec<Found>, Reason>,
) -> Registration {
    let mut stages = Stages::start(control);
    let (verdict, candidates) = match candidates(fixed, moving, &mut stages, question, search) {
        Ok(candidates) => (question.rule.verdict(candidates.first()), candidates),
        Err(reason) => (Err(reason), Vec::new()),
    };
    match verdict {
        Ok(Candidate {
            pose_fixed_moving,
            covariance,
            evidence,
        }) => Registration::Accepted(Acceptance {
            pose_fixed_moving,
            covariance,
            evidence,
            stages: stages.times,
        }),
        Err(reason) => Registration::Rejected(Rejection {
            reason,
            candidates,
            stages: stages.times,
        }),
    }
}

/// The hypotheses of the search with their evidence, the best first.
fn candidates<F: Prepared>(
    fixed: &F,
    moving: &F,
    stages: &mut Stages<'_>,
    question: &Question<'_, F::Params>,
    search: impl FnOnce(&F, &F, &mut Stages<'_>) -> Result<Vec<Found>, Reason>,
) -> Result<Vec<Candidate>, Reason> {
    stages.go_on()?;
    let structure_m = fixed.map().wall_m().min(moving.map().wall_m());
    if structure_m < question.wall_min_m || structure_m <= 0.0 {
        return Err(Reason::NoStructure {
            structure_m,
            needed_m: question.wall_min_m,
        });
    }
    let cell = fixed.map().cell().max(moving.map().cell());
    let swapped = question.order == Order::ByStructure && structure(fixed.map(), moving.map()) == Ordering::Less;
    let (one, other) = if swapped { (moving, fixed) } else { (fixed, moving) };
    let maps = (one.map(), other.map());
    let (one, other) = (one.at_cell(cell, question.params), other.at_cell(cell, question.params));
    let found = search(&one, &other, stages)?;
    let verify = |found: Found| {
        stages.go_on()?;
        let in_cells = (one.map(), other.map());
        Ok(verified(
            maps,
            in_cells,
            found.pose_fixed_moving,
            found.support_m,
            &question.rule,
        ))
    };
    let candidates = found.into_par_iter().map(verify).collect::<Result<Vec<_>, Reason>>()?;
    let mut candidates = ranked(candidates, other.map(), &question.rule);
    if swapped {
        candidates = candidates
            .into_iter()
            .map(|candidate| inverted(candidate, one.map()))
            .collect();
    }
    stages.done("verification")?;
    Ok(candidates)
}

/// Which map has less structure; a total order of maps of different cells.
fn structure(a: &Map, b: &Map) -> Ordering {
    let key = |map: &Map| {
        let lattice = map.states.lattice();
        (
            map.points.len(),
            map.states.counts().known(),
            lattice.width(),
            lattice.height(),
        )
    };
    let states = |map: &Map| {
        map.states
            .states()
            .iter()
            .map(|state| *state as u8)
            .collect::<Vec<u8>>()
    };
    key(a).cmp(&key(b)).then_with(|| states(a).cmp(&states(b)))
}
