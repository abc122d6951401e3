//! All that is told of the pair, and what is asked of it.

use crate::experiments::rotations::apart_modulo_half_turn;
use crate::geometry::{Angle, Pose2};
use crate::grid::OccupancyGrid;
use crate::registration::methods::hough_peaks::{Objective, RotationTrace, Spectrum, TranslationTrace};
/// All that is told of the pair.
pub(super) struct Step<'a> {
    pub(super) fixed: &'a OccupancyGrid,
    pub(super) moving: &'a OccupancyGrid,
    pub(super) truth: Pose2,
    pub(super) rotations: &'a RotationTrace,
    pub(super) trace: &'a TranslationTrace,
    pub(super) found: Option<Pose2>,
}

pub(super) fn name_of(f: Spectrum) -> &'static str {
    match f {
        Spectrum::Max => "max",
        Spectrum::MeanOfNonZeros => "mean of non-zeros",
        Spectrum::Entropy => "entropy",
        Spectrum::SumOfSquares => "sum of squares",
    }
}

pub(super) fn degrees(angle: Option<Angle>) -> String {
    angle.map_or("none".to_owned(), |angle| format!("{:.1} deg", angle.degrees()))
}

/// How far the best candidate of a list is from a rotation, modulo half a turn, in degrees.
pub(super) fn off(candidate: Option<&Angle>, rotation: Angle) -> f64 {
    candidate.map_or(f64::NAN, |c| apart_modulo_half_turn(*c, rotation))
}

impl Step<'_> {
    pub(super) fn cell(&self) -> f64 {
        self.fixed.lattice().resolution()
    }

    /// Translations of the truth and of `T_o` in cells, about the frames' origins.
    pub(super) fn in_cells(&self, pose: Pose2) -> [f64; 2] {
        [pose.x() / self.cell(), pose.y() / self.cell()]
    }

    /// The shift of the search that minimises `value`.
    pub(super) fn best(&self, value: impl Fn(&Objective) -> Option<f64>) -> Option<Objective> {
        let valued = self.trace.objective.iter().filter_map(|o| value(o).map(|v| (v, *o)));
        let distance = |o: &Objective| o.shift[0].pow(2) + o.shift[1].pow(2);
        valued
            .min_by(|a, b| a.0.total_cmp(&b.0).then(distance(&a.1).cmp(&distance(&b.1))))
            .map(|(_, objective)| objective)
    }

    /// Where the truth lies in the search, in cells from `T_o`; the search's axes are those of the fixed map's lattice.
    pub(super) fn truth_in_search(&self) -> Option<[f64; 2]> {
        let [x, y] = self.trace.approximate?;
        let [tx, ty] = self.in_cells(self.truth);
        let axes = Pose2::new(0.0, 0.0, -self.fixed.lattice().origin().yaw());
        Some(axes.apply([tx - x, ty - y]))
    }
}
