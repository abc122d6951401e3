//! Refinement: symmetric point-to-line Gauss-Newton between two maps' walls.
//!
//! Convention: a step (dx, dy, dyaw) moves the moving map in the fixed map's local frame, turning about the pivot, the
//! moving samples' mean under the present placement.
//! Method, for each sample with the nearest wall q of the other map within the gate: (1) q straight (linearity > 0.5):
//! one residual e = n_q . (x - c_q), left out where both are straight and |n_k . n_q| < 0.8 (crossing walls), or
//! n_k . n_q < 0 with both signs sure (the two faces of one wall: matching them would bias the pose by its thickness);
//! (2) else two residuals x - c_q of weight 0.3; (3) weight (1 + (e/s)^2)^-2, 0 beyond 3 s; (4) Jacobian
//! [n, n . perp(x - pivot)] for moving samples, its negative for fixed ones; (5) damping diag(0.5, 0.5, 5).
//! Shapes and units: metres, radians; gathers in f32, the 3 x 3 solve in f64.
//! Cost: two dependent gathers (label, wall) a sample, about 10 ns from the second cache.
//! Fails when: the start is farther off than the gate, or nothing holds a direction (the damping then keeps it still).

#![expect(
    clippy::many_single_char_names,
    clippy::doc_markdown,
    reason = "the letters of the formulas"
)]
#![expect(
    clippy::needless_bitwise_bool,
    reason = "a branch for one sample would be one for all of its lanes"
)]

use super::cells::CellMap;
use super::features::Features;
use super::num::narrow;
use super::placement::{Placement, Rigid};
use super::samples::{Landed, Thinned, land};
use super::simd::{LANES, widest};

/// Gate and scale in metres of each iteration.
pub(super) type Schedule<'a> = &'a [(f32, f32)];

pub(super) const COARSE: [(f32, f32); 6] = [
    (0.5, 0.3),
    (0.5, 0.25),
    (0.4, 0.2),
    (0.3, 0.15),
    (0.25, 0.1),
    (0.2, 0.08),
];
pub(super) const FINE: [(f32, f32); 8] = [
    (0.2, 0.08),
    (0.18, 0.07),
    (0.16, 0.06),
    (0.15, 0.05),
    (0.15, 0.04),
    (0.15, 0.04),
    (0.15, 0.04),
    (0.15, 0.04),
];
pub(super) const POLISH: [(f32, f32); 4] = [(0.15, 0.04); 4];
const DAMPING: [f64; 3] = [0.5, 0.5, 5.0];
const STEP_M: f64 = 1e-4;
const STEP_RAD: f64 = 1e-5;

/// A refined placement and how well it is held.
#[derive(Debug, Clone, Copy)]
pub(super) struct Refined {
    pub(super) placement: Placement,
    /// Sum of w J^T J at the pivot, by (x, y, yaw).
    pub(super) information: [[f64; 3]; 3],
    pub(super) pivot: [f64; 2],
    /// Weighted mean square residual, m^2.
    pub(super) variance: f64,
}

/// Refines a start by the samples of both maps.
pub(super) fn refine(fixed: &Thinned, moving: &Thinned, start: Placement, schedule: Schedule, stretch: f32) -> Refined {
    let mut placement = start;
    let mut refined = Refined {
        placement,
        information: [[0.0; 3]; 3],
        pivot: [0.0; 2],
        variance: 0.0,
    };
    let settled = schedule.last().map_or(0.0, |last| last.0);
    for &(gate, scale) in schedule {
        let [mx, my] = moving.map.moments.mean;
        let (sin, cos) = placement.yaw.sin_cos();
        let pivot = [cos * mx - sin * my + placement.x, sin * mx + cos * my + placement.y];
        let mut sums = Sums::default();
        let to_fixed = placement.rigid();
        let window = Window {
            gate: gate * stretch,
            scale: scale * stretch,
            pivot: pivot.map(narrow),
        };
        collect::<false>(moving, fixed.map, to_fixed, to_fixed, &window, &mut sums);
        collect::<true>(fixed, moving.map, to_fixed.inverse(), to_fixed, &window, &mut sums);
        let (information, gradient) = sums.normal_equations();
        refined.information = information;
        refined.pivot = pivot;
        let [weight, square] = [sums.weight, sums.square].map(total);
        refined.variance = if weight > 0.0 { square / weight } else { 0.0 };
        let step = solve(information, gradient);
        let (sin, cos) = step[2].sin_cos();
        let (rx, ry) = (placement.x - pivot[0], placement.y - pivot[1]);
        placement = Placement {
            x: pivot[0] + cos * rx - sin * ry + step[0],
            y: pivot[1] + sin * rx + cos * ry + step[1],
            yaw: placement.yaw + step[2],
        };
        let still = step[0].hypot(step[1]) < STEP_M && step[2].abs() < STEP_RAD;
        if still && gate <= settled {
            break;
        }
    }
    refined.placement = placement;
    refined
}

