//! `ransac`: peak matching by random sample consensus, the last row of Table 3 of Saeedi et al., as their section 6.2 describes it
//! (after Fischler and Bolles 1981 and Hartley and Zisserman 2004).
//!
//! May import what the room `registration` may: `geometry`, `grid`, `random`, and the room's own types.
//!
//! **Convention.** The answer is `pose_fixed_moving`; `p_fixed = R(psi) p_moving + T`. The search moves the map of less
//! structure, so that an inverse pair has the inverse answer. All draws come from `seed`.
//!
//! **Method.** Of each map alone its walls: the local peaks of the Hough image (eq. 20), each with its line segment and the picture
//! of its neighbourhood (`wall`). Of a pair, under these stage names:
//!
//! 1. `correspondences`: the mutual choice of the most similar walls (`correspondence`);
//! 2. `consensus`: the transformations of the lowest error over samples of four correspondences, by eq. 2, 3 and 35 to 39
//!    (`consensus`);
//! 3. `verification`: the transformation of the greatest V is the answer when V reaches the threshold (eq. 33 and 34).
//!
//! **Shapes and units.** Cells and radians inside, metres and radians outside.
//!
//! **Cost.** Products of the numbers of walls for the correspondences, samples times correspondences for the consensus: some
//! milliseconds each.
//!
//! **Fails when** too few of the mutual choices are right: in buildings of many equal walls, and when the robots saw the walls in
//! different lengths, as they do where the maps overlap in part.
//!
//! **Differences from the paper.** The transformations of the lowest errors are all verified instead of the best one alone. See
//! `correspondence` and `consensus` for the others.

mod consensus;
mod correspondence;
mod params;
mod wall;

pub use params::{RansacParams, SegmentDistance};

use crate::geometry::{Angle, Pose2};
use crate::grid::OccupancyGrid;
use crate::registration::methods::shared::hough_image::{Directions, HoughImage};
use crate::registration::methods::shared::map::{Map, Prepared};
use crate::registration::methods::shared::peaks::local_peaks;
use crate::registration::methods::shared::search::{Found, Order, Question, Stages, register};
use crate::registration::methods::{Method, MethodName, ParameterError};
use crate::registration::overlap::StateMap;
use crate::registration::{Control, MapFeatures, Reason, Registration};
use consensus::consensus;
use correspondence::correspondences;
use wall::Wall;

/// The method with checked parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Ransac {
    params: RansacParams,
}

impl Ransac {
    /// The method with these parameters.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that is out of range, its value and its limits.
    pub fn new(params: RansacParams) -> Result<Self, ParameterError> {
        params.validate().map(|()| Self { params })
    }
}

impl Method for Ransac {
    fn name(&self) -> MethodName {
        MethodName::Ransac
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
    walls: Vec<Wall>,
}

impl Prepared for Features {
    type Params = RansacParams;

    fn of(map: Map, params: &RansacParams) -> Self {
        let directions = Directions::half_turn_of_rotated(Angle::ZERO);
        let image = HoughImage::new(&map.points, directions, params.line_width_cells as usize);
        let peaks = local_peaks(&image, &params.peak_rule());
        Self {
            walls: peaks
                .iter()
                .map(|peak| Wall::new(peak, &image, &map.points, params))
                .collect(),
            map,
        }
    }

    fn map(&self) -> &Map {
        &self.map
    }
}

fn search(
    fixed: &Features,
    moving: &Features,
    stages: &mut Stages<'_>,
    params: &RansacParams,
) -> Result<Vec<Found>, Reason> {
    let pairs = correspondences(&fixed.walls, &moving.walls, params);
    stages.done("correspondences")?;
    let hypotheses = consensus(&pairs, params, || stages.go_on())?;
    stages.done("consensus")?;
    let cell = fixed.map.cell();
    let center = |features: &Features| features.map.points.center.map(|cells| cells * cell);
    let ([fx, fy], [mx, my]) = (center(fixed), center(moving));
    let pose = |motion: Pose2| {
        // from about the centres to the maps' own frames
        let in_metres = Pose2::new(motion.x() * cell, motion.y() * cell, motion.yaw());
        Pose2::new(fx, fy, Angle::ZERO) * in_metres * Pose2::new(-mx, -my, Angle::ZERO)
    };
    Ok(hypotheses
        .into_iter()
        .map(|found| Found::from(pose(found.motion)))
        .collect())
}

#[cfg(test)]
mod tests;
