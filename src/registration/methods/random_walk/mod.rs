//! `random-walk`: A. Birk and S. Carpin, "Merging occupancy grid maps from multiple robots" (2006), as Saeedi et al. describe it
//! in their section 6.2.
//!
//! May import what the room `registration` may: `geometry`, `grid`, `random`, and the room's own types.
//!
//! **Convention.** The answer is `pose_fixed_moving`; `p_fixed = R(psi) p_moving + T`. The search moves the map of less
//! structure, so that an inverse pair has the inverse answer. All draws come from `seed`, a stream for each walk, so that the
//! number of threads changes nothing.
//!
//! **Method.** Of each map alone its distance maps (`distances`), of a pair under these stage names:
//!
//! 1. `start set`: a set of known rotations and translations is looked at; the best ones that are not neighbours are the
//!    starts;
//! 2. `walks`: an adaptive random walk from each start makes the similarity (`similarity`) as small as it can (`walk`);
//! 3. `verification`: of the walks' ends that of the greatest V is the answer when V reaches the threshold (eq. 33 and 34).
//!
//! **Shapes and units.** Metres and radians for places; cells for distances.
//!
//! **Cost.** `start_rotations * start_translations^2 * 4 * start_samples` looks into a distance map for the starts, and
//! `walks * steps * 4 * samples` for the walks: 19 million each with the defaults, whatever the size of the maps.
//!
//! **Fails when** the maps overlap in part: the mean distance then prefers places where much lies over much. Two maps of one
//! office with 57 % in common are laid 4 to 8 m off, with V of 0.95 and more, with each of the seeds tried. It is a search by
//! chance: another seed may find what one missed.
//!
//! **Differences from the paper.** Several starts are followed instead of the best one. Distances are bounded, sums run over
//! samples, and the lock is weighed differently: see `similarity` and `walk`.

mod distances;
mod params;
mod similarity;
mod walk;

pub use params::RandomWalkParams;

use rayon::prelude::*;

use crate::geometry::{Angle, Point};
use crate::grid::OccupancyGrid;
use crate::random::Random;
use crate::registration::methods::shared::map::{Map, Prepared};
use crate::registration::methods::shared::search::{Found, Order, Question, Stages, register};
use crate::registration::methods::{Method, MethodName, ParameterError};
use crate::registration::overlap::StateMap;
use crate::registration::{Control, MapFeatures, Reason, Registration};
use distances::Distances;
use similarity::{Samples, Similarity};
use walk::{Place, Scales, pose_of, walk};

/// Name of the walks' streams of random numbers.
const WALKS: u64 = 1;

/// Birk and Carpin's method with checked parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct RandomWalk {
    params: RandomWalkParams,
}

impl RandomWalk {
    /// The method with these parameters.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that is out of range, its value and its limits.
    pub fn new(params: RandomWalkParams) -> Result<Self, ParameterError> {
        params.validate().map(|()| Self { params })
    }
}

impl Method for RandomWalk {
    fn name(&self) -> MethodName {
        MethodName::RandomWalk
    }

    fn features(&self, map: &OccupancyGrid) -> MapFeatures {
        MapFeatures::new(Features::of(Map::new(StateMap::new(map)), &self.params))
    }

    fn register(&self, fixed: &MapFeatures, moving: &MapFeatures, control: &dyn Control) -> Registration {
        let question = Question {
            params: &self.params,
            rule: self.params.rule(),
            wall_min_m: self.params.wall_min_m,
            order: Order::ByStructure,
        };
        register(
            fixed.of::<Features>(),
            moving.of(),
            control,
            &question,
            |fixed, moving, stages| search(fixed, moving, stages, &self.params),
        )
    }

    fn required_verification(&self) -> Option<f64> {
        self.params.rule().required()
    }
}

/// A map as the method sees it.
#[derive(Debug, Clone)]
struct Features {
    map: Map,
    distances: Distances,
    /// For the start set and for the walks.
    samples: [Samples; 2],
}

impl Prepared for Features {
    type Params = RandomWalkParams;

