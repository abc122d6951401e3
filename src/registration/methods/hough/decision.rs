//! The decision: accept one hypothesis, or say why none.
//!
//! Method. Distinctness tells right from wrong, not goodness of fit: a hypothesis is accepted when no other, at least 0.7 m
//! away, explains the maps comparably. Comparably under which model of the maps' noise, is the question: walls that stand
//! in free space speak against a hypothesis all the more, the cleaner the maps are, and nobody knows how clean they are.
//!
//! 1. Each hypothesis gets scores n KL(q || q0) (see `score`) under four models: `plain` (maps as robots make them),
//!    `strict` (clean maps, where a wall in free space is near-proof against), `lax` (drift and noise), `deep` (only what
//!    stands deep in free space counts, which no noise explains).
//! 2. The probability that it is right, P = 1 / (1 + exp(-w . x)), where x holds the logarithms of its scores, those of
//!    the ratios of its best rival's scores to its own, the share of the maps that it explains, the greatest share found
//!    of any rival of comparable extent (what chance, or the building's own repetition, reaches on THESE two maps), and
//!    what holds the weaker direction. Accepted from `posterior_min` on.
//! 3. Whatever P says, it is refused when a rival stands by itself under the strict model (two self-consistent
//!    explanations), when too much is contradicted, when the weaker direction is not held, when another hypothesis finds
//!    many times more wall, or when great maps agree in a small corner only: more wall, more chances (but a small map that
//!    lies whole in a great one has no more walls to agree). Or when V is low: the
//!    few walls that two maps have in common may agree where their free space does not.
//! 4. `same`: all but `same_max` of the walls of both maps are found, and no rival has half of the score. P would mistrust
//!    such a pair, since equal rooms of one building look like that, but for a last few walls.
//! 5. `bent`: great maps that fit only in part, by any model: so much wall is found as nowhere else.
//!
//! Rules 2, 4 and 5 must not name two hypotheses.
//!
//! How it was fitted, and what it reaches: see the module's root.

use super::params::{DecisionParameters, PosteriorTerms};
use super::placement::{Moments, Placement};
use super::refine::Refined;
use super::score::{Score, Tally, kullback};

/// Hypotheses nearer than this are one, metres.
pub(super) const RIVAL_M: f64 = 0.7;
/// The same for maps that are bent.
const BENT_RIVAL_M: f64 = 1.5;
/// A rival is of comparable extent from this share of the wall found on.
const COMPARABLE: f32 = 0.3;
/// Added to both scores of a ratio, so that it means nothing when both are tiny.
const OFFSET: f32 = 5.0;

/// A hypothesis after the fine refinement, with its scores.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finalist {
    pub(super) refined: Refined,
    pub(super) score: Score,
    pub(super) plain: f32,
    strict: f32,
    lax: f32,
    deep: f32,
    bent: f32,
    /// Samples that hold the weaker direction.
    pub(super) support: f32,
    /// Direction in which the maps slide, radians in the fixed map's local frame.
    pub(super) free_direction: f32,
}

/// What to answer. The hypothesis in question stands first among the ranked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Verdict {
    /// By this rule.
    Accept(Rule),
    NoOverlap,
    Ambiguous,
    UnderConstrained,
}

/// By what a hypothesis is accepted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Rule {
    /// Its probability.
    Likely,
    /// The maps are the same.
    Same,
    /// Great maps that fit only in part.
    Bent,
    /// It was known from elsewhere.
    Known,
}

impl Finalist {
    pub(super) fn new(refined: Refined, score: Score) -> Self {
        let mean = &score.mean;
        let misses = |straight: f32, clutter: f32| {
            straight * mean.violated_straight + clutter * mean.violated_clutter + 0.5 * mean.crossed
        };
        let (support, free_direction) = mean.weaker_direction();
        Self {
            refined,
            score,
            plain: kullback(mean.soft, misses(2.0, 0.5), 0.45),
            strict: kullback(mean.soft, misses(5.0, 1.5), 0.5),
            lax: kullback(mean.soft, mean.violated() + 0.3 * mean.crossed, 0.4),
            deep: kullback(
                mean.soft + 0.3 * mean.near,
                2.0 * mean.deep_straight + 0.5 * mean.deep_clutter + 0.3 * mean.crossed,
                0.45,
            ),
            bent: (mean.soft + 0.5 * mean.near - 0.25 * mean.violated()).max(0.0),
            support,
            free_direction,
        }
    }

    pub(super) fn placement(&self) -> Placement {
        self.refined.placement
    }

    /// Wall samples of both maps, their mean.
    fn extent(&self) -> f32 {
        extent(&self.score.mean)
    }

    /// Wall samples of the map that has more, but at most so many times those of the other.
    fn comparable_extent(&self, times: f32) -> f32 {
        let (a, b) = (extent(&self.score.moving), extent(&self.score.fixed));
        a.max(b).min(times * a.min(b))
    }
}

fn extent(tally: &Tally) -> f32 {
    tally.found + tally.crossed + tally.near + tally.violated() + tally.unknown
}

