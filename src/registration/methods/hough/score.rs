//! How well a placement explains both maps: walls found, walls contradicted by free space, and their significance.
//!
//! Method, for each wall sample of one map looked up in the other, d its distance to the nearest wall's line: (1) found
//! (d within `found`, directions agree): M += 1, soft += exp(-d^2 / 2 soft^2), n n^T to the scatter; (2) crossed
//! (within `found`, directions differ); (3) near (within `missed`); (4) contradicted: free space in its place; (5) else
//! nothing is known there. Both directions are averaged.
//! (6) misses m = 2 V_straight + 0.5 V_clutter; n = soft + m, q = soft / n; s = n (q ln(q/q0) + (1-q) ln((1-q)/(1-q0)))
//! for q > q0 = 0.5, else 0: the log significance of so many found walls against rivals that find half by chance.
//! Shapes and units: counts are in metres of wall times 10 (samples of 0.1 m).
//! Cost: as one pass of `refine`.

#![expect(clippy::doc_markdown, reason = "the letters of the formulas")]

use super::features::{Features, SAMPLE_M};
use super::num::{narrow, real};
use super::params::Tolerances;
use super::placement::{Placement, Rigid};
use super::refine::{SURE, looked_at};

/// What one direction of looking up finds, in samples of 0.1 m.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct Tally {
    /// Walls found.
    pub found: f32,
    /// Straight walls among the found.
    pub found_straight: f32,
    /// Found, weighted by nearness.
    pub soft: f32,
    /// Walls of another direction in their place.
    pub crossed: f32,
    /// Walls a little aside.
    pub near: f32,
    /// Straight walls that stand in free space.
    pub violated_straight: f32,
    /// Clutter that stands in free space.
    pub violated_clutter: f32,
    /// Straight walls among those that stand deep in free space: no wall within `deep`.
    pub deep_straight: f32,
    /// Clutter that stands deep in free space.
    pub deep_clutter: f32,
    /// Walls where the other map knows nothing.
    pub unknown: f32,
    /// Sum of n n^T of the found walls (xx, xy, yy), in the fixed frame.
    pub scatter: [f32; 3],
    /// Sum of squared distances of the found walls, m^2.
    pub square: f32,
}

/// Both directions averaged.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Score {
    /// Moving samples looked up in the fixed map.
    pub moving: Tally,
    /// Fixed samples looked up in the moving map.
    pub fixed: Tally,
    /// Their mean.
    pub mean: Tally,
    /// Equation (6).
    pub significance: f32,
}

/// Scores a placement with at most `most` samples of each map, counts scaled up to all of them.
pub(super) fn score(
    fixed: &Features,
    moving: &Features,
    placement: Placement,
    tolerances: Tolerances,
    most: usize,
) -> Score {
    let to_fixed = placement.rigid();
    let moving_tally = tally(moving, fixed, to_fixed, None, tolerances, most);
    let fixed_tally = tally(fixed, moving, to_fixed.inverse(), Some(to_fixed), tolerances, most);
    let mean = moving_tally.mean(&fixed_tally);
    Score {
        moving: moving_tally,
        fixed: fixed_tally,
        mean,
        significance: mean.significance(0.5),
    }
}

