//! What a set of maps itself says of how cleanly right pairs fit, and of how well wrong ones do.
//!
//! A wrong place that looks right by itself is the danger of buildings that repeat. One pair cannot know whether a tenth
//! of its walls in free space is people and drift, or another floor. The set can: it holds pairs that fit, and hundreds of
//! candidates that are certainly wrong, since of the candidates of one pair at most one is right.
//!
//! **Shapes and units.** The fit of a candidate: metres of wall that it matches, metres that stand in free space, metres
//! of matched wall that hold the weaker direction. Its share is the violated part of both. What counts as evidence is the
//! *held* wall, `min(matched, 2.5 weaker)`: walls that run one way let the maps slide, however long they are (walls in
//! all directions alike have a weaker direction of half of what is matched).
//!
//! **Method.**
//!
//! 1. Of each pair the leading candidate is the accepted one, or the one that the layout so far confirms, or the one with
//!    the most `held - 11 violated`: the log likelihood ratio of walls that are violated at a rate of 2 % against 20 %, up
//!    to a factor. All others of the pair are known to be wrong.
//! 2. The noise of the set is the lower quartile of the leading candidates' shares, weighted by held wall: the lower one,
//!    for where places repeat half of the leading candidates may be wrong, and those are the dirtier ones.
//! 3. A fit is *clean* when no more than twice the noise (and a little) is violated.
//! 4. An accepted pair that is dirtier than three times the noise is *doubted* when some candidate known to be wrong has
//!    half of its held wall and no much greater share: by this set's own measure it might as well be wrong.
//! 5. A candidate that its own pair could not decide on *stands out* when it is clean and has more held wall than any
//!    clean one that is known to be wrong; and the more of it, the fewer accepted pairs the set has to learn from.
//! 6. An accepted pair joins the maps of a set by itself only when its method is sure of it; else it is a candidate as
//!    those of the pairs that were not accepted are.
//!
//! **Fails when** a place repeats itself to the last chair and only one copy was ever seen: nothing is known to be wrong
//! then, and the copies' pairs are as clean as any.
//!
//! **How far to trust it.** 24 simulated sets of six robots and two strangers, in buildings of eight kinds: 105 of 144 maps
//! placed, the worst 0.11 m off, no stranger placed. 12 fleets of six whose maps grow over six snapshots: 219 of 432 maps
//! placed, 7 of them wrong, all in one building of equal rooms, by one pair between two robots that saw one copy each.
//! Tried and dropped: where more pairs of a set are ambiguous than accepted, to ask .999 instead of .97 of a pair that no
//! other way between its maps confirms. It keeps the 7 out, and 33 of the 40 maps that are placed rightly in four other
//! fleets.

use super::maps::Maps;
use super::outcome::PairRecord;
use super::sketch::{WallAgreement, agreement};
use crate::registration::{Evidence, Registration};

/// What a set's pairs are held to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StandardRules {
    /// The least noise that is believed in, as a share of compared wall. Default 0.005: maps without any noise differ by
    /// this much where walls end.
    pub noise_min: f64,
    /// The noise of a set with fewer than two pairs to learn from. Default 0.02: the median of recorded pairs.
    pub noise_unknown: f64,
    /// A clean fit has at most so many times the noise. Default 2.
    pub clean_factor: f64,
    /// Walls in free space that count for nothing in a clean fit, in metres. Default 0.2.
    pub slack_m: f64,
    /// An accepted pair is doubted only when it has more than so many times the noise. Default 3.
    pub doubt_factor: f64,
    /// Held wall of a candidate that stands out, in metres, at least, where the set knows its noise. Default 8: two sides of
    /// a room.
    pub held_min_m: f64,
    /// Held wall of a candidate that stands out, at least so many times that of any clean wrong one. Default 1.5.
    pub alike_factor: f64,
    /// With so many accepted pairs a set knows its noise. Default 6.
    pub pairs_enough: usize,
    /// Held wall that a set without any accepted pair needs, so many times `held_min_m`. Default 5.
    pub unlearned_factor: f64,
    /// The least probability at which an accepted pair joins maps of a larger set by itself. Default 0.97: a pair of maps of
    /// 0.6 is more often right than wrong, but a fleet has hundreds of pairs, and each wrong one carries others with it.
    pub trusted_min: f64,
    /// Places nearer than this are one: RMS over the walls of a map, in metres. Default 0.7, as within one pair.
    pub apart_m: f64,
}