    fn of(map: Map, params: &RandomWalkParams) -> Self {
        Self {
            distances: Distances::new(&map),
            samples: [params.start_samples, params.samples].map(|most| Samples::new(&map, most)),
            map,
        }
    }

    fn map(&self) -> &Map {
        &self.map
    }
}

impl Features {
    /// The middle of the walls, in metres in the map's frame.
    fn middle(&self) -> Point {
        self.map.points.center.map(|cells| cells * self.map.cell())
    }

    fn similarity<'a>(&'a self, moving: &'a Self, samples: usize, params: &RandomWalkParams) -> Similarity<'a> {
        let side = |features: &'a Self| (&features.distances, &features.samples[samples]);
        Similarity::new(side(self), side(moving), params)
    }
}

fn search(
    fixed: &Features,
    moving: &Features,
    stages: &mut Stages<'_>,
    params: &RandomWalkParams,
) -> Result<Vec<Found>, Reason> {
    let middle = moving.middle();
    let starts = starts(fixed, moving, stages, params)?;
    stages.done("start set")?;
    let similarity = fixed.similarity(moving, 1, params);
    let scales = Scales::new(fixed.map.cell(), params);
    let mut ends: Vec<(Place, f64)> = (0_u64..)
        .zip(starts)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(index, start)| {
            let mut random = Random::new(params.seed, &[WALKS, index]);
            let value_of = |place| similarity.of(pose_of(place, middle));
            walk(value_of, start, scales, &mut random, params, || stages.go_on())
        })
        .collect::<Result<_, Reason>>()?;
    ends.sort_by(|a, b| a.1.total_cmp(&b.1)); // stable: of equal ones that of the better start
    stages.done("walks")?;
    Ok(ends
        .into_iter()
        .map(|(place, _)| Found::from(pose_of(place, middle)))
        .collect())
}

/// The best places of the set that are not neighbours of a better one.
fn starts(
    fixed: &Features,
    moving: &Features,
    stages: &Stages<'_>,
    params: &RandomWalkParams,
) -> Result<Vec<Place>, Reason> {
    let middle = moving.middle();
    let similarity = fixed.similarity(moving, 0, params);
    let cell = fixed.map.cell();
    let reach = fixed.map.points.radius() * cell;
    let [x0, y0] = fixed.middle();
    let (turns, places) = (params.start_rotations, params.start_translations);
    // the middles of `places` equal parts of the box of the fixed map's walls
    let along = |start: f64, index: u32| start - reach + 2.0 * reach * (f64::from(index) + 0.5) / f64::from(places);
    let spacing = 2.0 * reach / f64::from(places);
    let values: Vec<Vec<(f64, Place)>> = (0..turns)
        .into_par_iter()
        .map(|turn| {
            stages.go_on()?;
            let yaw = Angle::from_radians(std::f64::consts::TAU * f64::from(turn) / f64::from(turns)).radians();
            let all = (0..places).flat_map(|j| (0..places).map(move |i| (i, j)));
            let places = all.map(|(i, j)| [along(x0, i), along(y0, j), yaw]);
            Ok(places
                .map(|place| (similarity.of(pose_of(place, middle)), place))
                .collect())
        })
        .collect::<Result<_, Reason>>()?;
    let mut values: Vec<(f64, Place)> = values.into_iter().flatten().collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0)); // stable: of equal ones the first of the set
    let mut kept: Vec<Place> = Vec::new();
    let step = std::f64::consts::TAU / f64::from(turns);
    for (_, place) in values {
        let neighbours = |other: &Place| {
            let turn = Angle::from_radians(place[2] - other[2]).magnitude();
            (place[0] - other[0]).abs() <= 1.5 * spacing
                && (place[1] - other[1]).abs() <= 1.5 * spacing
                && turn <= 1.5 * step
        };
        if !kept.iter().any(neighbours) {
            kept.push(place);
        }
        if kept.len() == params.walks as usize {
            break;
        }
    }
    Ok(kept)
}

#[cfg(test)]
mod tests;
