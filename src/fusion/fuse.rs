//! Placed maps added up into one.
//!
//! Method
//! 1. The common lattice lies in the anchor's frame, axis-aligned with that FRAME (origin yaw 0, as Nav2 expects). Its
//!    cells are the anchor's own where the anchor's origin has no yaw and the resolution is the anchor's: the anchor is
//!    then never resampled. It covers the anchor's lattice and all known cells of the other maps.
//! 2. Every map is seen on it under its pose (`grid::Sampler`).
//! 3. The log odds of each cell are added (paper eq. 14), as whole numbers, and clamped once: the result depends neither
//!    on the order of the maps nor on the number of threads.
//!
//! Cost: one pass over each map and one over its part of the common lattice, in parallel by rows. Memory: the fused map,
//! 2 bytes a cell; with conflicts 2 bytes a cell more, and a byte for each cell of the maps.

use rayon::prelude::*;

use super::conflicts::{Conflicts, Votes, Word, words};
use crate::geometry::{Point, Pose2};
use crate::grid::{Lattice, LatticeError, LogOdds, LogOddsSum, OccupancyGrid, Sampler};

/// A map and where it lies.
#[derive(Debug, Clone, Copy)]
pub struct PlacedMap<'a> {
    /// The map.
    pub grid: &'a OccupancyGrid,
    /// Pose of the map's frame in the anchor map's frame; the identity for the anchor itself.
    pub pose_anchor_map: Pose2,
}

/// How maps are added up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FuseOptions {
    /// Resolution of the fused map in m/cell; the anchor's own when `None` (default).
    pub resolution: Option<f64>,
    /// The most cells that the fused map may have. Default 4e8, which is 0.8 GB.
    pub cells_max: u64,
    /// Whether to find the cells that the maps contradict. Default true.
    pub conflicts: bool,
    /// A map's free cells this near to its own walls contradict nobody, in metres. Default 0.1: two cells of most maps,
    /// more than a good pose is off.
    pub conflict_tolerance_m: f64,
}

impl Default for FuseOptions {
    fn default() -> Self {
        Self {
            resolution: None,
            cells_max: 400_000_000,
            conflicts: true,
            conflict_tolerance_m: 0.1,
        }
    }
}

/// The fused map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fused {
    /// The map, in the anchor's frame; its origin has no yaw.
    pub grid: OccupancyGrid,
    /// Which cells the maps contradict, when asked for.
    pub conflicts: Option<Conflicts>,
}

/// Why maps cannot be added up.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FuseError {
    /// The common lattice has more cells than allowed.
    #[error(
        "the fused map would have {width} x {height} cells of {resolution} m, which is over the limit of {limit} cells"
    )]
    TooManyCells {
        /// Columns that it would have.
        width: f64,
        /// Rows that it would have.
        height: f64,
        /// Resolution in m/cell.
        resolution: f64,
        /// The most cells allowed.
        limit: u64,
    },
    /// There is no such lattice.
    #[error("the fused map is out of range: {0}")]
    Lattice(#[from] LatticeError),
    /// The machine has no memory for the fused map.
    #[error("there is no memory for a fused map of {cells} cells")]
    Memory {
        /// Cells that it would have.
        cells: usize,
    },
}

/// Adds the other maps to the anchor. The order of `others` does not matter.
///
/// # Errors
/// [`FuseError`] when the fused map would be too large, or its resolution is out of range.
pub fn fuse(anchor: &OccupancyGrid, others: &[PlacedMap<'_>], options: &FuseOptions) -> Result<Fused, FuseError> {
    let lattice = common_lattice(anchor.lattice(), others, options)?;
    let anchor = PlacedMap {
        grid: anchor,
        pose_anchor_map: Pose2::IDENTITY,
    };
    let layers: Vec<Layer> = std::iter::once(&anchor)
        .chain(others)
        .map(|map| Layer {
            sampler: Sampler::new(map.grid, map.pose_anchor_map, &lattice),
            cells: map.grid.cells(),
            words: options.conflicts.then(|| words(map.grid, options.conflict_tolerance_m)),
        })
        .collect();
    let mut grid = OccupancyGrid::try_unknown(lattice).map_err(|_| FuseError::Memory {
        cells: lattice.cell_count(),
    })?;
    let width = lattice.width() as usize;
    grid.cells_mut()
        .par_chunks_mut(width)
        .zip(0..lattice.height())
        .for_each_init(
            || vec![LogOddsSum::default(); width],
            |sums, (cells, row)| {
                sums.fill(LogOddsSum::default());
                for layer in &layers {
                    layer.visit(row, |column, index| sums[column].add(layer.cells[index]));
                }
                for (cell, sum) in cells.iter_mut().zip(&*sums) {
                    *cell = sum.total();
                }
            },
        );
    let conflicts = options.conflicts.then(|| count_votes(&lattice, &layers));
    Ok(Fused { grid, conflicts })
}

struct Layer<'a> {
    sampler: Sampler<'a>,
    cells: &'a [LogOdds],
    words: Option<Vec<Word>>,
}

