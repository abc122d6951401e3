//! From the samples of a pixel to the log odds of a cell, by the rules of ROS `map_server`.

use super::super::{CodecError, Limits, MapMeta, MapMode, Warning};
use crate::grid::{CellState, LogOdds};

/// The grey that map savers write for unknown cells, as a share of white.
const UNKNOWN_GREY: f64 = 205.0 / 255.0;

/// The log odds of a cell whose pixel has this shade (0 black, 1 white).
fn cell_of_shade(shade: f64, meta: &MapMeta) -> LogOdds {
    let occupancy = if meta.negate() { shade } else { 1.0 - shade };
    let (free, occupied) = (meta.free_thresh(), meta.occupied_thresh());
    match meta.mode() {
        MapMode::Trinary | MapMode::Scale if occupancy > occupied => LogOdds::OCCUPIED,
        MapMode::Trinary | MapMode::Scale if occupancy < free => LogOdds::FREE,
        MapMode::Trinary => LogOdds::UNKNOWN,
        // map_server rounds to whole percents, because its messages hold no more
        MapMode::Scale => of_percent(((occupancy - free) / (occupied - free) * 100.0).round_ties_even()),
        MapMode::Raw => of_percent((shade * 255.0).round()),
    }
}

fn of_percent(percent: f64) -> LogOdds {
    if (0.0..=100.0).contains(&percent) {
        LogOdds::from_probability(percent / 100.0)
    } else {
        LogOdds::UNKNOWN
    }
}

/// The cell for every sum of colour samples that a pixel can have: looked up, not computed, pixel by pixel.
pub(super) struct ShadeTable {
    cells: Vec<LogOdds>,
    /// What `map_server` would read with alpha averaged in; only where it matters.
    averaged: Option<Vec<LogOdds>>,
    /// The sum that is [`UNKNOWN_GREY`], when that reads as free.
    unknown_grey: Option<usize>,
    /// Largest sample.
    pub(super) max: u16,
}

impl ShadeTable {
    /// For pixels of `colours` samples within 0..=`max`.
    pub(super) fn new(meta: &MapMeta, colours: u16, max: u16, has_alpha: bool) -> Self {
        let white = u32::from(colours) * u32::from(max);
        let table = |extra: u32| -> Vec<LogOdds> {
            let all = f64::from(white + extra);
            (0..=white)
                .map(|sum| cell_of_shade(f64::from(sum + extra) / all, meta))
                .collect()
        };
        let trinary = meta.mode() == MapMode::Trinary;
        let reads_free = trinary && cell_of_shade(UNKNOWN_GREY, meta).state() == CellState::Free;
        Self {
            cells: table(0),
            // grey samples stand for three equal colours in the mean of four
            averaged: (trinary && has_alpha).then(|| table(white / 3)),
            unknown_grey: (reads_free && white.is_multiple_of(255)).then_some(white as usize / 255 * 205),
            max,
        }
    }
}

/// The cells of a picture, filled from its first pixel on; its first row is the top one.
pub(super) struct Pixels {
    width: u32,
    height: u32,
    cells: Vec<LogOdds>,
    unknown_reads_free: usize,
    not_averaged: usize,
    free_thresh: f64,
}

impl Pixels {
    /// Room for a picture of this size, if the limits and the machine allow it.
    pub(super) fn new(width: u32, height: u32, meta: &MapMeta, limits: &Limits) -> Result<Self, CodecError> {
        let count = limits.check_cells(width, height)?;
        let mut cells = Vec::new();
        cells
            .try_reserve_exact(count)
            .map_err(|reason| CodecError::NoMemory { cells: count, reason })?;
        Ok(Self {
            width,
            height,
            cells,
            unknown_reads_free: 0,
            not_averaged: 0,
            free_thresh: meta.free_thresh(),
        })
    }

    /// The next pixels, all opaque: the sums of their colour samples.
    pub(super) fn extend(&mut self, table: &ShadeTable, sums: impl Iterator<Item = usize> + Clone) {
        self.cells.extend(sums.clone().map(|sum| table.cells[sum]));
        if let Some(grey) = table.unknown_grey {
            self.unknown_reads_free += sums.filter(|&sum| sum == grey).count();
        }
    }

    /// The next pixel of a picture with alpha: the sum of its colour samples, and whether nothing shines through.
    pub(super) fn push(&mut self, table: &ShadeTable, sum: usize, opaque: bool) {
        if !opaque {
            self.cells.push(LogOdds::UNKNOWN);
            return;
        }
        self.extend(table, std::iter::once(sum));
        if let Some(averaged) = &table.averaged {
            self.not_averaged += usize::from(averaged[sum] != table.cells[sum]);
        }
    }

    /// Width, height, cells from the top row on, and what is odd about them.
    pub(super) fn finish(self) -> (u32, u32, Vec<LogOdds>, Vec<Warning>) {
        let mut warnings = Vec::new();
        if self.unknown_reads_free > 0 {
            warnings.push(Warning::UnknownReadsFree {
                cells: self.unknown_reads_free,
                free_thresh: self.free_thresh,
            });
        }
        if self.not_averaged > 0 {
            warnings.push(Warning::AlphaNotAveraged {
                cells: self.not_averaged,
            });
        }
        (self.width, self.height, self.cells, warnings)
    }
}
