//! A method for tests that answers by a script instead of looking at maps.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::{WeldInput, WeldOptions};
use crate::geometry::{Angle, Pose2};
use crate::grid::{Lattice, LogOdds, OccupancyGrid};
use crate::registration::{
    Acceptance, Candidate, Control, Covariance, Evidence, MapFeatures, Method, MethodName, Reason, Registration,
    Rejection,
};

/// Knows maps by their number of occupied cells, map n of [`world`] has n + 1, and fused groups by their larger lattice.
#[derive(Default)]
pub(super) struct Scripted {
    answers: BTreeMap<(usize, usize), Registration>,
    /// The answer for a fused group against anything.
    pub(super) group: Option<Registration>,
    required: Option<f64>,
    pub(super) searches: AtomicUsize,
    pub(super) looks: AtomicUsize,
}

/// What fused groups are known as.
const GROUP: usize = usize::MAX;
const CELLS: usize = 2400;

/// Maps of one place with their poses in the world, map 0 at its origin; they overlap in a row.
pub(super) fn world(maps: usize) -> (Vec<Pose2>, Vec<WeldInput>) {
    let lattice = Lattice::new(60, 40, 0.1, Pose2::IDENTITY).expect("valid");
    (0..maps)
        .map(|map| {
            let mut grid = OccupancyGrid::new(lattice, vec![LogOdds::FREE; CELLS]).expect("as many");
            grid.cells_mut()[..=map].fill(LogOdds::OCCUPIED);
            let step = f64::from(u32::try_from(map).expect("few"));
            let pose = Pose2::new(1.5 * step, (step * 0.7).sin(), Angle::from_radians(0.3 * step));
            (pose, WeldInput::new(format!("robot-{map}"), Arc::new(grid)))
        })
        .unzip()
}

impl Scripted {
    /// A method that requires so much of a pose; 0.97 is what all answers have.
    pub(super) fn requiring(required: Option<f64>) -> Self {
        Self {
            required,
            ..Self::default()
        }
    }

    /// The pair is accepted, `off` away from the truth.
    pub(super) fn accept_off(&mut self, truth: &[Pose2], a: usize, b: usize, score: f64, off: Pose2) {
        let acceptance = Acceptance {
            pose_fixed_moving: truth[a].inverse() * truth[b] * off,
            covariance: Covariance::diagonal(0.02, 0.002),
            evidence: evidence(score),
            stages: Vec::new(),
        };
        self.answers.insert((a, b), Registration::Accepted(acceptance));
    }

    pub(super) fn accept(&mut self, truth: &[Pose2], a: usize, b: usize, score: f64) {
        self.accept_off(truth, a, b, score, Pose2::IDENTITY);
    }

    /// The pair is accepted, and its method holds it for so likely right.
    pub(super) fn accept_with(&mut self, truth: &[Pose2], (a, b): (usize, usize), probability: f64, off: Pose2) {
        self.accept_off(truth, a, b, 100.0, off);
        if let Some(Registration::Accepted(accepted)) = self.answers.get_mut(&(a, b)) {
            accepted.evidence.probability = Some(probability);
        }
    }

    /// The pair is ambiguous between these places, told by how far they are off the truth.
    pub(super) fn ambiguous(&mut self, truth: &[Pose2], a: usize, b: usize, places: &[(f64, Pose2)]) {
        let candidate = |&(score, off): &(f64, Pose2)| Candidate {
            pose_fixed_moving: truth[a].inverse() * truth[b] * off,
            covariance: Covariance::diagonal(0.05, 0.005),
            evidence: evidence(score),
        };
        let rejection = Rejection {
            reason: Reason::Ambiguous {
                score: places[0].0,
                runner_up_score: places.get(1).map_or(0.0, |place| place.0),
            },
            candidates: places.iter().map(candidate).collect(),
            stages: Vec::new(),
        };
        self.answers.insert((a, b), Registration::Rejected(rejection));
    }

    pub(super) fn options(self) -> (Arc<Self>, WeldOptions) {
        let method = Arc::new(self);
        (method.clone(), WeldOptions::new(method))
    }

    pub(super) fn searched(&self) -> usize {
        self.searches.load(Ordering::Relaxed)
    }

    pub(super) fn looked(&self) -> usize {
        self.looks.load(Ordering::Relaxed)
    }

    fn answer(&self, fixed: &MapFeatures, moving: &MapFeatures) -> Registration {
        let (a, b) = (*fixed.of::<usize>(), *moving.of::<usize>());
        if a == GROUP || b == GROUP {
            return self.group.clone().unwrap_or_else(nothing);
        }
        if let Some(answer) = self.answers.get(&(a - 1, b - 1)) {
            return answer.clone();
        }
        let mut answer = self.answers.get(&(b - 1, a - 1)).cloned().unwrap_or_else(nothing);
        match &mut answer {
            Registration::Accepted(accepted) => accepted.pose_fixed_moving = accepted.pose_fixed_moving.inverse(),
            Registration::Rejected(rejection) => {
                for candidate in &mut rejection.candidates {
                    candidate.pose_fixed_moving = candidate.pose_fixed_moving.inverse();
                }
            }
        }
        answer
    }
}

pub(super) fn nothing() -> Registration {
    Registration::Rejected(Rejection {
        reason: Reason::NoOverlap {
            score: 3.0,
            needed: 40.0,
        },
        candidates: Vec::new(),
        stages: Vec::new(),
    })
}

pub(super) fn evidence(score: f64) -> Evidence {
    Evidence {
        probability: None,
        score,
        verification_index: Some(0.97),
        overlap: score / 200.0,
        matched_wall_m: score / 2.0,
        violated_wall_m: 0.1,
        weaker_direction_m: score / 5.0,
        runner_up: None,
    }
}

impl Method for Scripted {
    fn name(&self) -> MethodName {
        MethodName::ALL[0]
    }

    fn features(&self, map: &OccupancyGrid) -> MapFeatures {
        let alone = map.lattice().cell_count() == CELLS;
        MapFeatures::new(if alone { map.state_counts().occupied } else { GROUP })
    }

    fn register(&self, fixed: &MapFeatures, moving: &MapFeatures, _: &dyn Control) -> Registration {
        self.searches.fetch_add(1, Ordering::Relaxed);
        self.answer(fixed, moving)
    }

    fn required_verification(&self) -> Option<f64> {
        self.required
    }

    fn verify_at(&self, fixed: &MapFeatures, moving: &MapFeatures, _: Pose2, _: &dyn Control) -> Registration {
        self.looks.fetch_add(1, Ordering::Relaxed);
        self.answer(fixed, moving)
    }
}