struct Window {
    gate: f32,
    scale: f32,
    pivot: [f32; 2],
}

/// Weighted sums of J^T J (upper half), J^T e, e^2 and the weights, each lane by itself.
#[derive(Default)]
struct Sums {
    xx: [f32; LANES],
    xy: [f32; LANES],
    yy: [f32; LANES],
    xt: [f32; LANES],
    yt: [f32; LANES],
    tt: [f32; LANES],
    ex: [f32; LANES],
    ey: [f32; LANES],
    et: [f32; LANES],
    square: [f32; LANES],
    weight: [f32; LANES],
}

impl Sums {
    fn normal_equations(&self) -> ([[f64; 3]; 3], [f64; 3]) {
        let [xx, xy, xt, yy, yt, tt] = [self.xx, self.xy, self.xt, self.yy, self.yt, self.tt].map(total);
        (
            [[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]],
            [self.ex, self.ey, self.et].map(total),
        )
    }
}

fn total(lanes: [f32; LANES]) -> f64 {
    lanes.into_iter().map(f64::from).sum()
}

widest! {
    /// Adds what the samples of `source` say, looked up in `target`: the moving map's samples in the fixed map, or `BACK`.
    /// No branch depends on a sample: what does not count has the weight 0.
    fn collect<const BACK: bool>(
        source: &Thinned,
        target: &Features,
        to_target: Rigid,
        to_fixed: Rigid,
        window: &Window,
        sums: &mut Sums,
    ) {
        let gate = window.gate * window.gate;
        let per_scale = 1.0 / (window.scale * window.scale);
        let [px, py] = window.pivot;
        for groups in source.groups() {
            for (landed, k) in land(groups, target, to_target).iter().zip(groups) {
                if !landed.any(CellMap::LABEL) {
                    continue;
                }
                let (Landed { x, y, .. }, q) = (landed, landed.walls(target));
                for i in 0..LANES {
                    let (dx, dy) = (x[i] - q.x[i], y[i] - q.y[i]);
                    let near = dx * dx + dy * dy <= gate;
                    let straight = q.linearity[i] > 0.5;
                    let (knx, kny) = to_target.rotate(k.nx[i], k.ny[i]);
                    let facing = knx * q.nx[i] + kny * q.ny[i];
                    let crossing = (k.linearity[i] > 0.5) & (facing.abs() < 0.8);
                    let back = (facing < 0.0) & (k.strength[i] > SURE) & (q.strength[i] > SURE);
                    let e = q.nx[i] * dx + q.ny[i] * dy;
                    // The lever is the sample in the fixed frame, in both directions.
                    let (lx, ly, nx, ny, ex, ey) = if BACK {
                        let (nx, ny) = to_fixed.rotate(q.nx[i], q.ny[i]);
                        let (ex, ey) = to_fixed.rotate(dx, dy);
                        (k.x[i] - px, k.y[i] - py, -nx, -ny, -ex, -ey)
                    } else {
                        (x[i] - px, y[i] - py, q.nx[i], q.ny[i], dx, dy)
                    };
                    let length = ex * ex + ey * ey;
                    let line = if near & straight & !crossing & !back { robust(e * e * per_scale) } else { 0.0 };
                    let point = if near & !straight { 0.3 * robust(length * per_scale) } else { 0.0 };
                    let turn = ny * lx - nx * ly;
                    let (wx, wy, wt) = (line * nx, line * ny, line * turn);
                    sums.xx[i] += wx * nx + point;
                    sums.xy[i] += wx * ny;
                    sums.yy[i] += wy * ny + point;
                    sums.xt[i] += wx * turn - point * ly;
                    sums.yt[i] += wy * turn + point * lx;
                    sums.tt[i] += wt * turn + point * (lx * lx + ly * ly);
                    sums.ex[i] += wx * e + point * ex;
                    sums.ey[i] += wy * e + point * ey;
                    sums.et[i] += wt * e + point * (lx * ey - ly * ex);
                    sums.square[i] += line * e * e + point * length;
                    sums.weight[i] += line + 2.0 * point;
                }
            }
        }
    }
}

