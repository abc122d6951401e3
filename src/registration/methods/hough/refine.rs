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

use super::cells::CellMap;
use super::features::Features;
use super::num::{narrow, real};
use super::placement::{Placement, Rigid};
use super::walls::Wall;

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

/// Refines a start with at most `most` samples of each map.
pub(super) fn refine(
    fixed: &Features,
    moving: &Features,
    start: Placement,
    schedule: Schedule,
    stretch: f32,
    most: usize,
) -> Refined {
    let mut placement = start;
    let mut refined = Refined {
        placement,
        information: [[0.0; 3]; 3],
        pivot: [0.0; 2],
        variance: 0.0,
    };
    let settled = schedule.last().map_or(0.0, |last| last.0);
    for &(gate, scale) in schedule {
        let [mx, my] = moving.moments.mean;
        let (sin, cos) = placement.yaw.sin_cos();
        let pivot = [cos * mx - sin * my + placement.x, sin * mx + cos * my + placement.y];
        let mut sums = Sums::default();
        let to_fixed = placement.rigid();
        let window = Window {
            gate: gate * stretch,
            scale: scale * stretch,
            pivot: pivot.map(narrow),
        };
        collect(
            moving,
            fixed,
            to_fixed,
            Direction::MovingToFixed,
            &window,
            most,
            &mut sums,
        );
        collect(
            fixed,
            moving,
            to_fixed.inverse(),
            Direction::FixedToMoving(to_fixed),
            &window,
            most,
            &mut sums,
        );
        let (information, gradient) = sums.normal_equations();
        refined.information = information;
        refined.pivot = pivot;
        refined.variance = if sums.weight > 0.0 {
            f64::from(sums.square / sums.weight)
        } else {
            0.0
        };
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

/// Which map's samples are looked up in which, with the placement of the moving map.
#[derive(Clone, Copy)]
enum Direction {
    MovingToFixed,
    FixedToMoving(Rigid),
}

/// Weighted sums of J^T J (upper half), J^T e, e^2 and the weights.
#[derive(Default)]
struct Sums {
    xx: f32,
    xy: f32,
    yy: f32,
    xt: f32,
    yt: f32,
    tt: f32,
    ex: f32,
    ey: f32,
    et: f32,
    square: f32,
    weight: f32,
}

impl Sums {
    #[inline]
    fn add(&mut self, [nx, ny, turn]: [f32; 3], e: f32, weight: f32) {
        let (wx, wy, wt) = (weight * nx, weight * ny, weight * turn);
        self.xx += wx * nx;
        self.xy += wx * ny;
        self.yy += wy * ny;
        self.xt += wx * turn;
        self.yt += wy * turn;
        self.tt += wt * turn;
        self.ex += wx * e;
        self.ey += wy * e;
        self.et += wt * e;
        self.square += weight * e * e;
        self.weight += weight;
    }

    fn normal_equations(&self) -> ([[f64; 3]; 3], [f64; 3]) {
        let [xx, xy, xt, yy, yt, tt] = [self.xx, self.xy, self.xt, self.yy, self.yt, self.tt].map(f64::from);
        (
            [[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]],
            [self.ex, self.ey, self.et].map(f64::from),
        )
    }
}

fn collect(
    source: &Features,
    target: &Features,
    to_target: Rigid,
    direction: Direction,
    window: &Window,
    most: usize,
    sums: &mut Sums,
) {
    let stride = source.samples.len().div_ceil(most).max(1);
    let (cells, walls): (&CellMap, &[Wall]) = (&target.cells, &target.walls);
    let gate = window.gate * window.gate;
    let per_scale = 1.0 / window.scale;
    for k in source.samples.iter().step_by(stride) {
        let (x, y) = to_target.apply(k.x, k.y);
        let (_, label) = cells.at(x, y);
        if label == 0 {
            continue;
        }
        let q = &walls[label as usize - 1];
        let (dx, dy) = (x - q.x, y - q.y);
        if dx * dx + dy * dy > gate {
            continue;
        }
        // The lever is the sample in the fixed frame, in both directions.
        let [px, py] = window.pivot;
        let (lx, ly) = match direction {
            Direction::MovingToFixed => (x - px, y - py),
            Direction::FixedToMoving(_) => (k.x - px, k.y - py),
        };
        if q.linearity > 0.5 {
            let (knx, kny) = to_target.rotate(k.nx, k.ny);
            let facing = knx * q.nx + kny * q.ny;
            let crossing = k.linearity > 0.5 && facing.abs() < 0.8;
            let back = facing < 0.0 && k.strength > SURE && q.strength > SURE;
            if crossing || back {
                continue;
            }
            let e = q.nx * dx + q.ny * dy;
            let weight = robust(e * per_scale);
            let (nx, ny, e) = match direction {
                Direction::MovingToFixed => (q.nx, q.ny, e),
                Direction::FixedToMoving(to_fixed) => {
                    let (nx, ny) = to_fixed.rotate(q.nx, q.ny);
                    (-nx, -ny, e)
                }
            };
            sums.add([nx, ny, ny * lx - nx * ly], e, weight);
        } else {
            let (ex, ey) = match direction {
                Direction::MovingToFixed => (dx, dy),
                Direction::FixedToMoving(to_fixed) => {
                    let (ex, ey) = to_fixed.rotate(dx, dy);
                    (-ex, -ey)
                }
            };
            let weight = 0.3 * robust(ex.hypot(ey) * per_scale);
            sums.add([1.0, 0.0, -ly], ex, weight);
            sums.add([0.0, 1.0, lx], ey, weight);
        }
    }
}

/// Above this the sign of a wall's normal is sure.
pub(super) const SURE: f32 = 0.3;

/// Equation (3).
#[inline]
fn robust(ratio: f32) -> f32 {
    let square = ratio * ratio;
    if square > 9.0 {
        return 0.0;
    }
    let one = 1.0 / (1.0 + square);
    one * one
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

/// Samples of each map that a refinement with at most `most` looks at.
pub(super) fn looked_at(samples: usize, most: usize) -> f32 {
    real(samples.div_ceil(samples.div_ceil(most).max(1)))
}
