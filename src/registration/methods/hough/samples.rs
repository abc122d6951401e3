//! The wall samples of a map that a look at a hypothesis goes by, and what the other map has where they fall.
//!
//! Shapes and units: groups of [`LANES`] samples, each number in an array of its own; metres.
//! Cost: two dependent gathers (cell, wall) a sample; the second is skipped when no sample of the group needs it.

use super::cells::CellMap;
use super::features::Features;
use super::num::real;
use super::placement::Rigid;
use super::simd::LANES;
use super::walls::Wall;

/// A map and at most so many of its samples, evenly thinned.
#[derive(Debug)]
pub(super) struct Thinned<'a> {
    pub(super) map: &'a Features,
    pub(super) count: usize,
    groups: Vec<Group>,
}

/// [`LANES`] samples; see [`super::walls::Wall`] for the fields.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Group {
    pub(super) x: [f32; LANES],
    pub(super) y: [f32; LANES],
    pub(super) nx: [f32; LANES],
    pub(super) ny: [f32; LANES],
    pub(super) linearity: [f32; LANES],
    pub(super) strength: [f32; LANES],
}

impl<'a> Thinned<'a> {
    /// Every k-th sample of `map`, with the least k that leaves at most `most`.
    pub(super) fn new(map: &'a Features, most: usize) -> Self {
        let stride = map.samples.len().div_ceil(most).max(1);
        let count = map.samples.len().div_ceil(stride);
        let mut groups = vec![Group::NOWHERE; count.div_ceil(LANES)];
        for (index, wall) in map.samples.iter().step_by(stride).enumerate() {
            groups[index / LANES].set(index % LANES, wall);
        }
        Self { map, count, groups }
    }

    /// All samples, [`AHEAD`] groups at a time.
    pub(super) fn groups(&self) -> impl Iterator<Item = &[Group]> {
        self.groups.chunks(AHEAD)
    }

    /// Samples of the map that one of these stands for.
    pub(super) fn each(&self) -> f32 {
        real(self.map.samples.len()) / real(self.count.max(1))
    }
}

impl Group {
    /// Samples that only fill up the last group stand outside of every map, where nothing is known.
    const NOWHERE: Self = Self {
        x: [1e9; LANES],
        y: [1e9; LANES],
        nx: [0.0; LANES],
        ny: [0.0; LANES],
        linearity: [0.0; LANES],
        strength: [0.0; LANES],
    };

    #[inline]
    fn set(&mut self, lane: usize, wall: &Wall) {
        self.x[lane] = wall.x;
        self.y[lane] = wall.y;
        self.nx[lane] = wall.nx;
        self.ny[lane] = wall.ny;
        self.linearity[lane] = wall.linearity;
        self.strength[lane] = wall.strength;
    }
}

/// Groups whose cells are looked up before the first of their walls is: the processor then waits for many at once.
pub(super) const AHEAD: usize = 8;

/// Where the samples of a group fall on another map, and the cells there.
#[derive(Default, Clone, Copy)]
pub(super) struct Landed {
    pub(super) x: [f32; LANES],
    pub(super) y: [f32; LANES],
    pub(super) cell: [u32; LANES],
}

/// Carries at most [`AHEAD`] groups onto `target`.
#[expect(clippy::inline_always, reason = "must take on the vector width of its caller")]
#[inline(always)]
pub(super) fn land(groups: &[Group], target: &Features, to_target: Rigid) -> [Landed; AHEAD] {
    let mut landed = [Landed::default(); AHEAD];
    for (landed, group) in landed.iter_mut().zip(groups) {
        for i in 0..LANES {
            (landed.x[i], landed.y[i]) = to_target.apply(group.x[i], group.y[i]);
        }
        landed.cell = target.cells.at_all(&landed.x, &landed.y);
    }
    landed
}

impl Landed {
    /// Whether any cell has any of these bits.
    #[expect(clippy::inline_always, reason = "must take on the vector width of its caller")]
    #[inline(always)]
    pub(super) fn any(&self, bits: u32) -> bool {
        let mut any = 0;
        for cell in self.cell {
            any |= cell;
        }
        any & bits != 0
    }

    /// The walls nearest to the samples.
    #[expect(clippy::inline_always, reason = "must take on the vector width of its caller")]
    #[inline(always)]
    pub(super) fn walls(&self, target: &Features) -> Group {
        let mut walls = Group::NOWHERE;
        for (lane, &cell) in self.cell.iter().enumerate() {
            walls.set(lane, &target.walls[CellMap::label(cell)]);
        }
        walls
    }
}
