//! `hough-spectrum`: S. Carpin, "Fast and accurate map merging for multi-robot systems" (2008), as Saeedi et al. describe it
//! in their section 6.2.
//!
//! May import what the room `registration` may: `geometry`, `grid`, and the room's own types.
//!
//! **Convention.** The answer is `pose_fixed_moving`; `p_fixed = R(psi) p_moving + T`. The search moves the map of less
//! structure, so that an inverse pair has the inverse answer.
//!
//! **Method.** Of each map alone the Hough spectrum, of a pair under these stage names:
//!
//! 1. `rotation candidates`: `HS(theta) = sum over rho of H(theta, rho)^2` (Carpin's spectrum, after Censi et al.); the local
//!    maxima of the circular cross-correlation `CC(psi) = sum over theta of HS_fixed(theta) HS_moving(theta - psi)`, all of
//!    them, each with its half turn and the rotations beside it;
//! 2. `projections`: for each the moving map is rotated; `P_x(x)` counts its occupied cells in column x, `P_y(y)` in row y:
//!    these are the columns of its Hough image at 0 and 90 degrees. The maximum of the correlation of the two maps' `P_x` is
//!    the translation along x, that of `P_y` along y;
//! 3. `verification`: the hypothesis of the greatest V is the answer when V reaches the threshold (eq. 33 and 34; Carpin's
//!    acceptance indicator is the same ratio).
//!
//! **Shapes and units.** Cells and radians inside, metres and radians outside. 180 columns of a degree; projections in bins
//! of a cell.
//!
//! **Cost.** 180 columns times occupied cells a map; for each of `2 * rotation_candidates * (2 * rotations_around + 1)`
//! hypotheses two columns, two one-dimensional transforms and one V, which takes most of the time: a pass over the known
//! cells of the smaller map.
//!
//! **Fails when** the maps overlap in part: projections add up all that a map shows, so that their correlation prefers the
//! shift which covers most of both maps. Measured figures are in `docs/methods.md`.
//!
//! **Differences from the paper.** A spectrum has period 180 degrees, so each candidate stands for two rotations. Rotations and
//! translations are read between the bins by a parabola; Carpin stays on whole degrees and cells. The least overlap.

mod params;

pub use params::HoughSpectrumParams;

use rayon::prelude::*;

use crate::geometry::{Angle, Point, Pose2};
use crate::grid::OccupancyGrid;
use crate::registration::methods::shared::correlation::{
    circular_correlation, circular_maxima, circular_offset, greatest, linear_correlation, parabola_offset, rotation_of,
};
use crate::registration::methods::shared::hough_image::{Directions, HoughImage, WallPoints, to_f64};
use crate::registration::methods::shared::map::{Map, Prepared};
use crate::registration::methods::shared::search::{Found, Order, Question, Stages, register};
use crate::registration::methods::shared::spectrum::{Spectrum, spectrum};
use crate::registration::methods::{Method, MethodName, ParameterError};
use crate::registration::overlap::StateMap;
use crate::registration::{Control, MapFeatures, Reason, Registration};

/// Carpin's method with checked parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct HoughSpectrum {
    params: HoughSpectrumParams,
}

impl HoughSpectrum {
    /// The method with these parameters.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that is out of range, its value and its limits.
    pub fn new(params: HoughSpectrumParams) -> Result<Self, ParameterError> {
        params.validate().map(|()| Self { params })
    }
}

impl Method for HoughSpectrum {
    fn name(&self) -> MethodName {
        MethodName::HoughSpectrum
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
    /// HS(theta).
    spectrum: Vec<f64>,
    /// `P_x` and `P_y` of the map as it lies.
    projections: [Vec<f64>; 2],
}

impl Prepared for Features {
    type Params = HoughSpectrumParams;

    fn of(map: Map, _: &HoughSpectrumParams) -> Self {
        let image = HoughImage::new(&map.points, Directions::half_turn_of_rotated(Angle::ZERO), 1);
        Self {
            spectrum: spectrum(&image, Spectrum::SumOfSquares),
            projections: projections(&map.points, Angle::ZERO),
            map,
        }
    }

    fn map(&self) -> &Map {
        &self.map
    }
}

/// `P_x` and `P_y` of a map that is rotated about the centre of its occupied box: the columns of its Hough image at 0 and 90
/// degrees, in bins of a cell, the centre in the middle.
fn projections(points: &WallPoints, rotation: Angle) -> [Vec<f64>; 2] {
    let axes = Directions {
        first: -rotation.radians(),
        step: Angle::QUARTER_TURN.radians(),
        count: 2,
    };
    let image = HoughImage::new(points, axes, 1);
    [0, 1].map(|axis| image.column(axis).iter().map(|votes| f64::from(*votes)).collect())
}

fn search(
    fixed: &Features,
    moving: &Features,
    stages: &mut Stages<'_>,
    params: &HoughSpectrumParams,
) -> Result<Vec<Found>, Reason> {
    let rotations = rotations(&fixed.spectrum, &moving.spectrum, params);
    stages.done("rotation candidates")?;
    let pose = |rotation: Angle| {
        stages
            .go_on()
            .map(|()| Found::from(translated(fixed, moving, rotation)))
    };
    let found = rotations.into_par_iter().map(pose).collect::<Result<_, Reason>>()?;
    stages.done("projections")?;
    Ok(found)
}

/// All rotations that are tried, those of the greatest correlation first.
fn rotations(fixed: &[f64], moving: &[f64], params: &HoughSpectrumParams) -> Vec<Angle> {
    let correlation = circular_correlation(fixed, moving);
    let (apart, most) = (params.candidate_separation_degrees, params.rotation_candidates as usize);
    let around = i32::try_from(params.rotations_around).expect("invariant: at most 8");
    circular_maxima(&correlation, apart, most)
        .into_iter()
        .map(|at| rotation_of(to_f64(at) + circular_offset(&correlation, at)))
        .flat_map(|rotation| [rotation, rotation + Angle::HALF_TURN])
        .flat_map(|rotation| {
            (-around..=around)
                .map(move |step| rotation + Angle::from_degrees(f64::from(step) * params.rotation_step_degrees))
        })
        .collect()
}

/// The pose of a rotation: the projections of the rotated moving map shifted to where they correlate most.
fn translated(fixed: &Features, moving: &Features, rotation: Angle) -> Pose2 {
    let of_moving = projections(&moving.map.points, rotation);
    let [x, y] = [0, 1].map(|axis| shift(&fixed.projections[axis], &of_moving[axis]));
    let cell = fixed.map.cell();
    let [fixed_x, fixed_y] = fixed.map.points.center;
    let turned: Point = Pose2::new(0.0, 0.0, rotation).apply(moving.map.points.center);
    Pose2::new(
        (fixed_x + x - turned[0]) * cell,
        (fixed_y + y - turned[1]) * cell,
        rotation,
    )
}

/// How far in cells the moving projection must be shifted, both told about their middles.
fn shift(fixed: &[f64], moving: &[f64]) -> f64 {
    let correlation = linear_correlation(fixed, moving);
    let at = greatest(&correlation);
    let lag = to_f64(at) + parabola_offset(&correlation, at) - to_f64(moving.len() - 1);
    lag + to_f64(moving.len() / 2) - to_f64(fixed.len() / 2)
}

#[cfg(test)]
mod tests;
