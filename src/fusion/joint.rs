//! Joint evidence: hypotheses that no pair could trust by itself, but on which several pairs agree.
//!
//! **Method.** Two groups of maps stand apart. Each rejected pair between them has candidates; each candidate says where
//! one group would lie in the frame of the other.
//!
//! 1. Around each candidate, those of other pairs that say the same (within the tolerance) are gathered, at most one a
//!    pair, the best one. The sum of their scores is the score of the place.
//! 2. The best place is accepted when at least `pairs_min` pairs say so, they match enough wall with little of it
//!    violated, and no really different place has more than `distinct` of its score.
//!
//! **Fails when** both groups repeat themselves in the same way: then several pairs agree on the wrong place as well as
//! on the right one, and step 2 stays silent.

use crate::geometry::Pose2;

/// When hypotheses of several pairs together make up for what each lacks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointRules {
    /// How far apart two hypotheses may lay a map and still say the same: RMS in metres. Default 0.5.
    pub tolerance_m: f64,
    /// The fewest pairs that must agree. Default 2.
    pub pairs_min: usize,
    /// The least wall that they must match in all, in metres. Default 8.
    pub matched_wall_min_m: f64,
    /// The largest share of compared wall that may stand in free space. Default 0.15.
    pub violated_share_max: f64,
    /// The largest share of the best place's score that a really different place may have. Default 0.5.
    pub distinct: f64,
}

impl Default for JointRules {
    fn default() -> Self {
        Self {
            tolerance_m: 0.5,
            pairs_min: 2,
            matched_wall_min_m: 8.0,
            violated_share_max: 0.15,
            distinct: 0.5,
        }
    }
}

/// A candidate of a rejected pair, told as the place of one group in the frame of the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hint {
    /// The pair.
    pub(super) pair: usize,
    /// Which of its candidates.
    pub(super) candidate: usize,
    /// Pose of group b's frame in group a's.
    pub(super) pose_a_b: Pose2,
    /// The candidate's score.
    pub(super) score: f64,
    /// Its matched wall in metres.
    pub(super) matched_m: f64,
    /// Its violated wall in metres.
    pub(super) violated_m: f64,
}

/// Hints that agree with each other.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bridge {
    /// Pair and candidate of each, the best first.
    pub(super) hints: Vec<(usize, usize)>,
    /// The sum of their scores.
    pub(super) score: f64,
    /// Pose of group b's frame in group a's, by the best of them.
    pub(super) pose_a_b: Pose2,
}

/// The place that the hints agree on, if the rules accept it. `distance` is that of two poses of group b.
pub(super) fn bridge(hints: &[Hint], distance: impl Fn(Pose2, Pose2) -> f64, rules: &JointRules) -> Option<Bridge> {
    let mut hints: Vec<&Hint> = hints.iter().filter(|hint| hint.score > 0.0).collect();
    hints.sort_by(|a, b| {
        (b.score.total_cmp(&a.score))
            .then(a.pair.cmp(&b.pair))
            .then(a.candidate.cmp(&b.candidate))
    });
    let places: Vec<Vec<&Hint>> = hints
        .iter()
        .map(|seed| {
            let mut place: Vec<&Hint> = Vec::new();
            for hint in &hints {
                let new = place.iter().all(|other| other.pair != hint.pair);
                if new && distance(seed.pose_a_b, hint.pose_a_b) <= rules.tolerance_m {
                    place.push(hint);
                }
            }
            place
        })
        .collect();
    let score = |place: &[&Hint]| place.iter().map(|hint| hint.score).sum::<f64>();
    let best = (0..places.len()).reduce(|best, next| {
        let more = (score(&places[next]), places[next].len()) > (score(&places[best]), places[best].len());
        if more { next } else { best }
    })?;
    let rival = (0..places.len())
        .filter(|&other| distance(hints[best].pose_a_b, hints[other].pose_a_b) > 2.0 * rules.tolerance_m)
        .map(|other| score(&places[other]))
        .fold(0.0, f64::max);
    let place = &places[best];
    let matched: f64 = place.iter().map(|hint| hint.matched_m).sum();
    let violated: f64 = place.iter().map(|hint| hint.violated_m).sum();
    let accepted = place.len() >= rules.pairs_min
        && matched >= rules.matched_wall_min_m
        && violated <= rules.violated_share_max * (matched + violated)
        && rival <= rules.distinct * score(place);
    accepted.then(|| Bridge {
        hints: place.iter().map(|hint| (hint.pair, hint.candidate)).collect(),
        score: score(place),
        pose_a_b: hints[best].pose_a_b,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;

    fn hint(pair: usize, x: f64, score: f64) -> Hint {
        Hint {
            pair,
            candidate: 0,
            pose_a_b: Pose2::new(x, 0.0, Angle::ZERO),
            score,
            matched_m: 6.0,
            violated_m: 0.1,
        }
    }

    fn by_x(a: Pose2, b: Pose2) -> f64 {
        (a.x() - b.x()).abs()
    }

    #[test]
    fn two_pairs_that_agree_bridge_what_each_alone_could_not() {
        let hints = [
            hint(0, 1.0, 30.0),
            hint(0, 9.0, 27.0),
            hint(1, 1.2, 25.0),
            hint(1, -6.0, 24.0),
        ];
        let bridge = bridge(&hints, by_x, &JointRules::default()).expect("they agree at 1 m");
        assert_eq!(bridge.hints, [(0, 0), (1, 0)]);
        assert!((bridge.score - 55.0).abs() < 1e-9);
    }

    #[test]
    fn a_place_with_an_equal_rival_is_no_place() {
        let hints = [
            hint(0, 1.0, 30.0),
            hint(0, 9.0, 28.0),
            hint(1, 1.2, 25.0),
            hint(1, 9.1, 24.0),
        ];
        assert_eq!(bridge(&hints, by_x, &JointRules::default()), None);
    }

    #[test]
    fn one_pair_alone_never_bridges_however_many_candidates_it_has() {
        let hints = [hint(0, 1.0, 90.0), hint(0, 1.1, 80.0)];
        assert_eq!(bridge(&hints, by_x, &JointRules::default()), None);
    }

    #[test]
    fn walls_in_free_space_speak_against_a_place() {
        let mut hints = [hint(0, 1.0, 30.0), hint(1, 1.2, 25.0)];
        hints[0].violated_m = 5.0;
        assert_eq!(bridge(&hints, by_x, &JointRules::default()), None);
    }
}