/// Best first by the plain score; hypotheses that came to lie together are one.
pub(super) fn rank(mut finalists: Vec<Finalist>, moving: Moments) -> Vec<Finalist> {
    finalists.sort_by(|a, b| b.plain.total_cmp(&a.plain).then(b.bent.total_cmp(&a.bent)));
    let mut ranked: Vec<Finalist> = Vec::new();
    for finalist in finalists {
        let apart =
            |other: &Finalist| other.placement().distance(finalist.placement(), moving) > super::shortlist::SAME_M;
        if ranked.iter().all(apart) {
            ranked.push(finalist);
        }
    }
    ranked
}

/// The best hypothesis that is really different from the one at `index`.
pub(super) fn rival(ranked: &[Finalist], index: usize, moving: Moments) -> Option<usize> {
    let me = ranked[index].placement();
    (0..ranked.len()).find(|&other| other != index && ranked[other].placement().distance(me, moving) > RIVAL_M)
}

/// Decides, and puts the hypothesis that it speaks of in front.
pub(super) fn decide(ranked: &mut [Finalist], moving: Moments, parameters: &DecisionParameters) -> Verdict {
    let field = Field { ranked, moving };
    let likely = (field.same(parameters).map(|index| (index, Rule::Same)))
        .or_else(|| field.likely(parameters).map(|index| (index, Rule::Likely)));
    let bent = field.bent(parameters);
    let same = if bent.is_some() { 1.0 } else { RIVAL_M };
    match (likely, bent) {
        (Some((one, _)), Some(other)) if ranked[one].placement().distance(ranked[other].placement(), moving) > same => {
            Verdict::Ambiguous
        }
        (Some((chosen, rule)), _) => accept(ranked, chosen, rule),
        (None, Some(chosen)) => accept(ranked, chosen, Rule::Bent),
        (None, None) => {
            let top = &ranked[0];
            if top.plain <= parameters.score_min {
                Verdict::NoOverlap
            } else if top.support <= 10.0 * parameters.support_min_m {
                Verdict::UnderConstrained
            } else {
                Verdict::Ambiguous
            }
        }
    }
}

fn accept(ranked: &mut [Finalist], chosen: usize, rule: Rule) -> Verdict {
    ranked[..=chosen].rotate_right(1);
    Verdict::Accept(rule)
}

/// The probability that a hypothesis is right (step 2), in [0, 1].
pub(super) fn probability(ranked: &[Finalist], index: usize, moving: Moments, weights: &PosteriorTerms) -> f32 {
    sigmoid(Field { ranked, moving }.logit(index, weights))
}

/// What speaks for and against a hypothesis (x of step 2).
pub(super) fn terms(ranked: &[Finalist], index: usize, moving: Moments) -> PosteriorTerms {
    Field { ranked, moving }.terms(index)
}

fn sigmoid(logit: f32) -> f32 {
    1.0 / (1.0 + (-logit).exp())
}

/// Whether the walls confirm a placement known from elsewhere: found near it, held, and seldom contradicted. There is
/// no runner-up to compare with.
pub(super) fn confirm(
    finalist: &Finalist,
    expected: Placement,
    moving: Moments,
    parameters: &DecisionParameters,
) -> Verdict {
    let mean = &finalist.score.mean;
    let share = mean.soft / (mean.soft + mean.violated()).max(1.0);
    if finalist.placement().distance(expected, moving) > RIVAL_M || share < parameters.share_min {
        Verdict::NoOverlap
    } else if finalist.support <= 10.0 * parameters.support_min_m {
        Verdict::UnderConstrained
    } else if finalist.plain > parameters.score_min {
        Verdict::Accept(Rule::Known)
    } else {
        Verdict::NoOverlap
    }
}

/// The hypotheses, and how far they are from each other.
struct Field<'a> {
    ranked: &'a [Finalist],
    moving: Moments,
}

