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
#![expect(
    clippy::needless_bitwise_bool,
    reason = "a branch for one sample would be one for all of its lanes"
)]

use super::cells::CellMap;
use super::features::{Features, SAMPLE_M};
use super::num::{narrow, real};
use super::params::Tolerances;
use super::placement::{Placement, Rigid};
use super::refine::SURE;
use super::samples::{Landed, Thinned, land};
use super::simd::{LANES, widest};

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

/// Scores a placement by the samples of both maps, counts scaled up to all of the maps' samples.
pub(super) fn score(fixed: &Thinned, moving: &Thinned, placement: Placement, tolerances: Tolerances) -> Score {
    let to_fixed = placement.rigid();
    let moving_tally = tally(moving, fixed.map, to_fixed, Rigid::IDENTITY, tolerances);
    let fixed_tally = tally(fixed, moving.map, to_fixed.inverse(), to_fixed, tolerances);
    let mean = moving_tally.mean(&fixed_tally);
    Score {
        moving: moving_tally,
        fixed: fixed_tally,
        mean,
        significance: mean.significance(0.5),
    }
}

/// One direction; `to_frame` turns the target's normals into the fixed frame.
fn tally(source: &Thinned, target: &Features, to_target: Rigid, to_frame: Rigid, tolerances: Tolerances) -> Tally {
    let mut sums = Lanes::default();
    count(source, target, to_target, to_frame, tolerances, &mut sums);
    let total = |lanes: [f32; LANES]| lanes.into_iter().sum::<f32>();
    let mut tally = Tally {
        found: total(sums.found),
        found_straight: total(sums.found_straight),
        soft: total(sums.soft),
        crossed: total(sums.crossed),
        near: total(sums.near),
        violated_straight: total(sums.violated_straight),
        violated_clutter: total(sums.violated_clutter),
        deep_straight: total(sums.deep_straight),
        deep_clutter: total(sums.deep_clutter),
        unknown: 0.0,
        scatter: sums.scatter.map(total),
        square: total(sums.square),
    };
    // Samples that only fill up the lanes found nothing, and are not counted here either.
    tally.unknown = real(source.count) - tally.found - tally.crossed - tally.near - tally.violated();
    tally.times(source.map.sample_m / narrow(SAMPLE_M) * source.each())
}

/// [`Tally`], each lane by itself.
#[derive(Default)]
struct Lanes {
    found: [f32; LANES],
    found_straight: [f32; LANES],
    soft: [f32; LANES],
    crossed: [f32; LANES],
    near: [f32; LANES],
    violated_straight: [f32; LANES],
    violated_clutter: [f32; LANES],
    deep_straight: [f32; LANES],
    deep_clutter: [f32; LANES],
    scatter: [[f32; LANES]; 3],
    square: [f32; LANES],
}