fn tally(
    source: &Features,
    target: &Features,
    to_target: Rigid,
    back: Option<Rigid>,
    tolerances: Tolerances,
    most: usize,
) -> Tally {
    let stride = source.samples.len().div_ceil(most).max(1);
    let mut sums = Tally::default();
    let found = tolerances.found * tolerances.found;
    let missed = tolerances.missed * tolerances.missed;
    let deep = 4.0 * missed;
    let per_soft = 0.5 / (tolerances.soft * tolerances.soft);
    for k in source.samples.iter().step_by(stride) {
        let (x, y) = to_target.apply(k.x, k.y);
        let (state, label) = target.cells.at(x, y);
        let mut square = f32::MAX;
        let mut compatible = true;
        let mut across = 0.0;
        let mut normal = [0.0; 2];
        let mut straight = false;
        if label > 0 {
            let q = &target.walls[label as usize - 1];
            let (dx, dy) = (x - q.x, y - q.y);
            square = dx * dx + dy * dy;
            straight = q.linearity > 0.5;
            let (knx, kny) = to_target.rotate(k.nx, k.ny);
            if straight && k.linearity > 0.5 {
                let facing = knx * q.nx + kny * q.ny;
                compatible = facing.abs() >= 0.8 && !(facing < 0.0 && k.strength > SURE && q.strength > SURE);
            }
            normal = [q.nx, q.ny];
            across = if straight {
                (q.nx * dx + q.ny * dy).powi(2)
            } else {
                square
            };
        }
        if square <= found {
            if compatible {
                sums.found += 1.0;
                sums.soft += near_exp(across * per_soft);
                sums.square += across;
                if straight {
                    let (nx, ny) = back.map_or((normal[0], normal[1]), |back| back.rotate(normal[0], normal[1]));
                    sums.found_straight += 1.0;
                    sums.scatter[0] += nx * nx;
                    sums.scatter[1] += nx * ny;
                    sums.scatter[2] += ny * ny;
                } else {
                    sums.scatter[0] += 0.3;
                    sums.scatter[2] += 0.3;
                }
            } else {
                sums.crossed += 1.0;
            }
        } else if square <= missed {
            sums.near += 1.0;
        } else if state == super::cells::FREE {
            let depth = if square > deep { 1.0 } else { 0.0 };
            if k.linearity > 0.5 {
                sums.violated_straight += 1.0;
                sums.deep_straight += depth;
            } else {
                sums.violated_clutter += 1.0;
                sums.deep_clutter += depth;
            }
        } else {
            sums.unknown += 1.0;
        }
    }
    let per_sample = source.sample_m / narrow(SAMPLE_M);
    let count = looked_at(source.samples.len(), most).max(1.0);
    sums.times(per_sample * real(source.samples.len()) / count)
}

/// exp(-t) to 0.002 for t in [0, 1.5]: the library's costs as much as the rest of a sample.
#[inline]
fn near_exp(t: f32) -> f32 {
    1.0 / (1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t / 24.0))))
}

impl Tally {
    fn map2(&self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self {
            found: f(self.found, other.found),
            found_straight: f(self.found_straight, other.found_straight),
            soft: f(self.soft, other.soft),
            crossed: f(self.crossed, other.crossed),
            near: f(self.near, other.near),
            violated_straight: f(self.violated_straight, other.violated_straight),
            violated_clutter: f(self.violated_clutter, other.violated_clutter),
            deep_straight: f(self.deep_straight, other.deep_straight),
            deep_clutter: f(self.deep_clutter, other.deep_clutter),
            unknown: f(self.unknown, other.unknown),
            scatter: [0, 1, 2].map(|i| f(self.scatter[i], other.scatter[i])),
            square: f(self.square, other.square),
        }
    }

    fn times(&self, factor: f32) -> Self {
        self.map2(self, |a, _| a * factor)
    }

    fn mean(&self, other: &Self) -> Self {
        self.map2(other, |a, b| 0.5 * (a + b))
    }

    /// All that stands in free space.
    pub(super) fn violated(&self) -> f32 {
        self.violated_straight + self.violated_clutter
    }

    /// Equation (6) for a chance rate q0.
    pub(super) fn significance(&self, q0: f32) -> f32 {
        let misses = 2.0 * self.violated_straight + 0.5 * self.violated_clutter;
        kullback(self.soft, misses, q0)
    }

    /// Smaller eigenvalue of the scatter in samples, and the direction (radians, fixed frame) in which the maps slide.
    pub(super) fn weaker_direction(&self) -> (f32, f32) {
        let [a, b, c] = self.scatter;
        let (mean, spread) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
        // normals crowd around half of atan2(2b, a - c); the maps slide across it
        let crowded = 0.5 * (2.0 * b).atan2(a - c);
        ((mean - spread).max(0.0), crowded + std::f32::consts::FRAC_PI_2)
    }
}

/// n KL(q || q0) for `hits` and `misses`, 0 where hits are no more than chance gives.
pub(super) fn kullback(hits: f32, misses: f32, q0: f32) -> f32 {
    let n = hits + misses;
    let q = hits / n;
    if n <= 0.0 || q <= q0 {
        return 0.0;
    }
    let miss = if q < 1.0 {
        (1.0 - q) * ((1.0 - q) / (1.0 - q0)).ln()
    } else {
        0.0
    };
    n * (q * (q / q0).ln() + miss)
}
