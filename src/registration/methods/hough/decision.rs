//! The decision: accept one hypothesis, or say why none.
//!
//! Method. Distinctness tells right from wrong, not goodness of fit: a hypothesis is accepted when no other, at least 0.7 m
//! away, explains the maps comparably. Comparably under which model of the maps' noise, is the question: walls that stand
//! in free space speak against a hypothesis all the more, the cleaner the maps are, and nobody knows how clean they are.
//! So each hypothesis gets three scores, and four rules each name the hypothesis that they would accept:
//!
//! 1. `plain`: maps as robots make them. Significance (see `score`) with misses = 2 straight + 0.5 clutter + 0.5 crossed
//!    and the chance rate 0.45.
//! 2. `strict`: clean maps, where a wall in free space is near-proof against. Misses = 5 straight + 1.5 clutter +
//!    0.5 crossed, chance rate 0.5. It settles places that repeat, where each explains the maps nearly as well.
//! 3. `coarse`: wide or cluttered places at coarse cells, where even the truth is contradicted here and there, but all
//!    else finds next to nothing: share found - 0.6 of the contradicted, against a chance rate measured on THESE two maps:
//!    the greatest share found that any other hypothesis of comparable extent reaches.
//! 4. `bent`: great maps that fit only in part: so much wall is found as nowhere else.
//!
//! The rules must not name two hypotheses. 1 and 2 also refuse when another hypothesis finds much more wall, even
//! though with more contradictions, and the least score grows with the maps: more wall, more chances.
//!
//! How it was fitted, and what it reaches: see the module's root.

use super::params::{DecisionParameters, RuleParameters};
use super::placement::{Moments, Placement};
use super::refine::Refined;
use super::score::{Score, Tally, kullback};

/// Hypotheses nearer than this are one, metres.
pub(super) const RIVAL_M: f64 = 0.7;
/// The same for maps that are bent.
const BENT_RIVAL_M: f64 = 1.5;
/// Added to both scores of a ratio, so that it means nothing when both are tiny.
const OFFSET: f32 = 5.0;

/// A hypothesis after the fine refinement, with its scores.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finalist {
    pub(super) refined: Refined,
    pub(super) score: Score,
    pub(super) plain: f32,
    strict: f32,
    coarse: f32,
    bent: f32,
    /// Samples that hold the weaker direction.
    pub(super) support: f32,
    /// Direction in which the maps slide, radians in the fixed map's local frame.
    pub(super) free_direction: f32,
}

/// What to answer. The hypothesis in question stands first among the ranked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Verdict {
    Accept,
    NoOverlap,
    Ambiguous,
    UnderConstrained,
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
            coarse: mean.soft - 0.6 * contradicted(mean),
            bent: (mean.soft + 0.5 * mean.near - 0.25 * mean.violated()).max(0.0),
            support,
            free_direction,
        }
    }

    pub(super) fn placement(&self) -> Placement {
        self.refined.placement
    }

    /// Straight walls deep in free space, in shares of what is found: no matter of noise.
    fn deep_share(&self) -> f32 {
        self.score.mean.deep_straight / self.score.mean.soft.max(1.0)
    }

    /// Wall samples of both maps, their mean.
    fn extent(&self) -> f32 {
        let mean = &self.score.mean;
        mean.found + mean.crossed + mean.near + mean.violated() + mean.unknown
    }
}

/// All that speaks against a hypothesis, for the coarse rule.
fn contradicted(mean: &Tally) -> f32 {
    mean.violated() + 0.3 * mean.crossed
}

