//! The coarse results that deserve a closer look: the best by several criteria, no two alike.
//!
//! Several, because a clean pair is best told by what does not contradict it, and a bent or dirty one by how much is
//! found.

use super::placement::{Moments, Placement, Turned};
use super::score::{Score, kullback};

/// Placements nearer than this are one, metres.
pub(super) const SAME_M: f64 = 0.5;

/// Indices of the best `most` mutually different results under each criterion, in order of first choice.
pub(super) fn shortlist(results: &[(Placement, Score)], moving: Moments, most: usize) -> Vec<usize> {
    let criteria: [fn(&Score) -> f32; 5] = [
        |s| s.mean.soft - 3.0 * s.mean.violated(),
        |s| s.mean.soft - 0.6 * s.mean.violated() - 0.3 * s.mean.crossed,
        |s| s.mean.soft - 0.25 * s.mean.violated(),
        |s| kullback(s.mean.soft, s.mean.violated() + 0.5 * s.mean.crossed, 0.5),
        |s| {
            let misses = s.mean.violated() + 0.5 * s.mean.crossed + 0.5 * s.mean.near;
            kullback(s.mean.soft, misses, 0.25)
        },
    ];
    let placements: Vec<Turned> = results.iter().map(|(placement, _)| placement.turned()).collect();
    let mut chosen: Vec<usize> = Vec::new();
    for criterion in criteria {
        let values: Vec<f32> = results.iter().map(|(_, score)| criterion(score)).collect();
        let mut order: Vec<usize> = (0..results.len()).collect();
        order.sort_by(|&a, &b| values[b].total_cmp(&values[a]).then(a.cmp(&b)));
        let mut mine: Vec<usize> = Vec::new();
        for index in order {
            if mine.len() == most {
                break;
            }
            let apart = |&other: &usize| placements[other].distance(placements[index], moving) > SAME_M;
            if mine.iter().all(apart) {
                mine.push(index);
                if chosen.iter().all(apart) {
                    chosen.push(index);
                }
            }
        }
    }
    chosen
}
