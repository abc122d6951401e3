//! Rotation candidates: where the circular correlation of two Hough spectra peaks (paper eq. 22).
//!
//! Method: C(k) = sum over t of s_fixed(t + k) s_moving(t); local maxima at least 6 degrees apart with C at least 0.15 of
//! the greatest, the angle between bins by a parabola.
//! Fails when: the world has no direction (round, or only clutter): then C is flat, and a fan of rotations is tried.
//! Differences from the paper: ALL maxima are kept. The true rotation is the greatest in only 3 of 4 pairs, since
//! buildings repeat every quarter turn; which of them is right is for the walls and the free space to say. A spectrum has
//! the period 180 degrees, so each candidate stands for two rotations.

#![expect(clippy::doc_markdown, reason = "the letters of the formulas")]

use super::num::{real, real64};
use super::spectrum::{DIRECTIONS, Spectrum};

/// Local maxima closer than this are one, degrees.
const APART: usize = 6;
/// Maxima below this share of the greatest are left out.
const LEAST_SHARE: f32 = 0.15;

/// Candidate rotations of the moving map in radians, each modulo pi, the likeliest first.
pub(super) fn candidates(fixed: &Spectrum, moving: &Spectrum, most: usize) -> Vec<f64> {
    // the finest directions that both maps have: those of the smaller one, since all that they share lies on it
    let per_degree = fixed.common(moving);
    let n = DIRECTIONS * per_degree;
    let (fixed, moving) = (fixed.thinned(per_degree), moving.thinned(per_degree));
    let twice = [&fixed[..], &fixed].concat();
    let correlation: Vec<f32> = (0..n)
        .map(|k| twice[k..].iter().zip(&moving).map(|(a, b)| a * b).sum())
        .collect();
    let top = correlation.iter().copied().fold(0.0, f32::max);
    if top <= 0.0 {
        return fan(most);
    }
    let mut order: Vec<usize> = (0..n)
        .filter(|&k| {
            let (before, after) = (correlation[(k + n - 1) % n], correlation[(k + 1) % n]);
            correlation[k] > before && correlation[k] >= after && correlation[k] >= LEAST_SHARE * top
        })
        .collect();
    order.sort_by(|&a, &b| correlation[b].total_cmp(&correlation[a]).then(a.cmp(&b)));
    let mut kept: Vec<usize> = Vec::new();
    for k in order {
        let apart = |&other: &usize| {
            let d = k.abs_diff(other);
            d.min(n - d) >= APART * per_degree
        };
        if kept.len() < most && kept.iter().all(apart) {
            kept.push(k);
        }
    }
    if kept.is_empty() {
        return fan(most);
    }
    kept.into_iter()
        .map(|k| {
            let (a, b, c) = (
                f64::from(correlation[(k + n - 1) % n]),
                f64::from(correlation[k]),
                f64::from(correlation[(k + 1) % n]),
            );
            let curve = a - 2.0 * b + c;
            let shift = if curve < 0.0 {
                (0.5 * (a - c) / curve).clamp(-0.5, 0.5)
            } else {
                0.0
            };
            ((real64(k) + shift) / real64(per_degree)).to_radians()
        })
        .collect()
}

/// Evenly spread rotations.
fn fan(most: usize) -> Vec<f64> {
    let count = (4 * most).max(1);
    (0..count)
        .map(|i| std::f64::consts::PI * f64::from(real(i)) / f64::from(real(count)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::num::{index, narrow};
    use super::super::walls::Wall;
    use super::*;
    use crate::random::Random;

    /// The walls of rooms of all sizes and directions, `across` metres from end to end, in a frame turned by so much.
    fn site(across: f32, turned: f64) -> Vec<Wall> {
        const STREETS: f32 = 24.0;
        let mut random = Random::new(7, &[]);
        let mut uniform = |low, high| narrow(random.uniform(low, high));
        let rooms = index(across / STREETS);
        let mut walls = Vec::new();
        for room in 0..rooms * rooms {
            let middle = [room % rooms, room / rooms].map(|at| real(at) * STREETS - across / 2.0 + uniform(-3.0, 3.0));
            let (sin, cos) = uniform(-30.0, 30.0).to_radians().sin_cos();
            let half = [uniform(3.0, 9.0), uniform(2.0, 7.0)];
            for along in (0..140).map(|step| real(step) / 70.0 - 1.0) {
                for [u, v] in [[along * half[0], half[1]], [half[0], along * half[1]]] {
                    walls.push(wall(
                        [middle[0] + cos * u - sin * v, middle[1] + sin * u + cos * v],
                        turned,
                    ));
                }
            }
        }
        walls
    }

    fn wall(at: [f32; 2], turned: f64) -> Wall {
        let ([x, y], (sin, cos)) = (at.map(f64::from), turned.sin_cos());
        Wall {
            x: narrow(cos * x + sin * y),
            y: narrow(cos * y - sin * x),
            nx: 0.0,
            ny: 1.0,
            linearity: 1.0,
            strength: 0.0,
        }
    }

    #[test]
    fn a_rotation_is_found_to_half_a_metre_at_the_rim_however_great_the_map() {
        for (across, degrees) in [(200.0_f32, 31.3), (700.0, 4.0), (1400.0, 101.77)] {
            let turned = f64::to_radians(degrees);
            let [still, moving] = [0.0, turned].map(|turned| Spectrum::new(&site(across, turned), 0.1));
            let off = |rotation: &f64| (rotation - turned).sin().abs() * f64::from(across) / 2.0;
            let nearest = candidates(&still, &moving, 8)
                .iter()
                .map(off)
                .fold(f64::INFINITY, f64::min);
            assert!(
                nearest < 0.5,
                "{across} m, {degrees} degrees: {nearest} m off at the rim"
            );
        }
    }
}