impl Field<'_> {
    fn best(&self, score: impl Fn(&Finalist) -> f32) -> usize {
        let mut best = 0;
        for (index, finalist) in self.ranked.iter().enumerate() {
            if score(finalist) > score(&self.ranked[best]) {
                best = index;
            }
        }
        best
    }

    fn rivals(&self, index: usize, apart_m: f64) -> impl Iterator<Item = &Finalist> {
        let me = self.ranked[index].placement();
        self.ranked
            .iter()
            .filter(move |other| other.placement().distance(me, self.moving) > apart_m)
    }

    fn best_rival(&self, index: usize, apart_m: f64, score: impl Fn(&Finalist) -> f32) -> f32 {
        self.rivals(index, apart_m).map(score).fold(0.0, f32::max)
    }

    /// Rules 2 and 3.
    fn likely(&self, parameters: &DecisionParameters) -> Option<usize> {
        let mut best = (f32::MIN, 0);
        for index in 0..self.ranked.len() {
            let logit = self.logit(index, &parameters.weights);
            if logit > best.0 {
                best = (logit, index);
            }
        }
        let (logit, index) = best;
        (sigmoid(logit) >= parameters.posterior_min && self.stands(index, parameters)).then_some(index)
    }

    /// w . x of rule 2.
    fn logit(&self, index: usize, weights: &PosteriorTerms) -> f32 {
        weights.dot(&self.terms(index))
    }

    /// x of rule 2.
    fn terms(&self, index: usize) -> PosteriorTerms {
        let me = &self.ranked[index];
        let mean = &me.score.mean;
        let ratio = |score: fn(&Finalist) -> f32| {
            ((self.best_rival(index, RIVAL_M, score) + OFFSET) / (score(me) + OFFSET)).ln()
        };
        let chance = self
            .rivals(index, RIVAL_M)
            .filter(|rival| rival.bent > COMPARABLE * me.bent)
            .map(|rival| {
                let mean = &rival.score.mean;
                mean.soft / (mean.soft + mean.violated()).max(1.0)
            })
            .fold(0.0, f32::max);
        PosteriorTerms {
            constant: 1.0,
            plain: (me.plain + OFFSET).ln(),
            deep: (me.deep + OFFSET).ln(),
            support: (me.support + 1.0).ln(),
            plain_ratio: ratio(|f| f.plain),
            strict_ratio: ratio(|f| f.strict),
            lax_ratio: ratio(|f| f.lax),
            cover: mean.soft / me.extent().max(1.0),
            chance,
            straight: mean.found_straight / mean.found.max(1.0),
            clutter: mean.violated_clutter / mean.soft.max(1.0),
        }
    }

    /// Rule 3.
    fn stands(&self, index: usize, parameters: &DecisionParameters) -> bool {
        let me = &self.ranked[index];
        let mean = &me.score.mean;
        let strict_rival = self.best_rival(index, RIVAL_M, |f| f.strict);
        let two_explanations =
            strict_rival > parameters.rival_min && strict_rival > parameters.rival_share_max * me.strict;
        let against = (mean.violated_straight + 0.5 * mean.violated_clutter) / mean.soft.max(1.0);
        let outdone = self.best_rival(index, RIVAL_M, |f| f.bent) > parameters.outdone_ratio * me.bent;
        let grown =
            parameters.score_per_m * (0.1 * me.comparable_extent(parameters.extent_times) - parameters.extent_m);
        let held = me.support > 10.0 * parameters.support_min_m;
        held && !two_explanations && against < parameters.against_max && !outdone && me.plain > grown
    }

    /// Rule 4.
    fn same(&self, parameters: &DecisionParameters) -> Option<usize> {
        let index = self.best(|f| f.plain);
        let best = &self.ranked[index];
        let mean = &best.score.mean;
        let other = mean.crossed + mean.violated() + mean.unknown;
        let alone = self.best_rival(index, RIVAL_M, |f| f.plain) < 0.5 * best.plain;
        let held = best.support > 10.0 * parameters.support_min_m;
        (other < parameters.same_max * best.extent() && alone && held && best.plain > parameters.score_min)
            .then_some(index)
    }

    /// Rule 5.
    fn bent(&self, parameters: &DecisionParameters) -> Option<usize> {
        let index = self.best(|f| f.bent);
        let best = &self.ranked[index];
        let second = self.best_rival(index, BENT_RIVAL_M, |f| f.bent);
        let ratio = (second + 10.0 * OFFSET) / (best.bent + 10.0 * OFFSET);
        let mean = &best.score.mean;
        let share = mean.soft / (mean.soft + mean.violated());
        let rule = &parameters.bent;
        (best.bent > 10.0 * rule.wall_min_m
            && ratio < rule.ratio_max
            && share > rule.share_min
            && share < rule.share_max)
            .then_some(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hypothesis under which all of a map's walls are found in another, which has so many times more of them.
    fn within(walls_m: f32, times: f32) -> Finalist {
        let found = 10.0 * walls_m;
        let moving = Tally {
            found,
            found_straight: found,
            soft: found,
            scatter: [0.5 * found, 0.0, 0.5 * found],
            ..Tally::default()
        };
        let fixed = Tally {
            unknown: (times - 1.0) * found,
            ..moving
        };
        let mean = Tally {
            unknown: 0.5 * fixed.unknown,
            ..moving
        };
        let score = Score {
            moving,
            fixed,
            mean,
            significance: 0.0,
        };
        let refined = Refined {
            placement: Placement {
                x: 0.0,
                y: 0.0,
                yaw: 0.0,
            },
            information: [[0.0; 3]; 3],
            pivot: [0.0; 2],
            variance: 0.0,
        };
        Finalist::new(refined, score)
    }

    #[test]
    fn a_map_that_lies_whole_in_a_great_one_is_enough_and_a_corner_of_two_great_ones_is_not() {
        let parameters = DecisionParameters::default();
        let stands = |finalist: Finalist| {
            let field = Field {
                ranked: &[finalist],
                moving: Moments::default(),
            };
            field.stands(0, &parameters)
        };
        assert!(stands(within(300.0, 1.0)));
        assert!(stands(within(300.0, 40.0)));
        let mut corner = within(300.0, 40.0);
        corner.score.moving = corner.score.fixed;
        assert!(!stands(corner));
    }
}