widest! {
    /// Method (1) to (5). No branch depends on a sample: what it does not count as, gets 0 added.
    fn count(
        source: &Thinned,
        target: &Features,
        to_target: Rigid,
        to_frame: Rigid,
        tolerances: Tolerances,
        sums: &mut Lanes,
    ) {
        let within_found = tolerances.found * tolerances.found;
        let within_missed = tolerances.missed * tolerances.missed;
        let within_deep = 4.0 * within_missed;
        let per_soft = 0.5 / (tolerances.soft * tolerances.soft);
        let one = |yes: bool| if yes { 1.0 } else { 0.0_f32 };
        for groups in source.groups() {
            for (landed, k) in land(groups, target, to_target).iter().zip(groups) {
                if !landed.any(CellMap::LABEL | CellMap::FREE) {
                    continue;
                }
                let (Landed { x, y, cell }, q) = (landed, landed.walls(target));
                for i in 0..LANES {
                    let (dx, dy) = (x[i] - q.x[i], y[i] - q.y[i]);
                    let square = dx * dx + dy * dy;
                    let straight = q.linearity[i] > 0.5;
                    let mine_straight = k.linearity[i] > 0.5;
                    let (knx, kny) = to_target.rotate(k.nx[i], k.ny[i]);
                    let facing = knx * q.nx[i] + kny * q.ny[i];
                    let back = (facing < 0.0) & (k.strength[i] > SURE) & (q.strength[i] > SURE);
                    let compatible = !(straight & mine_straight) | ((facing.abs() >= 0.8) & !back);
                    let off = q.nx[i] * dx + q.ny[i] * dy;
                    let across = if straight { off * off } else { square };
                    let here = square <= within_found;
                    let found = here & compatible;
                    let violated = (square > within_missed) & CellMap::is_free(cell[i]);
                    let deep = violated & (square > within_deep);
                    let (nx, ny) = to_frame.rotate(q.nx[i], q.ny[i]);
                    let line = one(found & straight);
                    let clutter = 0.3 * one(found & !straight);
                    sums.found[i] += one(found);
                    sums.found_straight[i] += line;
                    sums.soft[i] += if found { near_exp(across * per_soft) } else { 0.0 };
                    sums.square[i] += if found { across } else { 0.0 };
                    sums.scatter[0][i] += line * nx * nx + clutter;
                    sums.scatter[1][i] += line * nx * ny;
                    sums.scatter[2][i] += line * ny * ny + clutter;
                    sums.crossed[i] += one(here & !compatible);
                    sums.near[i] += one(!here & (square <= within_missed));
                    sums.violated_straight[i] += one(violated & mine_straight);
                    sums.violated_clutter[i] += one(violated & !mine_straight);
                    sums.deep_straight[i] += one(deep & mine_straight);
                    sums.deep_clutter[i] += one(deep & !mine_straight);
                }
            }
        }
    }
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

#[cfg(test)]
mod tests {
    use super::super::params::HoughParameters;
    use super::super::tests::map;
    use super::*;
    use crate::geometry::{Angle, Pose2};
    use proptest::prelude::*;
    use std::sync::LazyLock;

    /// (1) to (5) sample by sample, in samples.
    fn direct(source: &Features, target: &Features, to_target: Rigid, most: usize, tolerances: Tolerances) -> Tally {
        let mut tally = Tally::default();
        for k in source.samples.iter().step_by(source.samples.len().div_ceil(most)) {
            let (x, y) = to_target.apply(k.x, k.y);
            let [cell] = target.cells.at_all(&[x], &[y]);
            let q = &target.walls[CellMap::label(cell)];
            let (dx, dy) = (x - q.x, y - q.y);
            let (knx, kny) = to_target.rotate(k.nx, k.ny);
            let facing = knx * q.nx + kny * q.ny;
            let both = q.linearity > 0.5 && k.linearity > 0.5;
            let away = facing < 0.0 && k.strength > SURE && q.strength > SURE;
            let distance = dx.hypot(dy);
            if distance <= tolerances.found && both && (facing.abs() < 0.8 || away) {
                tally.crossed += 1.0;
            } else if distance <= tolerances.found {
                tally.found += 1.0;
                let off = if q.linearity > 0.5 {
                    (q.nx * dx + q.ny * dy).abs()
                } else {
                    distance
                };
                tally.soft += (-0.5 * (off / tolerances.soft).powi(2)).exp();
                tally.square += off * off;
                tally.found_straight += if q.linearity > 0.5 { 1.0 } else { 0.0 };
            } else if distance <= tolerances.missed {
                tally.near += 1.0;
            } else if CellMap::is_free(cell) {
                let deep = if distance > 2.0 * tolerances.missed { 1.0 } else { 0.0 };
                if k.linearity > 0.5 {
                    tally.violated_straight += 1.0;
                    tally.deep_straight += deep;
                } else {
                    tally.violated_clutter += 1.0;
                    tally.deep_clutter += deep;
                }
            } else {
                tally.unknown += 1.0;
            }
        }
        tally
    }

    static MAPS: LazyLock<[Features; 2]> = LazyLock::new(|| {
        let parameters = HoughParameters::default();
        [Pose2::IDENTITY, Pose2::new(1.0, 2.0, Angle::from_radians(0.5))]
            .map(|pose| Features::new(&map(0.1, pose, |[x, _]| x < 9.0), &parameters).expect("walls"))
    });

    proptest! {
        #[test]
        fn the_kernel_counts_each_sample_once_and_where_it_belongs(
            x in -1.0..1.0_f64, y in -1.0..1.0_f64, yaw in -0.1..0.1_f64, most in 20_usize..400,
        ) {
            let [fixed, moving] = &*MAPS;
            let truth = Placement::of_maps(Pose2::new(1.0, 2.0, Angle::from_radians(0.5)), fixed.frame, moving.frame);
            let to_fixed = Placement { x: truth.x + x, y: truth.y + y, yaw: truth.yaw + yaw }.rigid();
            let tolerances = Tolerances::of(fixed, moving);
            let thinned = Thinned::new(moving, most);
            let fast = tally(&thinned, fixed, to_fixed, Rigid::IDENTITY, tolerances)
                .times(narrow(SAMPLE_M) / moving.sample_m / thinned.each());
            let slow = direct(moving, fixed, to_fixed, most, tolerances);
            let told = |t: &Tally| {
                [t.found, t.found_straight, t.crossed, t.near, t.violated_straight, t.violated_clutter, t.deep_straight,
                 t.deep_clutter, t.unknown]
            };
            for (fast, slow) in told(&fast).into_iter().zip(told(&slow)) {
                // a distance that is a bound to the last digit may fall on either side
                prop_assert!((fast - slow).abs() < 1.1, "{fast} {slow}");
            }
            prop_assert!((fast.soft - slow.soft).abs() < 0.003 * (1.0 + slow.found) + 1.1);
            prop_assert!((fast.scatter[0] + fast.scatter[2] - fast.found_straight
                - 0.6 * (fast.found - fast.found_straight)).abs() < 0.01);
        }
    }
}