impl Default for StandardRules {
    fn default() -> Self {
        Self {
            noise_min: 0.005,
            noise_unknown: 0.02,
            clean_factor: 2.0,
            slack_m: 0.2,
            doubt_factor: 3.0,
            held_min_m: 8.0,
            alike_factor: 1.5,
            pairs_enough: 6,
            unlearned_factor: 5.0,
            trusted_min: 0.97,
            apart_m: 0.7,
        }
    }
}

/// How the walls of two maps, or of two groups, lie on each other under one pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[expect(clippy::struct_field_names, reason = "the unit stands in the name, as everywhere")]
pub(super) struct Fit {
    pub(super) matched_m: f64,
    pub(super) violated_m: f64,
    pub(super) weaker_m: f64,
}

impl Fit {
    pub(super) fn of(evidence: &Evidence) -> Self {
        Self {
            matched_m: evidence.matched_wall_m,
            violated_m: evidence.violated_wall_m,
            weaker_m: evidence.weaker_direction_m,
        }
    }

    pub(super) fn seen(agreement: WallAgreement) -> Self {
        Self {
            matched_m: agreement.matched_m,
            violated_m: agreement.violated_m,
            weaker_m: agreement.weaker_m,
        }
    }

    /// Of both together.
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            matched_m: self.matched_m + other.matched_m,
            violated_m: self.violated_m + other.violated_m,
            weaker_m: self.weaker_m + other.weaker_m,
        }
    }

    /// Of two looks at the same walls, of which each may have missed some.
    pub(super) fn most(self, other: Self) -> Self {
        Self {
            matched_m: self.matched_m.max(other.matched_m),
            violated_m: self.violated_m.max(other.violated_m),
            weaker_m: self.weaker_m.max(other.weaker_m),
        }
    }

    /// Wall that is evidence, in metres.
    pub(super) fn held_m(&self) -> f64 {
        self.matched_m.min(2.5 * self.weaker_m)
    }

    /// Share of the compared wall that stands in free space.
    pub(super) fn share(&self) -> f64 {
        let compared = self.matched_m + self.violated_m;
        if compared > 0.0 {
            self.violated_m / compared
        } else {
            0.0
        }
    }

    /// Step 1.
    pub(super) fn merit(&self) -> f64 {
        self.held_m() - 11.0 * self.violated_m
    }
}

/// The standards of one set.
#[derive(Debug, Clone)]
pub(super) struct Standards {
    rules: StandardRules,
    /// Step 2.
    pub(super) noise: f64,
    /// Fits that are known to be wrong.
    wrong: Vec<Fit>,
    /// Held wall of a fit that stands out, at least.
    held_min_m: f64,
}

/// Leading candidates with less held wall teach nothing, in metres.
const TEACHES_M: f64 = 6.0;

