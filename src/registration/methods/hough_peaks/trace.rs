//! What the pipeline sees on its way, for people to look at: Hough images, spectra, correlations, peaks, and the objective
//! of the translation's search. Nothing here decides anything; every value comes from the stage that the pipeline itself
//! runs.
//!
//! Lengths are cells, votes are occupied cells on a line, as in the stages.

use super::features::Features;
use super::params::{HoughPeaksParams, PsiHat, Spectrum};
use super::psi_hat::psi_hat;
use super::rotation_tuning::tuned_rotation;
use super::search::matched;
use super::spectrum::{RotationCandidate, rotation_candidates};
use super::translation_tuning::surface;
use super::{HoughPeaks, translation_tuning};
use crate::geometry::{Angle, Point, Pose2};
use crate::grid::OccupancyGrid;
use crate::registration::methods::shared::correlation::circular_correlation;
use crate::registration::methods::shared::hough_image::{COLUMNS, Directions, HoughImage, WallPoints};
use crate::registration::methods::shared::map::{Map, Prepared};
use crate::registration::methods::shared::peaks::local_peaks;
use crate::registration::methods::shared::spectrum::spectrum;
use crate::registration::overlap::StateMap;

/// A Hough image over half a turn (eq. 1), a column a degree from -90 degrees on.
#[derive(Debug, Clone, PartialEq)]
pub struct HoughView {
    /// Where rho is 0: cells in the map's frame.
    pub center: Point,
    image: HoughImage,
}

/// A local peak of a Hough image (eq. 20).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeakView {
    /// Direction of the line's normal, in [-90, 90) degrees.
    pub theta: Angle,
    /// Distance of the line from the image's centre, in cells.
    pub rho: f64,
    /// Votes.
    pub votes: f64,
}

impl HoughView {
    /// The image of a map's occupied cells; `line_width` is the odd number of bins that are added to one.
    #[must_use]
    pub fn of_map(map: &OccupancyGrid, line_width: u32) -> Self {
        let points = WallPoints::new(&StateMap::new(map));
        Self::new(&points, Angle::ZERO, line_width)
    }

    /// The image of points in cells, rho told about `center`, wide enough for lines up to `radius` cells from it.
    #[must_use]
    pub fn of_points(points: &[Point], center: Point, radius: f64, line_width: u32) -> Self {
        Self::new(&WallPoints::about(points, center, radius), Angle::ZERO, line_width)
    }

    fn new(points: &WallPoints, rotation: Angle, line_width: u32) -> Self {
        let directions = Directions::half_turn_of_rotated(rotation);
        Self {
            center: points.center,
            image: HoughImage::new(points, directions, line_width as usize),
        }
    }

    /// Columns: one a degree.
    #[must_use]
    pub fn columns(&self) -> usize {
        COLUMNS
    }

    /// Bins of a column, each a cell wide.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.image.bins()
    }

    /// Votes of one column, by rising rho.
    ///
    /// # Panics
    /// When there is no such column.
    #[must_use]
    pub fn column(&self, column: usize) -> &[u32] {
        self.image.column(column)
    }

    /// rho of a bin's middle, in cells.
    #[must_use]
    pub fn rho_of(&self, bin: usize) -> f64 {
        self.image.rho_of(bin)
    }

    /// Direction of a column.
    #[must_use]
    pub fn theta_of(column: usize) -> Angle {
        Directions::of_column(column)
    }

    /// The local peaks, the strongest first (eq. 20).
    #[must_use]
    pub fn peaks(&self, params: &HoughPeaksParams) -> Vec<PeakView> {
        local_peaks(&self.image, &params.peak_rule())
            .into_iter()
            .map(|peak| PeakView {
                theta: Directions::of_column(peak.column),
                rho: peak.rho,
                votes: peak.votes,
            })
            .collect()
    }

    /// h(theta) by `f` (eq. 22), a value a column.
    #[must_use]
    pub fn spectrum(&self, f: Spectrum) -> Vec<f64> {
        spectrum(&self.image, f)
    }
}

/// How one f finds the rotation (eq. 22 to 25).
#[derive(Debug, Clone, PartialEq)]
pub struct SpectrumTrace {
    /// f.
    pub f: Spectrum,
    /// h of the fixed map, a value a column.
    pub fixed: Vec<f64>,
    /// h of the moving map.
    pub moving: Vec<f64>,
    /// Circular cross-correlation (eq. 24): entry k belongs to a rotation of k degrees, and to k + 180.
    pub correlation: Vec<f64>,
    /// Its local maxima (eq. 25) in (-90, 90] degrees, the greatest first; each stands for itself and its half turn.
    pub candidates: Vec<Angle>,
}

/// The first half of the pipeline, for people to look at (Algorithm 1).
#[derive(Debug, Clone, PartialEq)]
pub struct RotationTrace {
    /// By f: max, mean of non-zeros, entropy.
    pub spectra: Vec<SpectrumTrace>,
    /// psi-hat by the circular mean; `None` when no peaks are associated.
    pub psi_hat_circular: Option<Angle>,
    /// psi-hat by line 11 as printed.
    pub psi_hat_tangents: Option<Angle>,
}

/// One shift of the exhaustive search (eq. 32).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Objective {
    /// Cells along the axes of the fixed map's lattice.
    pub shift: [i32; 2],
    /// Entropy of the fused map in bits (eq. 31).
    pub entropy: f64,
    /// V (eq. 34) over the cells known in both; `None` where the overlap is below its least.
    pub verification_index: Option<f64>,
    /// V over the cells known in at least one map: the paper's words for `dis` (eq. 33).
    pub verification_index_over_union: Option<f64>,
}

