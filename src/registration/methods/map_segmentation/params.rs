//! The parameters of `map-segmentation`: unit, range, default and source of each.

use serde::{Deserialize, Serialize};

use crate::registration::methods::ParameterError;
use crate::registration::methods::shared::verification::{Disagreement, Rule};

/// All tuning constants of `map-segmentation`. "Section 6.2" and "Table 2" are those of Saeedi et al., which name the steps of
/// their earlier paper (2011) and no value; "ours" marks every value that is therefore chosen here. Cells are those of the coarser
/// of the two maps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapSegmentationParams {
    /// Metres of occupied cells that each map needs to be registered at all. Metres, 0 to 1000. Default 3 (ours).
    pub wall_min_m: f64,
    /// Canny: an edge next to a strong one is an edge from this gradient on. Grey levels (occupied 255, else 0) by Sobel,
    /// 1 to 1140. Default 60 (ours).
    pub edge_low: f64,
    /// Canny: an edge is one by itself from this gradient on. Likewise, 1 to 1140, at least `edge_low`. Default 150 (ours).
    pub edge_high: f64,
    /// Edges up to twice so far apart, such as the two sides of a wall, are smoothed into one line. Cells, 1 to 20.
    /// Default 3 (ours).
    pub smoothing_cells: u32,
    /// Radius of a segment, a disc of the map. Metres, 0.5 to 100. Default 4 (ours).
    pub segment_radius_m: f64,
    /// Distance of the segments' middles on a grid. Metres, 0.1 to 100. Default 2 (ours).
    pub segment_spacing_m: f64,
    /// Metres of thin line that a segment needs. Metres, 0 to 1000. Default 6 (ours).
    pub segment_lines_min_m: f64,
    /// At most so many segments of a map, those of most line. A number, 1 to 2000. Default 150 (ours).
    pub segments_max: u32,
    /// The histogram filter: so many pairs of segments, those of the most similar histograms, are matched. A number, 1 to
    /// 10000. Default 80 (ours).
    pub pairs_max: u32,
    /// No segment takes part in more of these pairs. A number, 1 to 1000. Default 4 (ours).
    pub pairs_per_segment: u32,
    /// The highest frequency of the histograms that are compared. Cycles a cell, 0.005 to 0.5. Default 0.1 (ours).
    pub frequency_max: f64,
    /// Rotations of each pair of segments that are matched, each with its half turn. A number, 1 to 8. Default 2 (ours).
    pub rotations: u32,
    /// A pair's rotation is replaced by one of the whole maps' within so much of it. Degrees, 0 to 20. Default 5 (ours: a
    /// segment alone tells it to a degree).
    pub snap_degrees: f64,
    /// Cells on a side that are one cell of the matching. Cells, 1 to 16. Default 1 (ours).
    pub matching_cells: u32,
    /// Poses on which most matches agree that are verified, no two alike. A number, 1 to 128. Default 1 (ours: with more, V
    /// prefers wrong poses of small overlap).
    pub hypotheses: u32,
    /// The verification index that an answer needs (eq. 34). A share, 0 to 1. Default 0.92 (Table 2).
    pub verification_threshold: f64,
    /// The overlap that an answer needs; V of a few cells means nothing. A share, 0 to 1. Default 0.1 (ours, as in
    /// `hough-peaks`).
    pub overlap_min: f64,
    /// Whether the best hypothesis is the answer even when its verification index is below the threshold. Default false.
    pub accept_unverified: bool,
}

impl Default for MapSegmentationParams {
    fn default() -> Self {
        Self {
            wall_min_m: 3.0,
            edge_low: 60.0,
            edge_high: 150.0,
            smoothing_cells: 3,
            segment_radius_m: 4.0,
            segment_spacing_m: 2.0,
            segment_lines_min_m: 6.0,
            segments_max: 150,
            pairs_max: 80,
            pairs_per_segment: 4,
            frequency_max: 0.1,
            rotations: 2,
            snap_degrees: 5.0,
            matching_cells: 1,
            hypotheses: 1,
            verification_threshold: 0.92,
            overlap_min: 0.1,
            accept_unverified: false,
        }
    }
}

impl MapSegmentationParams {
    /// Whether all lie within their ranges.
    ///
    /// # Errors
    /// [`ParameterError`] names the first that does not, its value and its limits.
    pub fn validate(&self) -> Result<(), ParameterError> {
        use ParameterError as P;
        let count = |field, value: u32, max, unit| P::check(field, f64::from(value), 1.0, max, unit);
        P::check("wall_min_m", self.wall_min_m, 0.0, 1000.0, "m")?;
        P::check("edge_low", self.edge_low, 1.0, 1140.0, "grey levels")?;
        P::check(
            "edge_high",
            self.edge_high,
            self.edge_low,
            1140.0,
            "grey levels, at least edge_low",
        )?;
        count("smoothing_cells", self.smoothing_cells, 20.0, "cells")?;
        P::check("segment_radius_m", self.segment_radius_m, 0.5, 100.0, "m")?;
        P::check("segment_spacing_m", self.segment_spacing_m, 0.1, 100.0, "m")?;
        P::check("segment_lines_min_m", self.segment_lines_min_m, 0.0, 1000.0, "m")?;
        count("segments_max", self.segments_max, 2000.0, "segments")?;
        count("pairs_max", self.pairs_max, 10_000.0, "pairs")?;
        count("pairs_per_segment", self.pairs_per_segment, 1000.0, "pairs")?;
        P::check("frequency_max", self.frequency_max, 0.005, 0.5, "cycles a cell")?;
        count("rotations", self.rotations, 8.0, "rotations")?;
        P::check("snap_degrees", self.snap_degrees, 0.0, 20.0, "degrees")?;
        count("matching_cells", self.matching_cells, 16.0, "cells")?;
        count("hypotheses", self.hypotheses, 128.0, "poses")?;
        self.rule().check()
    }

    /// When a hypothesis is accepted.
    pub(super) fn rule(&self) -> Rule {
        Rule {
            disagreement: Disagreement::KnownInBoth,
            threshold: self.verification_threshold,
            overlap_min: self.overlap_min,
            accept_unverified: self.accept_unverified,
        }
    }
}