impl Standards {
    /// Learns from all pairs. `confirmed` tells which candidate of a pair the layout so far confirms.
    pub(super) fn learn(
        maps: &Maps<'_>,
        pairs: &[PairRecord],
        confirmed: impl Fn(&PairRecord) -> Option<usize>,
    ) -> Self {
        let rules = maps.options.standards;
        let mut taught: Vec<(f64, f64)> = Vec::new();
        let mut wrong = Vec::new();
        let mut accepted_pairs = 0_usize;
        for pair in pairs {
            let leading = match &pair.registration {
                Some(Registration::Accepted(accepted)) => {
                    accepted_pairs += 1;
                    if let Some(rival) = accepted.evidence.runner_up {
                        let [fixed, moving] = [pair.fixed, pair.moving].map(|map| maps.sketched(map));
                        wrong.push(Fit::seen(agreement(fixed, moving, rival.pose_fixed_moving)));
                    }
                    Fit::of(&accepted.evidence)
                }
                Some(Registration::Rejected(rejection)) => {
                    let fits: Vec<Fit> = rejection.candidates.iter().map(|c| Fit::of(&c.evidence)).collect();
                    let best =
                        (0..fits.len()).max_by(|&a, &b| fits[a].merit().total_cmp(&fits[b].merit()).then(b.cmp(&a)));
                    let Some(leading) = confirmed(pair).or(best) else {
                        continue;
                    };
                    wrong.extend(
                        fits.iter()
                            .enumerate()
                            .filter(|(at, _)| *at != leading)
                            .map(|(_, fit)| *fit),
                    );
                    fits[leading]
                }
                None => continue,
            };
            if leading.merit() > 0.0 && leading.held_m() > TEACHES_M {
                taught.push((leading.share(), leading.held_m()));
            }
        }
        let noise = if taught.len() < 2 {
            rules.noise_unknown
        } else {
            lower_quartile(taught)
        };
        #[expect(clippy::cast_precision_loss, reason = "pairs of maps are few")]
        let unlearned = 1.0 - (accepted_pairs as f64 / rules.pairs_enough.max(1) as f64).min(1.0);
        Self {
            rules,
            noise: noise.max(rules.noise_min),
            wrong,
            held_min_m: rules.held_min_m * (1.0 + (rules.unlearned_factor - 1.0) * unlearned),
        }
    }

    /// Wall that a clean fit may have in free space, in metres.
    fn allowed_m(&self, fit: &Fit) -> f64 {
        self.rules.clean_factor * self.noise * (fit.matched_m + fit.violated_m) + self.rules.slack_m
    }

    /// Step 3.
    pub(super) fn clean(&self, fit: &Fit) -> bool {
        fit.violated_m <= self.allowed_m(fit)
    }

    /// Step 4.
    pub(super) fn doubted(&self, fit: &Fit) -> bool {
        let alike = |wrong: &Fit| 2.0 * wrong.held_m() >= fit.held_m() && wrong.share() <= 1.5 * fit.share();
        fit.share() > self.rules.doubt_factor * self.noise && self.wrong.iter().any(alike)
    }

    /// Step 6: whether a pair of a set of `maps` maps may join them by itself.
    pub(super) fn trusted(&self, evidence: &Evidence, maps: usize) -> bool {
        maps <= 2
            || evidence
                .probability
                .is_none_or(|probability| probability >= self.rules.trusted_min)
    }

    /// Step 5: by how much a fit stands out, more than 1; `None` when it does not.
    pub(super) fn stands_out(&self, fit: &Fit) -> Option<f64> {
        let alike = self
            .wrong
            .iter()
            .filter(|wrong| self.clean(wrong))
            .map(Fit::held_m)
            .fold(0.0, f64::max);
        let needed = self.held_min_m.max(self.rules.alike_factor * alike);
        (self.clean(fit) && fit.held_m() > needed).then(|| fit.held_m() / needed)
    }

    /// Whether a fit explains the same maps well enough for another one not to be believed.
    pub(super) fn rivals(&self, rival: &Fit, fit: &Fit) -> bool {
        2.0 * rival.held_m() > fit.held_m() && rival.violated_m <= 3.0 * self.allowed_m(rival)
    }
}

