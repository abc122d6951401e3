//! Two maps laid over each other: how much they have in common and how well they agree there.
//!
//! **Convention.** `pose_fixed_moving` is the pose of the moving map's frame in the fixed map's frame. A cell is known
//! when it is free or occupied; unknown and undecided cells take part in nothing.
//!
//! **Method.** Each known cell of the map with the smaller known area is looked up, by its centre, in the other map.
//! With the cells that are known in both:
//!
//! 1. `agr` = cells of one state in both maps, `dis` = cells of two states (eq. 33);
//! 2. the verification index `V = agr / (agr + dis)` (eq. 34);
//! 3. the overlap `(agr + dis) / known cells of the smaller map`.
//!
//! **Shapes and units.** Cells are counted on the lattice of the smaller map, so that the counts of two resolutions
//! mean something; V and overlap are shares in [0, 1].
//!
//! **Cost.** One pass over the known cells of the smaller map, in parallel by rows; whole numbers are added, so the
//! answer does not depend on the number of threads.
//!
//! **Fails when** there is nothing in common: V is then `None`, not 0 and not 1. V by itself tells little: free space
//! agrees with free space, so that most wrong poses reach 0.92 as well.
//!
//! **Differences from the paper.** `dis` of the paper counts cells known in at least one map. Then V is below 0.63 at
//! the truth whenever the maps overlap in part, and its threshold of 92 % can never be met; here a cell has to be known
//! in both. [`Comparison::verification_index_over_union`] is the literal reading.

use rayon::prelude::*;

use crate::geometry::Pose2;
use crate::grid::{CellState, Lattice, OccupancyGrid, StateCounts};

/// The states of a map's cells, with what makes walking over the known ones fast. A byte a cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateMap {
    lattice: Lattice,
    states: Vec<CellState>,
    /// For each row the columns `start..end` between which all its known cells lie.
    known_spans: Vec<(u32, u32)>,
    counts: StateCounts,
}

impl StateMap {
    /// The states of all cells of a grid.
    #[must_use]
    pub fn new(grid: &OccupancyGrid) -> Self {
        Self::from_states(*grid.lattice(), grid.cells().iter().map(|cell| cell.state()).collect())
    }

    /// A map of these states, row by row from the lowest, as many as the lattice has cells.
    pub(super) fn from_states(lattice: Lattice, states: Vec<CellState>) -> Self {
        debug_assert_eq!(states.len(), lattice.cell_count());
        let known_spans = states.chunks(lattice.width() as usize).map(known_span).collect();
        let of = |wanted| states.iter().filter(|state| **state == wanted).count();
        let (free, occupied) = (of(CellState::Free), of(CellState::Occupied));
        let counts = StateCounts {
            unknown: states.len() - free - occupied,
            free,
            occupied,
        };
        Self {
            lattice,
            states,
            known_spans,
            counts,
        }
    }

    /// Where the cells lie.
    #[must_use]
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// All states, row by row from the lowest.
    #[must_use]
    pub fn states(&self) -> &[CellState] {
        &self.states
    }

    /// The state of one cell.
    ///
    /// # Panics
    /// When the lattice has no such cell.
    #[must_use]
    #[inline]
    pub fn at(&self, column: u32, row: u32) -> CellState {
        self.states[self.lattice.index(column, row)]
    }

    /// How many cells are in each state.
    #[must_use]
    pub fn counts(&self) -> StateCounts {
        self.counts
    }

    /// Area of the known cells in square metres.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "cell counts stay far below 2^52")]
    pub fn known_area(&self) -> f64 {
        self.counts.known() as f64 * self.lattice.resolution().powi(2)
    }
}

fn known_span(row: &[CellState]) -> (u32, u32) {
    let known = |state: &CellState| *state != CellState::Unknown;
    let column = |at: usize| u32::try_from(at).expect("invariant: a lattice has fewer than 2^31 columns");
    match (row.iter().position(known), row.iter().rposition(known)) {
        (Some(first), Some(last)) => (column(first), column(last + 1)),
        _ => (0, 0),
    }
}

/// What two maps have in common under a pose. Cells are those of the map with the smaller known area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Cells known in both maps and of one state: the paper's `agr` (eq. 33).
    pub agreeing: u64,
    /// Cells known in both maps and of two states: the paper's `dis`, over cells known in both.
    pub disagreeing: u64,
    /// Known cells of the map with the smaller known area.
    pub smaller_known: u64,
    /// Known area of the other map, in cells of the smaller one.
    pub larger_known: f64,
}