impl Layer<'_> {
    /// Every cell of a row that the map covers, with the index of the map's cell that speaks for it.
    fn visit(&self, row: u32, mut f: impl FnMut(usize, usize)) {
        for column in self.sampler.columns(row) {
            if let Some(index) = self.sampler.source_index(column, row) {
                f(column as usize, index);
            }
        }
    }
}

fn count_votes(lattice: &Lattice, layers: &[Layer<'_>]) -> Conflicts {
    let mut votes = vec![Votes::default(); lattice.cell_count()];
    votes
        .par_chunks_mut(lattice.width() as usize)
        .zip(0..lattice.height())
        .for_each(|(votes, row)| {
            for layer in layers {
                let words = layer.words.as_deref().unwrap_or_default();
                layer.visit(row, |column, index| {
                    let votes = &mut votes[column];
                    match words[index] {
                        Word::Silent => {}
                        Word::Free => votes.free = votes.free.saturating_add(1),
                        Word::Occupied => votes.occupied = votes.occupied.saturating_add(1),
                    }
                });
            }
        });
    Conflicts::new(votes)
}

/// Step 1.
fn common_lattice(anchor: &Lattice, others: &[PlacedMap<'_>], options: &FuseOptions) -> Result<Lattice, FuseError> {
    let resolution = options.resolution.unwrap_or(anchor.resolution());
    let mut bounds = Bounds::NONE;
    anchor.corners().into_iter().for_each(|corner| bounds.include(corner));
    for map in others {
        bounds.include_known(map);
    }
    // where the anchor has no yaw, its own corner is a corner of the common cells
    let straight = anchor.origin().yaw().magnitude() < STRAIGHT;
    let corner = if straight {
        anchor.origin().translation()
    } else {
        [0.0, 0.0]
    };
    let side = |axis: usize| {
        let first = ((bounds.low[axis] - corner[axis]) / resolution + CELL_SLACK).floor();
        let last = ((bounds.high[axis] - corner[axis]) / resolution - CELL_SLACK).ceil();
        (corner[axis] + first * resolution, (last - first).max(1.0))
    };
    let ((x, width), (y, height)) = (side(0), side(1));
    #[expect(clippy::cast_precision_loss, reason = "a limit of more than 2^53 cells is none")]
    let limit = options.cells_max.min(Lattice::CELLS_MAX) as f64;
    let valid = resolution.is_finite() && resolution > 0.0;
    if valid && width * height > limit {
        return Err(FuseError::TooManyCells {
            width,
            height,
            resolution,
            limit: options.cells_max.min(Lattice::CELLS_MAX),
        });
    }
    let (width, height) = if valid { (count(width), count(height)) } else { (1, 1) };
    let origin = Pose2::parse(x, y, 0.0).unwrap_or(Pose2::IDENTITY);
    Ok(Lattice::new(width, height, resolution, origin)?)
}

/// Yaws of this many radians move no cell of the largest map by a thousandth of a cell.
const STRAIGHT: f64 = 1e-8;
/// Corners that miss a cell's border by less, in cells, lie on it.
const CELL_SLACK: f64 = 1e-3;

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at least 1, and the product of both sides is below 2^31"
)]
fn count(side: f64) -> u32 {
    side as u32
}

struct Bounds {
    low: Point,
    high: Point,
}

impl Bounds {
    const NONE: Self = Self {
        low: [f64::INFINITY; 2],
        high: [f64::NEG_INFINITY; 2],
    };

    fn include(&mut self, point: Point) {
        self.low = [self.low[0].min(point[0]), self.low[1].min(point[1])];
        self.high = [self.high[0].max(point[0]), self.high[1].max(point[1])];
    }

    /// All cells that the map knows, whole.
    fn include_known(&mut self, map: &PlacedMap<'_>) {
        let lattice = map.grid.lattice();
        let motion = map.pose_anchor_map.motion();
        for row in 0..lattice.height() {
            let cells = map.grid.row(row);
            let known = |cell: &LogOdds| cell.is_known();
            let (Some(first), Some(last)) = (cells.iter().position(known), cells.iter().rposition(known)) else {
                continue;
            };
            for column in [first, last + 1] {
                for v in [f64::from(row), f64::from(row) + 1.0] {
                    #[expect(clippy::cast_precision_loss, reason = "columns are below 2^31")]
                    self.include(motion.apply(lattice.to_metres([column as f64, v])));
                }
            }
        }
    }
}

#[cfg(test)]
#[path = "fuse_tests.rs"]
mod tests;
