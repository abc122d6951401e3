//! What `hough-peaks` computes of one map alone.

use super::params::HoughPeaksParams;
use crate::geometry::Angle;
use crate::registration::methods::shared::hough_image::{Directions, HoughImage};
use crate::registration::methods::shared::map::{Map, Prepared};
use crate::registration::methods::shared::peaks::{Peak, local_peaks};
use crate::registration::methods::shared::spectrum::spectrum;

/// A map as the method sees it.
#[derive(Debug, Clone)]
pub(super) struct Features {
    pub(super) map: Map,
    /// h(theta) of the map's Hough image (eq. 22).
    pub(super) spectrum: Vec<f64>,
    /// Local peaks of the map's Hough image (eq. 20).
    pub(super) peaks: Vec<Peak>,
}

impl Prepared for Features {
    type Params = HoughPeaksParams;

    fn of(map: Map, params: &HoughPeaksParams) -> Self {
        let directions = Directions::half_turn_of_rotated(Angle::ZERO);
        // Departs from eq. 1, where a line is a bin wide: a strip of `line_width_cells`.
        let image = HoughImage::new(&map.points, directions, params.line_width_cells as usize);
        Self {
            spectrum: spectrum(&image, params.spectrum),
            peaks: local_peaks(&image, &params.peak_rule()),
            map,
        }
    }

    fn map(&self) -> &Map {
        &self.map
    }
}
