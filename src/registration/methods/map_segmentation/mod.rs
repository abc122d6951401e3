//! `map-segmentation`: S. Saeedi, L. Paull, M. Trentini, H. Li, "Multiple robot simultaneous localization and mapping" (2011),
//! reference 34 of their later paper, as its section 6.2 describes it.
//!
//! May import what the room `registration` may: `geometry`, `grid`, and the room's own types.
//!
//! **Convention.** The answer is `pose_fixed_moving`; `p_fixed = R(psi) p_moving + T`. The search moves the map of less
//! structure, so that an inverse pair has the inverse answer.
//!
//! **Method.** Of each map alone: thin lines from its walls and objects (`lines`: Canny edges, smoothed, thinned) and their segments
//! with histograms (`segments`). Of a pair, under these stage names:
//!
//! 1. `histogram filter`: the pairs of segments with the most similar histograms (`matching`);
//! 2. `segment matching`: each is matched by cross-correlation (`matching`); the poses on which most matches agree are kept;
//! 3. `verification`: the match of the greatest V is the answer when V reaches the threshold (eq. 33 and 34).
//!
//! **Shapes and units.** Cells and radians inside, metres and radians outside; pictures of the matching in cells of
//! `matching_cells`.
//!
//! **Cost.** Some passes over each map; some hundred two-dimensional transforms of the size of a segment; `hypotheses` times V.
//!
//! **Fails when** a building repeats itself: equal rooms are equal segments, and V cannot tell them apart; and in maps of little
//! structure, where no disc has lines enough.
//!
//! **Differences from the paper.** Section 6.2 names the steps in three sentences and no values. What it leaves open is ours: that
//! edges become lines by closing and thinning, that segments are discs, that the histogram is that of directions and distances made
//! independent of the motion, that the rotation is sharpened by the whole maps', that matches vote, and that several poses are
//! verified.

mod lines;
mod matching;
mod params;
mod segments;

pub use params::MapSegmentationParams;

use rayon::prelude::*;

use crate::geometry::{Angle, Point, Pose2};
use crate::grid::OccupancyGrid;
use crate::registration::methods::hough::fft::Planner;
use crate::registration::methods::shared::hough_image::{Directions, HoughImage, WallPoints};
use crate::registration::methods::shared::magnitudes::{Magnitudes, rotations};
use crate::registration::methods::shared::map::{Map, Prepared};
use crate::registration::methods::shared::search::{Found, Order, Question, Stages, register};
use crate::registration::methods::{Method, MethodName, ParameterError};
use crate::registration::overlap::StateMap;
use crate::registration::{Control, MapFeatures, Reason, Registration};
use lines::thin_lines;
use matching::{Match, matches, similar_pairs};
use segments::{Segment, segments};

/// Rotations of the whole maps that a segment's may be snapped to.
const WHOLE_ROTATIONS: usize = 8;
/// Two of them are at least so far apart, degrees.
const WHOLE_APART_DEGREES: f64 = 6.0;
/// Matches that lay the moving map no farther apart than this are alike, metres.
const ALIKE_M: f64 = 0.5;

/// The method with checked parameters.
pub struct MapSegmentation {
    params: MapSegmentationParams,
    planner: Planner,
}

impl MapSegmentation {
    /// The method with these parameters.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that is out of range, its value and its limits.
    pub fn new(params: MapSegmentationParams) -> Result<Self, ParameterError> {
        params.validate().map(|()| Self {
            params,
            planner: Planner::new(),
        })
    }

    fn search(&self, fixed: &Features, moving: &Features, stages: &mut Stages<'_>) -> Result<Vec<Found>, Reason> {
        let params = &self.params;
        let pairs = similar_pairs(&fixed.segments, &moving.segments, params);
        stages.done("histogram filter")?;
        let whole = rotations(
            &fixed.magnitudes,
            &moving.magnitudes,
            WHOLE_APART_DEGREES,
            WHOLE_ROTATIONS,
        );
        let radius = params.segment_radius_m / fixed.map.cell();
        let found: Vec<Vec<Match>> = pairs
            .into_par_iter()
            .map(|(i, j)| {
                let (one, other) = ((&fixed.segments[i], &fixed.lines[..]), &moving.segments[j]);
                stages
                    .go_on()
                    .map(|()| matches(&self.planner, one, other, &whole, radius, params))
            })
            .collect::<Result<_, Reason>>()?;
        let kept = agreed(
            &found.concat(),
            &moving.map,
            fixed.map.cell(),
            params.hypotheses as usize,
        );
        stages.done("segment matching")?;
        Ok(kept.into_iter().map(Found::from).collect())
    }
}

/// The poses on which most matches agree, by the sum of their shares of matching line, no two alike. A segment alone often finds
/// line enough in a wrong place; several seldom find the same one.
fn agreed(found: &[Match], moving: &Map, cell: f64, most: usize) -> Vec<Pose2> {
    let poses: Vec<(Pose2, f64)> = found
        .iter()
        .map(|Match { motion, share }| (Pose2::new(motion.x() * cell, motion.y() * cell, motion.yaw()), *share))
        .collect();
    let alike = |one: Pose2, other: Pose2| moving.distance_between(one, other) <= ALIKE_M;
    let votes: Vec<f64> = poses
        .par_iter()
        .map(|(pose, _)| {
            poses
                .iter()
                .filter(|(other, _)| alike(*pose, *other))
                .map(|(_, share)| share)
                .sum()
        })
        .collect();
    let mut order: Vec<usize> = (0..poses.len()).collect();
    order.sort_by(|a, b| votes[*b].total_cmp(&votes[*a])); // stable: of equal ones that of the more similar segments
    let mut kept: Vec<Pose2> = Vec::new();
    for index in order {
        if kept.len() == most {
            break;
        }
        if !kept.iter().any(|other| alike(poses[index].0, *other)) {
            kept.push(poses[index].0);
        }
    }
    kept
}

impl Method for MapSegmentation {
    fn name(&self) -> MethodName {
        MethodName::MapSegmentation
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
    /// The cells of its thin lines, in cells in the map's frame.
    lines: Vec<Point>,
    /// Of all its lines.
    magnitudes: Magnitudes,
    segments: Vec<Segment>,
}

impl Prepared for Features {
    type Params = MapSegmentationParams;

    fn of(map: Map, params: &MapSegmentationParams) -> Self {
        let lines = thin_lines(&map, params);
        let points = WallPoints::about_center(&lines);
        let image = HoughImage::new(&points, Directions::half_turn_of_rotated(Angle::ZERO), 1);
        Self {
            magnitudes: Magnitudes::new(&image, params.frequency_max),
            segments: segments(&lines, map.cell(), params),
            lines,
            map,
        }
    }

    fn map(&self) -> &Map {
        &self.map
    }
}

#[cfg(test)]
mod tests;