/// Above this the sign of a wall's normal is sure.
pub(super) const SURE: f32 = 0.3;

/// Equation (3) of the squared ratio (e/s)^2.
#[inline]
fn robust(square: f32) -> f32 {
    let one = 1.0 / (1.0 + square);
    if square > 9.0 { 0.0 } else { one * one }
}

/// The damped step -(H + D)^-1 g.
fn solve(information: [[f64; 3]; 3], gradient: [f64; 3]) -> [f64; 3] {
    let mut damped = information;
    for (i, damping) in DAMPING.into_iter().enumerate() {
        damped[i][i] += damping;
    }
    let inverse = inverse_3x3(damped);
    inverse.map(|row| -(row[0] * gradient[0] + row[1] * gradient[1] + row[2] * gradient[2]))
}

/// Inverse of a symmetric positive definite matrix.
pub(super) fn inverse_3x3(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let [[a, b, c], [_, d, e], [_, _, f]] = m;
    let (ca, cb, cc) = (d * f - e * e, c * e - b * f, b * e - c * d);
    let det = a * ca + b * cb + c * cc;
    let (cd, ce, cf) = (a * f - c * c, b * c - a * e, a * d - b * b);
    [[ca, cb, cc], [cb, cd, ce], [cc, ce, cf]].map(|row| row.map(|value| value / det))
}

/// Covariance of the moving frame's pose in the fixed frame's axes, both local: sigma^2 (H + D)^-1 carried from the pivot
/// to the frame's origin, times `inflation`, since neighbouring samples are not independent.
pub(super) fn covariance(refined: &Refined, inflation: f64, floor_m: f64) -> [[f64; 3]; 3] {
    let mut damped = refined.information;
    for (i, damping) in DAMPING.into_iter().enumerate() {
        damped[i][i] += damping;
    }
    let at_pivot = inverse_3x3(damped);
    let variance = inflation * refined.variance.max(floor_m * floor_m);
    let (lx, ly) = (
        refined.placement.x - refined.pivot[0],
        refined.placement.y - refined.pivot[1],
    );
    let carry = [[1.0, 0.0, -ly], [0.0, 1.0, lx], [0.0, 0.0, 1.0]];
    sandwich(carry, at_pivot).map(|row| row.map(|value| value * variance))
}