impl Comparison {
    /// Cells known in both maps.
    #[must_use]
    pub fn common(&self) -> u64 {
        self.agreeing + self.disagreeing
    }

    /// The paper's V (eq. 34) in [0, 1], over the cells known in both maps; `None` when there are none.
    #[must_use]
    pub fn verification_index(&self) -> Option<f64> {
        (self.common() > 0).then(|| to_f64(self.agreeing) / to_f64(self.common()))
    }

    /// V as the paper writes it: `dis` counts the cells known in at least one map. `None` when no cell is known in both.
    #[must_use]
    pub fn verification_index_over_union(&self) -> Option<f64> {
        let union = to_f64(self.smaller_known) + self.larger_known - to_f64(self.common());
        (self.common() > 0).then(|| (to_f64(self.agreeing) / union).min(1.0))
    }

    /// Area known in both maps over the smaller known area, in [0, 1]; 0 when a map knows nothing.
    #[must_use]
    pub fn overlap(&self) -> f64 {
        match self.smaller_known {
            0 => 0.0,
            known => to_f64(self.common()) / to_f64(known),
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "cell counts stay far below 2^52")]
fn to_f64(cells: u64) -> f64 {
    cells as f64
}

/// Lays the moving map over the fixed one and counts (see the module's text).
#[must_use]
pub fn compare(fixed: &StateMap, moving: &StateMap, pose_fixed_moving: Pose2) -> Comparison {
    if fixed.known_area() < moving.known_area() {
        walk(fixed, moving, pose_fixed_moving.inverse())
    } else {
        walk(moving, fixed, pose_fixed_moving)
    }
}

/// Looks every known cell of `smaller` up in `larger`.
fn walk(smaller: &StateMap, larger: &StateMap, pose_larger_smaller: Pose2) -> Comparison {
    let (from, to) = (smaller.lattice, larger.lattice);
    // p_to_lattice = origin_to^-1 * pose_to_from * origin_from * p_from_lattice, in metres
    let step = (to.origin().inverse() * pose_larger_smaller * from.origin()).motion();
    let scale = from.resolution() / to.resolution();
    let (du, dv) = (step.cos * scale, step.sin * scale);
    let [u0, v0] = [step.x / to.resolution(), step.y / to.resolution()];
    let width = from.width() as usize;
    let (agreeing, disagreeing) = smaller
        .states
        .par_chunks(width)
        .zip(&smaller.known_spans)
        .enumerate()
        .with_min_len(32)
        .map(|(row, (states, &(start, end)))| {
            #[expect(clippy::cast_precision_loss, reason = "rows are below 2^31")]
            let y = row as f64 + 0.5;
            let (mut agreeing, mut disagreeing) = (0_u64, 0_u64);
            for (column, &here) in (start..end).zip(&states[start as usize..end as usize]) {
                if here == CellState::Unknown {
                    continue;
                }
                let x = f64::from(column) + 0.5;
                let there = to
                    .cell_of([u0 + du * x - dv * y, v0 + dv * x + du * y])
                    .map_or(CellState::Unknown, |(i, j)| larger.at(i, j));
                agreeing += u64::from(here == there);
                // Departs from eq. 33, "known in at least one map": known in both.
                disagreeing += u64::from(here != there && there != CellState::Unknown);
            }
            (agreeing, disagreeing)
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    Comparison {
        agreeing,
        disagreeing,
        smaller_known: smaller.counts.known() as u64,
        larger_known: larger.known_area() / from.resolution().powi(2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::grid::LogOdds;
    use proptest::prelude::*;

    /// The definition, cell by cell, by the public doors of the lattices alone.
    fn oracle(fixed: &OccupancyGrid, moving: &OccupancyGrid, pose_fixed_moving: Pose2) -> Comparison {
        let fixed_is_smaller = fixed.known_area() < moving.known_area();
        let (smaller, larger, pose) = if fixed_is_smaller {
            (fixed, moving, pose_fixed_moving.inverse())
        } else {
            (moving, fixed, pose_fixed_moving)
        };
        let (mut agreeing, mut disagreeing) = (0, 0);
        for row in 0..smaller.lattice().height() {
            for column in 0..smaller.lattice().width() {
                let point = pose.apply(smaller.lattice().cell_center(column, row));
                let here = smaller.at(column, row).state();
                let there = larger
                    .lattice()
                    .cell_at(point)
                    .map_or(CellState::Unknown, |(i, j)| larger.at(i, j).state());
                match (here, there) {
                    (CellState::Unknown, _) | (_, CellState::Unknown) => {}
                    (a, b) if a == b => agreeing += 1,
                    _ => disagreeing += 1,
                }
            }
        }
        Comparison {
            agreeing,
            disagreeing,
            smaller_known: smaller.state_counts().known() as u64,
            larger_known: larger.known_area() / smaller.lattice().resolution().powi(2),
        }
    }

    fn grid(width: u32, height: u32, resolution: f64, origin: Pose2, seed: u32) -> OccupancyGrid {
        let lattice = Lattice::new(width, height, resolution, origin).expect("a valid lattice");
        let cells = (0..width * height).map(|i| match (i.wrapping_add(seed)).wrapping_mul(2_654_435_761) >> 29 {
            0 | 1 => LogOdds::OCCUPIED,
            2..=4 => LogOdds::FREE,
            5 => LogOdds::from_probability(0.5),
            _ => LogOdds::UNKNOWN,
        });
        OccupancyGrid::new(lattice, cells.collect()).expect("as many cells")
    }

    proptest! {
        #[test]
        fn the_stepped_walk_equals_the_slow_definition(x in -2.0..2.0_f64, y in -2.0..2.0_f64, yaw in -4.0..4.0_f64,
                                                       resolution in 0.04..0.2_f64, seed in 0_u32..1000) {
            let fixed = grid(40, 30, 0.05, Pose2::new(-1.0, -0.7, Angle::from_radians(0.3)), seed);
            let moving = grid(33, 37, resolution, Pose2::new(-1.1, -0.4, Angle::from_radians(-0.8)), seed + 7);
            let pose = Pose2::new(x, y, Angle::from_radians(yaw));
            let fast = compare(&StateMap::new(&fixed), &StateMap::new(&moving), pose);
            let slow = oracle(&fixed, &moving, pose);
            // a centre on the border of two cells may fall to either by rounding
            prop_assert!(fast.agreeing.abs_diff(slow.agreeing) <= 1 && fast.disagreeing.abs_diff(slow.disagreeing) <= 1);
            prop_assert_eq!(fast.smaller_known, slow.smaller_known);
            prop_assert!((fast.larger_known - slow.larger_known).abs() < 1e-9);
        }
    }

    #[test]
    fn a_map_agrees_with_itself_in_every_known_cell() {
        let map = StateMap::new(&grid(50, 20, 0.05, Pose2::new(3.0, -4.0, Angle::from_degrees(20.0)), 3));
        let comparison = compare(&map, &map, Pose2::IDENTITY);
        assert_eq!(comparison.common() as usize, map.counts().known());
        assert_eq!(comparison.verification_index(), Some(1.0));
        assert_eq!(comparison.verification_index_over_union(), Some(1.0));
        assert!((comparison.overlap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn without_common_cells_there_is_no_verification_index() {
        let map = StateMap::new(&grid(10, 10, 0.05, Pose2::IDENTITY, 0));
        let far = compare(&map, &map, Pose2::new(100.0, 0.0, Angle::ZERO));
        assert_eq!((far.common(), far.verification_index()), (0, None));
        assert!(far.overlap().abs() < 1e-12);
        let lattice = *map.lattice();
        let nothing = StateMap::new(&OccupancyGrid::unknown(lattice));
        let empty = compare(&nothing, &map, Pose2::IDENTITY);
        assert_eq!(
            (empty.verification_index(), empty.verification_index_over_union()),
            (None, None)
        );
        assert!(empty.overlap().abs() < 1e-12);
    }

    #[test]
    fn over_the_union_a_partial_overlap_can_never_verify() {
        let lattice = Lattice::new(4, 1, 1.0, Pose2::IDENTITY).expect("valid");
        let row = |cells: [LogOdds; 4]| StateMap::new(&OccupancyGrid::new(lattice, cells.to_vec()).expect("four"));
        let (f, u) = (LogOdds::FREE, LogOdds::UNKNOWN);
        let comparison = compare(&row([f, f, u, u]), &row([u, f, f, u]), Pose2::IDENTITY);
        assert_eq!(comparison.verification_index(), Some(1.0));
        assert!((comparison.verification_index_over_union().expect("one in common") - 1.0 / 3.0).abs() < 1e-12);
        assert!((comparison.overlap() - 0.5).abs() < 1e-12);
    }
}
