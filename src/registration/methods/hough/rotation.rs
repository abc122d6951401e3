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
use super::spectrum::DIRECTIONS;

/// Local maxima closer than this are one, degrees.
const APART: usize = 6;
/// Maxima below this share of the greatest are left out.
const LEAST_SHARE: f32 = 0.15;

/// Candidate rotations of the moving map in radians, each modulo pi, the likeliest first.
pub(super) fn candidates(fixed: &[f32], moving: &[f32], most: usize) -> Vec<f64> {
    let n = DIRECTIONS;
    let twice = [fixed, fixed].concat();
    let correlation: Vec<f32> = (0..n)
        .map(|k| twice[k..].iter().zip(moving).map(|(a, b)| a * b).sum())
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
            d.min(n - d) >= APART
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
            (real64(k) + shift).to_radians()
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
