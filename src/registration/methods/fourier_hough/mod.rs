//! `fourier-hough`: registration by Hough and Fourier transforms after Onishi and Suzuki (1996), Li, Xiao and Wang (2003) and
//! Chunhavittayatera et al. (2006), the references 30, 41 and 7 of Saeedi et al., as their section 6.2 describes it.
//!
//! May import what the room `registration` may: `geometry`, `grid`, and the room's own types.
//!
//! **Convention.** The answer is `pose_fixed_moving`; `p_fixed = R(psi) p_moving + T`. The search moves the map of less
//! structure, so that an inverse pair has the inverse answer.
//!
//! **Method.** Of each map alone the magnitudes of its Hough columns' spectra, of a pair under these stage names:
//!
//! 1. `rotation`: one-dimensional phase correlation of the Hough images along theta (`shared::magnitudes`);
//! 2. `translation`: the moving map rotated, and the two-dimensional correlation of both maps' occupied cells by Fourier
//!    transforms, for the rotation and its half turn; its maximum is the translation (`shared::plane`);
//! 3. `verification`: the hypothesis of the greatest V is the answer when V reaches the threshold (eq. 33 and 34).
//!
//! **Shapes and units.** Cells and radians inside, metres and radians outside. 180 columns of a degree, bins of a cell;
//! pictures of a cell, or of larger cells when the padded picture would be longer than `side_max_cells`.
//!
//! **Cost.** 180 transforms of a column a map; two transforms of the padded picture for each rotation and half turn, which
//! take most of the time.
//!
//! **Fails when** the maps overlap in part: the magnitudes are those of all that a map shows, and the plain correlation counts
//! agreement alone and so prefers shifts that lay much over much. Measured figures are in `docs/methods.md`.
//!
//! **Differences from the paper.** The paper says "1D phase correlation applied to the Hough images" and no more; that the
//! magnitudes along rho are taken first is what makes it independent of the translation (Onishi and Suzuki). A Hough image has
//! period 180 degrees, so the half turn is tried as well. The verification is that of all methods here; the sources have none.

mod params;

pub use params::{FourierCorrelation, FourierHoughParams};

use rayon::prelude::*;

use crate::geometry::{Angle, Point, Pose2};
use crate::grid::OccupancyGrid;
use crate::registration::methods::hough::fft::Planner;
use crate::registration::methods::shared::hough_image::{Directions, HoughImage};
use crate::registration::methods::shared::magnitudes::{Magnitudes, rotations};
use crate::registration::methods::shared::map::{Map, Prepared};
use crate::registration::methods::shared::plane::{Plane, best_shifts};
use crate::registration::methods::shared::search::{Found, Order, Question, Stages, register};
use crate::registration::methods::{Method, MethodName, ParameterError};
use crate::registration::overlap::StateMap;
use crate::registration::{Control, MapFeatures, Reason, Registration};

/// The Fourier-Hough method with checked parameters.
pub struct FourierHough {
    params: FourierHoughParams,
    planner: Planner,
}

impl FourierHough {
    /// The method with these parameters.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that is out of range, its value and its limits.
    pub fn new(params: FourierHoughParams) -> Result<Self, ParameterError> {
        params.validate().map(|()| Self {
            params,
            planner: Planner::new(),
        })
    }

    fn search(&self, fixed: &Features, moving: &Features, stages: &mut Stages<'_>) -> Result<Vec<Found>, Reason> {
        let params = &self.params;
        let (apart, most) = (params.candidate_separation_degrees, params.rotation_candidates as usize);
        let rotations: Vec<Angle> = rotations(&fixed.magnitudes, &moving.magnitudes, apart, most)
            .into_iter()
            .flat_map(|rotation| [rotation, rotation + Angle::HALF_TURN])
            .collect();
        stages.done("rotation")?;
        let scale = self.cells_a_picture_cell(fixed, moving);
        let of_fixed = picture(&fixed.map, Angle::ZERO, scale);
        let found: Vec<Vec<Found>> = rotations
            .into_par_iter()
            .map(|rotation| {
                stages
                    .go_on()
                    .map(|()| self.translated(fixed, &of_fixed, moving, rotation, scale))
            })
            .collect::<Result<_, Reason>>()?;
        stages.done("translation")?;
        Ok(found.into_iter().flatten().collect())
    }

    /// How many cells the side of a picture's cell has: 1, or more where the padded picture would be too long.
    fn cells_a_picture_cell(&self, fixed: &Features, moving: &Features) -> f64 {
        let extent = 2.0 * (fixed.map.points.radius() + moving.map.points.radius());
        (extent / f64::from(self.params.side_max_cells)).max(1.0)
    }

    /// The poses of a rotation.
    fn translated(
        &self,
        fixed: &Features,
        of_fixed: &Plane,
        moving: &Features,
        rotation: Angle,
        scale: f64,
    ) -> Vec<Found> {
        let of_moving = picture(&moving.map, rotation, scale);
        let peaks = (
            self.params.translation_candidates as usize,
            self.params.translation_separation_cells as usize,
        );
        let turned: Point = Pose2::new(0.0, 0.0, rotation).apply(moving.map.points.center);
        let (center, cell) = (fixed.map.points.center, fixed.map.cell());
        best_shifts(&self.planner, of_fixed, &of_moving, self.params.translation, peaks)
            .into_iter()
            .map(|shift| {
                // the pictures are about the centres of the maps' occupied boxes
                let [x, y] = [0, 1].map(|k| (center[k] + shift.by[k] * scale - turned[k]) * cell);
                Found::from(Pose2::new(x, y, rotation))
            })
            .collect()
    }
}

/// The occupied cells of a map that is rotated about the centre of its occupied box. They are turned before they are drawn: a
/// turned picture has holes.
fn picture(map: &Map, rotation: Angle, scale: f64) -> Plane {
    let motion = Pose2::new(0.0, 0.0, rotation).motion();
    let points: Vec<Point> = (map.points.local.iter())
        .map(|point| motion.rotate(point.map(f64::from)).map(|cells| cells / scale))
        .collect();
    Plane::of_points(&points)
}

impl Method for FourierHough {
    fn name(&self) -> MethodName {
        MethodName::FourierHough
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
            |fixed, moving, stages| self.search(fixed, moving, stages),
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
    magnitudes: Magnitudes,
}

impl Prepared for Features {
    type Params = FourierHoughParams;

    fn of(map: Map, params: &FourierHoughParams) -> Self {
        let image = HoughImage::new(&map.points, Directions::half_turn_of_rotated(Angle::ZERO), 1);
        Self {
            magnitudes: Magnitudes::new(&image, params.frequency_max),
            map,
        }
    }

    fn map(&self) -> &Map {
        &self.map
    }
}

#[cfg(test)]
mod tests;
