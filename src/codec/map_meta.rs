//! What a map file says besides its picture.

use super::CodecError;
use crate::geometry::Pose2;
use crate::grid::{Lattice, LogOdds};

/// How grey values become occupancies (`mode` of `map_server`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MapMode {
    /// Occupied above `occupied_thresh`, free below `free_thresh`, else unknown.
    #[default]
    Trinary,
    /// As trinary, but between the thresholds the occupancy rises in a straight line from 0 to 100 %.
    Scale,
    /// The grey value is the occupancy in percent; above 100 unknown.
    Raw,
}

/// What a map file says besides its picture.
///
/// Invariants: resolution and origin within [`Lattice`]'s limits, `0 <= free_thresh < occupied_thresh <= 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapMeta {
    resolution: f64,
    origin: Pose2,
    negate: bool,
    occupied_thresh: f64,
    free_thresh: f64,
    mode: MapMode,
}

impl MapMeta {
    /// Trinary, not negated, with the thresholds 0.65 and 0.196.
    ///
    /// # Errors
    /// When resolution or origin is out of [`Lattice`]'s range.
    pub fn new(resolution: f64, origin: Pose2) -> Result<Self, CodecError> {
        Lattice::new(1, 1, resolution, origin)?;
        Ok(Self {
            resolution,
            origin,
            negate: false,
            occupied_thresh: LogOdds::OCCUPIED_MIN,
            free_thresh: LogOdds::FREE_MAX,
            mode: MapMode::default(),
        })
    }

    /// With other thresholds.
    ///
    /// # Errors
    /// Unless `0 <= free_thresh < occupied_thresh <= 1`.
    pub fn with_thresholds(self, free_thresh: f64, occupied_thresh: f64) -> Result<Self, CodecError> {
        let range = "within 0 and 1";
        if !(0.0..=1.0).contains(&occupied_thresh) {
            return Err(CodecError::bad_field("occupied_thresh", occupied_thresh, range));
        }
        if !(0.0..=1.0).contains(&free_thresh) {
            return Err(CodecError::bad_field("free_thresh", free_thresh, range));
        }
        if free_thresh >= occupied_thresh {
            let expected = format!("below occupied_thresh, which is {occupied_thresh}");
            return Err(CodecError::bad_field("free_thresh", free_thresh, expected));
        }
        Ok(Self {
            occupied_thresh,
            free_thresh,
            ..self
        })
    }

    /// With another mode.
    #[must_use]
    pub fn with_mode(self, mode: MapMode) -> Self {
        Self { mode, ..self }
    }

    /// With white for occupied when `negate`.
    #[must_use]
    pub fn with_negate(self, negate: bool) -> Self {
        Self { negate, ..self }
    }

    /// Side of a cell in metres.
    #[must_use]
    pub fn resolution(&self) -> f64 {
        self.resolution
    }

    /// Pose of the lower-left corner of the lower-left pixel in the map's frame.
    #[must_use]
    pub fn origin(&self) -> Pose2 {
        self.origin
    }

    /// Whether white means occupied.
    #[must_use]
    pub fn negate(&self) -> bool {
        self.negate
    }

    /// Occupied above this.
    #[must_use]
    pub fn occupied_thresh(&self) -> f64 {
        self.occupied_thresh
    }

    /// Free below this.
    #[must_use]
    pub fn free_thresh(&self) -> f64 {
        self.free_thresh
    }

    /// What grey values mean.
    #[must_use]
    pub fn mode(&self) -> MapMode {
        self.mode
    }
}