/// Best first by the plain score; hypotheses that came to lie together are one.
pub(super) fn rank(mut finalists: Vec<Finalist>, moving: Moments) -> Vec<Finalist> {
    finalists.sort_by(|a, b| b.plain.total_cmp(&a.plain).then(b.coarse.total_cmp(&a.coarse)));
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
    let plain = field
        .distinct(|f| f.plain, &parameters.plain, parameters)
        .filter(|&index| ranked[index].deep_share() <= parameters.deep_max);
    let strict = field
        .distinct(|f| f.strict, &parameters.strict, parameters)
        .filter(|&index| field.settled(index, parameters));
    let coarse = field.coarse(parameters);
    let bent = field.bent(parameters);
    let same = if bent.is_some() { 1.0 } else { RIVAL_M };
    let named: Vec<usize> = [plain, strict, coarse, bent].into_iter().flatten().collect();
    if let Some(&chosen) = named.first() {
        let me = ranked[chosen].placement();
        if named
            .iter()
            .all(|&other| ranked[other].placement().distance(me, moving) <= same)
        {
            ranked[..=chosen].rotate_right(1);
            return Verdict::Accept;
        }
        return Verdict::Ambiguous;
    }
    let top = &ranked[0];
    if top.plain <= field.least(0, &parameters.plain, parameters) {
        Verdict::NoOverlap
    } else if top.support <= parameters.plain.support_min_m * 10.0 {
        Verdict::UnderConstrained
    } else {
        Verdict::Ambiguous
    }
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
    if finalist.placement().distance(expected, moving) > RIVAL_M || share < parameters.coarse.share_min {
        Verdict::NoOverlap
    } else if finalist.support <= 10.0 * parameters.plain.support_min_m {
        Verdict::UnderConstrained
    } else if finalist.plain > parameters.plain.score_min {
        Verdict::Accept
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

    /// The least score: more wall, more chances.
    fn least(&self, index: usize, rule: &RuleParameters, parameters: &DecisionParameters) -> f32 {
        let grown = parameters.plain.score_min * 0.1 * self.ranked[index].extent() / parameters.extent_m;
        rule.score_min.max(grown)
    }

    /// Whether a strict winner is also ahead by the plain score, or all the clearer by its own.
    fn settled(&self, index: usize, parameters: &DecisionParameters) -> bool {
        let best = &self.ranked[index];
        let plain = self.best_rival(index, RIVAL_M, |f| f.plain) / best.plain.max(1.0);
        let strict = (self.best_rival(index, RIVAL_M, |f| f.strict) + OFFSET) / (best.strict + OFFSET);
        plain <= parameters.strict_plain_ratio || (plain <= 1.0 && strict <= parameters.strict_settled_ratio)
    }

    /// Rules 1 and 2.
    fn distinct(
        &self,
        score: impl Fn(&Finalist) -> f32,
        rule: &RuleParameters,
        parameters: &DecisionParameters,
    ) -> Option<usize> {
        let index = self.best(&score);
        let best = &self.ranked[index];
        let (first, second) = (score(best), self.best_rival(index, RIVAL_M, &score));
        let ratio = (second + OFFSET) / (first + OFFSET);
        let alone = ratio < rule.ratio_max || (ratio < rule.ratio_weak_max && second < rule.rival_max);
        let enough = first > self.least(index, rule, parameters) && best.support > 10.0 * rule.support_min_m;
        let outdone = self.best_rival(index, RIVAL_M, |f| f.plain) > parameters.outdone_score
            && self.best_rival(index, RIVAL_M, |f| f.bent) > parameters.outdone_ratio * best.bent;
        (alone && enough && !outdone).then_some(index)
    }

    /// Rule 3.
    fn coarse(&self, parameters: &DecisionParameters) -> Option<usize> {
        let index = self.best(|f| f.coarse);
        let best = &self.ranked[index];
        let mean = &best.score.mean;
        let second = self.best_rival(index, RIVAL_M, |f| f.coarse);
        let ratio = (second + 2.0 * OFFSET) / (best.coarse + 2.0 * OFFSET);
        let evidence = |f: &Finalist| f.score.mean.soft + contradicted(&f.score.mean);
        let chance = self
            .rivals(index, RIVAL_M)
            .filter(|rival| evidence(rival) >= 0.3 * evidence(best))
            .map(|rival| rival.score.mean.soft / evidence(rival))
            .fold(0.4, f32::max);
        let significance = kullback(mean.soft, contradicted(mean), chance.min(0.999));
        // Depth tells: a wall deep in free space is no matter of noise.
        let against = 1.5 * mean.deep_straight + 0.5 * mean.deep_clutter + 0.5 * mean.violated();
        let share = mean.soft / (mean.soft + against);
        let rule = &parameters.coarse;
        (ratio < rule.ratio_max
            && share > rule.share_min
            && best.deep_share() <= rule.deep_max
            && best.support > 10.0 * rule.support_min_m
            && significance > rule.significance_min)
            .then_some(index)
    }

    /// Rule 4.
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