/// `a m a^T`.
pub(super) fn sandwich(a: [[f64; 3]; 3], m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut out = [[0.0; 3]; 3];
    for (i, row) in out.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            for k in 0..3 {
                for l in 0..3 {
                    *value += a[i][k] * m[k][l] * a[j][l];
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::params::HoughParameters;
    use super::super::tests::{everything, map};
    use super::super::walls::Wall;
    use super::*;
    use crate::geometry::{Angle, Pose2};
    use proptest::prelude::*;
    use std::sync::LazyLock;

    /// (1) to (4) for one sample by their definition: rows of the Jacobian, residuals and weights.
    fn rows(k: &Wall, q: &Wall, to_target: Rigid, back: Option<Rigid>, window: &Window) -> Vec<([f32; 3], f32, f32)> {
        let (x, y) = to_target.apply(k.x, k.y);
        let (dx, dy) = (x - q.x, y - q.y);
        let robust = |e: f32| if e.abs() > 3.0 { 0.0 } else { (1.0 + e * e).powi(-2) };
        if dx.hypot(dy) > window.gate {
            return Vec::new();
        }
        let (px, py) = if back.is_some() { (k.x, k.y) } else { (x, y) };
        let (lx, ly) = (px - window.pivot[0], py - window.pivot[1]);
        let turned = |x: f32, y: f32| {
            back.map_or((x, y), |back| {
                let (x, y) = back.rotate(x, y);
                (-x, -y)
            })
        };
        if q.linearity > 0.5 {
            let (knx, kny) = to_target.rotate(k.nx, k.ny);
            let facing = knx * q.nx + kny * q.ny;
            if (k.linearity > 0.5 && facing.abs() < 0.8) || (facing < 0.0 && k.strength > SURE && q.strength > SURE) {
                return Vec::new();
            }
            let e = q.nx * dx + q.ny * dy;
            let (nx, ny) = turned(q.nx, q.ny);
            vec![([nx, ny, ny * lx - nx * ly], e, robust(e / window.scale))]
        } else {
            let (ex, ey) = turned(dx, dy);
            let weight = 0.3 * robust(ex.hypot(ey) / window.scale);
            vec![([1.0, 0.0, -ly], ex, weight), ([0.0, 1.0, lx], ey, weight)]
        }
    }

    static MAPS: LazyLock<[Features; 2]> = LazyLock::new(|| {
        let parameters = HoughParameters::default();
        [Pose2::IDENTITY, Pose2::new(1.0, 2.0, Angle::from_radians(0.5))]
            .map(|pose| Features::new(&map(0.1, pose, everything), &parameters).expect("walls"))
    });

    proptest! {
        #[test]
        fn the_kernel_adds_up_what_each_sample_says(x in -0.4..0.4_f64, y in -0.4..0.4_f64, yaw in -0.1..0.1_f64, back: bool) {
            let [fixed, moving] = &*MAPS;
            let truth = Placement::of_maps(Pose2::new(1.0, 2.0, Angle::from_radians(0.5)), fixed.frame, moving.frame);
            let to_fixed = Placement { x: truth.x + x, y: truth.y + y, yaw: truth.yaw + yaw }.rigid();
            let window = Window { gate: 0.77, scale: 0.29, pivot: [2.0, -1.0] };
            let mut sums = Sums::default();
            let (source, target) = if back { (fixed, moving) } else { (moving, fixed) };
            let to_target = if back { to_fixed.inverse() } else { to_fixed };
            let thinned = Thinned::new(source, 333);
            if back {
                collect::<true>(&thinned, target, to_target, to_fixed, &window, &mut sums);
            } else {
                collect::<false>(&thinned, target, to_target, to_fixed, &window, &mut sums);
            }
            let (mut information, mut gradient, mut weights) = ([[0.0_f64; 3]; 3], [0.0_f64; 3], 0.0);
            for k in source.samples.iter().step_by(source.samples.len().div_ceil(333)) {
                let (x, y) = to_target.apply(k.x, k.y);
                let [cell] = target.cells.at_all(&[x], &[y]);
                let q = &target.walls[CellMap::label(cell)];
                for (row, e, weight) in rows(k, q, to_target, back.then_some(to_fixed), &window) {
                    weights += f64::from(weight);
                    for i in 0..3 {
                        gradient[i] += f64::from(weight * row[i] * e);
                        for j in 0..3 {
                            information[i][j] += f64::from(weight * row[i] * row[j]);
                        }
                    }
                }
            }
            let (fast_information, fast_gradient) = sums.normal_equations();
            let near = |a: f64, b: f64| (a - b).abs() < 1e-3 * (1.0 + information[2][2]);
            prop_assert!(weights > 1.0 && near(total(sums.weight), weights));
            for i in 0..3 {
                prop_assert!(near(fast_gradient[i], gradient[i]), "{fast_gradient:?} {gradient:?}");
                for j in 0..3 {
                    prop_assert!(near(fast_information[i][j], information[i][j]));
                }
            }
        }
    }
}