/// The second half of the pipeline at one rotation, for people to look at (Algorithm 2).
#[derive(Debug, Clone, PartialEq)]
pub struct TranslationTrace {
    /// The fixed map's image.
    pub fixed: HoughView,
    /// The image of the moving map rotated.
    pub moving: HoughView,
    /// Peaks of the fixed map.
    pub fixed_peaks: Vec<PeakView>,
    /// Peaks of the rotated moving map.
    pub moving_peaks: Vec<PeakView>,
    /// Walls that were associated.
    pub associated: usize,
    /// `T_o` (eq. 30) in cells; `None` when the walls do not hold it.
    pub approximate: Option<Point>,
    /// All shifts around `T_o`; empty without one.
    pub objective: Vec<Objective>,
    /// The pose after tuning; `None` without `T_o`.
    pub tuned: Option<Pose2>,
}

impl HoughPeaks {
    /// Spectra, correlations and candidates by every f, and psi-hat in both readings.
    #[must_use]
    pub fn rotation_trace(&self, fixed: &OccupancyGrid, moving: &OccupancyGrid) -> RotationTrace {
        let (fixed, moving) = self.both(fixed, moving);
        let width = self.params.line_width_cells;
        let views = [&fixed, &moving].map(|map| HoughView::new(&map.map.points, Angle::ZERO, width));
        let spectra = [Spectrum::Max, Spectrum::MeanOfNonZeros, Spectrum::Entropy]
            .into_iter()
            .map(|f| {
                let [of_fixed, of_moving] = [0, 1].map(|k: usize| views[k].spectrum(f));
                SpectrumTrace {
                    f,
                    correlation: circular_correlation(&of_fixed, &of_moving),
                    candidates: rotation_candidates(&of_fixed, &of_moving, &self.params),
                    fixed: of_fixed,
                    moving: of_moving,
                }
            })
            .collect();
        let by = |reading| {
            let params = HoughPeaksParams {
                psi_hat: reading,
                ..self.params.clone()
            };
            psi_hat(&fixed.peaks, &moving.peaks, &params)
        };
        RotationTrace {
            spectra,
            psi_hat_circular: by(PsiHat::CircularMean),
            psi_hat_tangents: by(PsiHat::MeanOfTangents),
        }
    }

    /// A candidate rotation after tuning (eq. 27), by this pipeline's `rotation_tuning`.
    #[must_use]
    pub fn tuned_rotation(&self, fixed: &OccupancyGrid, moving: &OccupancyGrid, candidate: Angle) -> Angle {
        let (fixed, moving) = self.both(fixed, moving);
        let spectra = (&fixed.spectrum[..], &moving.spectrum[..]);
        tuned_rotation(
            candidate,
            (&fixed.map.points, &moving.map.points),
            spectra,
            &self.params,
        )
    }

    /// Peaks, `T_o` and the search around it at a rotation of the moving map.
    #[must_use]
    pub fn translation_trace(
        &self,
        fixed: &OccupancyGrid,
        moving: &OccupancyGrid,
        rotation: Angle,
    ) -> TranslationTrace {
        let (fixed, moving) = self.both(fixed, moving);
        let candidate = RotationCandidate {
            rotation,
            half_turns: vec![false],
        };
        let hypotheses = matched(&candidate, &fixed, &moving, &self.params);
        let fit = &hypotheses.first().expect("invariant: one half turn was asked for").fit;
        let cell = fixed.map.cell();
        let pose = fit.translation.map(|[x, y]| Pose2::new(x * cell, y * cell, rotation));
        let views = [(&fixed, Angle::ZERO), (&moving, rotation)];
        let [of_fixed, of_moving] =
            views.map(|(map, turn)| HoughView::new(&map.map.points, turn, self.params.line_width_cells));
        TranslationTrace {
            fixed_peaks: of_fixed.peaks(&self.params),
            moving_peaks: of_moving.peaks(&self.params),
            fixed: of_fixed,
            moving: of_moving,
            associated: fit.associated,
            approximate: fit.translation,
            objective: pose.map_or(Vec::new(), |pose| {
                surface(&fixed.map.states, &moving.map.states, pose, &self.params)
            }),
            tuned: pose.map(|pose| {
                translation_tuning::tuned_translation(&fixed.map.states, &moving.map.states, pose, &self.params)
            }),
        }
    }

    /// The objective of the search around any pose (eq. 31 to 34).
    #[must_use]
    pub fn objective_around(
        &self,
        fixed: &OccupancyGrid,
        moving: &OccupancyGrid,
        pose_fixed_moving: Pose2,
    ) -> Vec<Objective> {
        let [fixed, moving] = [fixed, moving].map(StateMap::new);
        surface(&fixed, &moving, pose_fixed_moving, &self.params)
    }

    /// The features of two maps in cells of one size.
    fn both(&self, fixed: &OccupancyGrid, moving: &OccupancyGrid) -> (Features, Features) {
        let [fixed, moving] = [fixed, moving].map(|map| Features::of(Map::new(StateMap::new(map)), &self.params));
        let cell = fixed.map.cell().max(moving.map.cell());
        let of_one_cell = |map: &Features| map.at_cell(cell, &self.params).into_owned();
        (of_one_cell(&fixed), of_one_cell(&moving))
    }
}