/// Weighted lower quartile of (value, weight).
fn lower_quartile(mut values: Vec<(f64, f64)>) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let all: f64 = values.iter().map(|(_, weight)| weight).sum();
    let mut sum = 0.0;
    for &(value, weight) in &values {
        sum += weight;
        if sum >= 0.25 * all {
            return value;
        }
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fusion::outcome::{PairCheck, PairRole};
    use crate::fusion::scripted::{Scripted, world};
    use crate::geometry::Pose2;
    use crate::registration::{Acceptance, Candidate, Covariance, Reason, Rejection, Unhurried};

    fn fit(matched_m: f64, violated_m: f64, weaker_m: f64) -> Fit {
        Fit {
            matched_m,
            violated_m,
            weaker_m,
        }
    }

    fn evidence(fit: Fit) -> Evidence {
        Evidence {
            score: 0.0,
            probability: None,
            verification_index: None,
            overlap: 0.0,
            matched_wall_m: fit.matched_m,
            violated_wall_m: fit.violated_m,
            weaker_direction_m: fit.weaker_m,
            runner_up: None,
        }
    }

    fn record(registration: Registration) -> PairRecord {
        PairRecord {
            fixed: 0,
            moving: 1,
            check: PairCheck::Registered,
            registration: Some(registration),
            role: PairRole::Unused,
        }
    }

    fn accepted(fit: Fit) -> PairRecord {
        record(Registration::Accepted(Acceptance {
            pose_fixed_moving: Pose2::IDENTITY,
            covariance: Covariance::diagonal(0.02, 0.002),
            evidence: evidence(fit),
            stages: Vec::new(),
        }))
    }

    fn rejected(fits: &[Fit]) -> PairRecord {
        let candidate = |fit: &Fit| Candidate {
            pose_fixed_moving: Pose2::IDENTITY,
            covariance: Covariance::diagonal(0.02, 0.002),
            evidence: evidence(*fit),
        };
        record(Registration::Rejected(Rejection {
            reason: Reason::NoOverlap {
                score: 0.0,
                needed: 1.0,
            },
            candidates: fits.iter().map(candidate).collect(),
            stages: Vec::new(),
        }))
    }

    fn learn(pairs: &[PairRecord]) -> Standards {
        let (_, inputs) = world(2);
        let options = Scripted::default().options().1;
        let maps = Maps::new(&inputs, &options, &Unhurried).expect("two maps");
        Standards::learn(&maps, pairs, |_| None)
    }

    /// Six clean pairs, and one of which one candidate at most is right.
    fn clean_set(dirty: Fit) -> Vec<PairRecord> {
        let mut pairs: Vec<PairRecord> = (0..6).map(|_| accepted(fit(60.0, 0.3, 25.0))).collect();
        pairs.push(rejected(&[fit(80.0, 0.3, 30.0), dirty]));
        pairs
    }

    #[test]
    fn in_a_clean_set_a_pair_like_a_wrong_candidate_is_doubted_and_in_a_dirty_one_it_is_not() {
        let wrong = fit(100.0, 8.0, 40.0);
        let lookalike = fit(110.0, 7.0, 45.0);
        let clean = learn(&clean_set(wrong));
        assert!((clean.noise - 0.005).abs() < 1e-9, "{}", clean.noise);
        assert!(clean.doubted(&lookalike) && !clean.doubted(&fit(60.0, 0.5, 25.0)));
        // nothing wrong looks like it
        assert!(!learn(&clean_set(fit(5.0, 8.0, 2.0))).doubted(&lookalike));
        let mut dirty = clean_set(wrong);
        dirty.truncate(1);
        dirty[0] = accepted(fit(60.0, 4.0, 25.0));
        dirty.push(accepted(fit(50.0, 4.0, 25.0)));
        dirty.push(rejected(&[fit(80.0, 5.0, 30.0), wrong]));
        assert!(!learn(&dirty).doubted(&lookalike));
    }

    #[test]
    fn a_candidate_stands_out_when_it_is_clean_and_larger_than_any_clean_wrong_one() {
        let set = learn(&clean_set(fit(20.0, 0.1, 8.0)));
        assert!(set.stands_out(&fit(40.0, 0.3, 16.0)).is_some_and(|margin| margin > 1.0));
        assert_eq!(
            set.stands_out(&fit(28.0, 0.1, 11.0)),
            None,
            "a wrong one of 20 m is as clean"
        );
        assert_eq!(set.stands_out(&fit(40.0, 2.0, 16.0)), None, "it is not clean");
        assert_eq!(set.stands_out(&fit(90.0, 0.1, 2.0)), None, "a corridor slides");
    }

    #[test]
    fn a_set_without_accepted_pairs_asks_for_more() {
        let candidate = fit(30.0, 0.1, 12.0);
        assert!(learn(&clean_set(Fit::default())).stands_out(&candidate).is_some());
        assert_eq!(learn(&[rejected(&[candidate])]).stands_out(&candidate), None);
    }
}
