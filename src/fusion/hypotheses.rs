//! How two groups of maps may lie: every candidate of every pair between them says where, and every pair between them is
//! asked.
//!
//! **Method.** A candidate of one pair, whatever its method made of it, is a pose of one group in the frame of the other.
//! There the walls of each group are laid over the maps of the other (`body`): a place which only its own pair likes is
//! contradicted by the others. The best place is believed when it stands out by the standards of the set (`standards`),
//! no really different one rivals it, and two of the pairs that propose it are clean by themselves. Rivals are compared by all
//! pairs that say the same: several pairs that agree leave alternatives behind which each of them alone could not.
//! What one pair alone says its method has judged: at least two must propose the place.
//!
//! **Cost.** [`LOOKED_AT`] places for each pair of groups, a look of some 0.1 ms a map for each.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::body::Body;
use super::layout::Layout;
use super::maps::Maps;
use super::outcome::{PairRecord, PairRole};
use super::sketch::agreement;
use super::standards::{Fit, Standards};
use crate::geometry::Pose2;
use crate::registration::Registration;

/// The most places of two groups that are looked at, the best ones by their own pair.
const LOOKED_AT: usize = 24;

/// A place of one group in the frame of the other, on which at least one pair insists.
#[derive(Debug, Clone)]
pub(super) struct Bridge {
    /// The pair and the candidate that it was proposed by; then all others that say the same.
    pub(super) hints: Vec<(usize, usize)>,
    /// Pose of the second group's frame in the first one's.
    pub(super) pose_a_b: Pose2,
    /// By how much it stands out.
    pub(super) margin: f64,
}

/// Where a candidate would lay one group in the frame of the other.
#[derive(Debug, Clone, Copy)]
struct Hint {
    pair: usize,
    candidate: usize,
    pose_a_b: Pose2,
    fit: Fit,
}

/// Two groups.
pub(super) struct Between<'a> {
    /// Their first maps, by which they are named.
    pub(super) firsts: (usize, usize),
    pub(super) bodies: (&'a Body, &'a Body),
    /// Whether each is a single map.
    pub(super) alone: bool,
}

/// So many pairs must propose a place, each by itself: one alone has been judged by its method already, which was not sure.
const PROPOSED_BY: usize = 2;
/// The least held wall of a pair that proposes a place, in metres: half of what stands out.
const PROPOSES_M: f64 = 4.0;

/// The place that is believed, if there is one.
pub(super) fn bridge(
    maps: &Maps<'_>,
    pairs: &[PairRecord],
    layout: &Layout,
    standards: &Standards,
    between: &Between<'_>,
) -> Option<Bridge> {
    let (a, b) = between.firsts;
    let mut hints: Vec<Hint> = hints(maps, pairs, layout, a, b).collect();
    hints.sort_by(by_merit);
    let apart_m = maps.options.standards.apart_m;
    let apart = |one: Pose2, other: Pose2| distance(maps, layout, b, one, other);
    // one place each, the best hint first
    let mut places: Vec<&Hint> = Vec::new();
    for hint in &hints {
        if places.len() < LOOKED_AT
            && places
                .iter()
                .all(|place| apart(place.pose_a_b, hint.pose_a_b) > apart_m)
        {
            places.push(hint);
        }
    }
    let near = |place: &Hint, hint: &Hint| apart(hint.pose_a_b, place.pose_a_b) <= apart_m;
    let seen: Vec<Fit> = places
        .par_iter()
        .map(|place| {
            if between.alone {
                Fit::default()
            } else {
                Fit::seen(between.bodies.0.agreement(maps, between.bodies.1, place.pose_a_b))
            }
        })
        .collect();
    // each pair that says so has looked for itself
    let fits: Vec<Fit> = places
        .iter()
        .zip(&seen)
        .map(|(place, seen)| {
            each_pairs_best(&hints, |hint| near(place, hint))
                .fold(Fit::default(), Fit::plus)
                .most(*seen)
        })
        .collect();
    let best = (0..places.len()).max_by(|&x, &y| fits[x].merit().total_cmp(&fits[y].merit()).then(y.cmp(&x)))?;
    let margin = standards.stands_out(&places[best].fit.most(seen[best]))?;
    let rivalled = (0..places.len()).any(|other| other != best && standards.rivals(&fits[other], &fits[best]));
    let proposes =
        |hint: &&Hint| near(places[best], hint) && standards.clean(&hint.fit) && hint.fit.held_m() >= PROPOSES_M;
    let proposed_by: BTreeSet<usize> = hints.iter().filter(proposes).map(|hint| hint.pair).collect();
    if rivalled || proposed_by.len() < PROPOSED_BY {
        return None;
    }
    Some(Bridge {
        hints: agreeing(maps, pairs, layout, (a, b), places[best].pose_a_b),
        pose_a_b: places[best].pose_a_b,
        margin,
    })
}

/// Pair and candidate of all that say that the second group lies there, the best of each pair, the best pair first.
pub(super) fn agreeing(
    maps: &Maps<'_>,
    pairs: &[PairRecord],
    layout: &Layout,
    (a, b): (usize, usize),
    pose_a_b: Pose2,
) -> Vec<(usize, usize)> {
    let near = |hint: &Hint| distance(maps, layout, b, hint.pose_a_b, pose_a_b) <= maps.options.consistency.tolerance_m;
    let mut hints: Vec<Hint> = hints(maps, pairs, layout, a, b).filter(near).collect();
    hints.sort_by(by_merit);
    let mut agreeing: Vec<(usize, usize)> = Vec::new();
    for hint in hints {
        if agreeing.iter().all(|(pair, _)| *pair != hint.pair) {
            agreeing.push((hint.pair, hint.candidate));
        }
    }
    agreeing
}

/// The fits of the hints that say so, the best of each pair. The hints are sorted.
fn each_pairs_best(hints: &[Hint], says_so: impl Fn(&Hint) -> bool) -> impl Iterator<Item = Fit> {
    let mut seen = BTreeSet::new();
    hints
        .iter()
        .filter(move |hint| says_so(hint) && seen.insert(hint.pair))
        .map(|hint| hint.fit)
}

fn by_merit(x: &Hint, y: &Hint) -> std::cmp::Ordering {
    (y.fit.merit().total_cmp(&x.fit.merit()))
        .then(x.pair.cmp(&y.pair))
        .then(x.candidate.cmp(&y.candidate))
}

/// What the candidates of all pairs between two groups (named by their first maps) say of how they lie; not those that the
/// method would never publish. Of an accepted pair that holds nothing together its own pose (0) and its runner-up (1).
fn hints<'a>(
    maps: &'a Maps<'_>,
    pairs: &'a [PairRecord],
    layout: &'a Layout,
    a: usize,
    b: usize,
) -> impl Iterator<Item = Hint> + 'a {
    let required = maps.method().required_verification();
    pairs.iter().enumerate().flat_map(move |(index, pair)| {
        let [fixed, moving] = [pair.fixed, pair.moving].map(|map| layout.first[map]);
        let between = [fixed, moving] == [a, b] || [fixed, moving] == [b, a];
        let candidates: Vec<(usize, Pose2, Fit)> = match &pair.registration {
            Some(Registration::Rejected(rejection)) if between => {
                let candidates = rejection.candidates.iter().enumerate();
                let publishable = candidates.filter(|(_, candidate)| candidate.evidence.suffices(required));
                publishable
                    .map(|(at, c)| (at, c.pose_fixed_moving, Fit::of(&c.evidence)))
                    .collect()
            }
            Some(Registration::Accepted(accepted)) if between && pair.role != PairRole::Forbidden => {
                let rival = accepted.evidence.runner_up.map(|rival| {
                    let [fixed, moving] = [pair.fixed, pair.moving].map(|map| maps.sketched(map));
                    let pose = rival.pose_fixed_moving;
                    (1, pose, Fit::seen(agreement(fixed, moving, pose)))
                });
                let own = (0, accepted.pose_fixed_moving, Fit::of(&accepted.evidence));
                std::iter::once(own).chain(rival).collect()
            }
            _ => Vec::new(),
        };
        candidates.into_iter().map(move |(candidate, pose_fixed_moving, fit)| {
            let [at_fixed, at_moving] = [pair.fixed, pair.moving].map(|map| layout.places[map].pose);
            let pose = at_fixed * pose_fixed_moving * at_moving.inverse();
            Hint {
                pair: index,
                candidate,
                pose_a_b: if fixed == a { pose } else { pose.inverse() },
                fit,
            }
        })
    })
}

/// How far apart two poses of a group lay its maps, at most.
pub(super) fn distance(maps: &Maps<'_>, layout: &Layout, first: usize, one: Pose2, other: Pose2) -> f64 {
    layout
        .members(first)
        .map(|map| {
            let place = layout.places[map].pose;
            maps.moments[map].distance(one * place, other * place)
        })
        .fold(0.0, f64::max)
}
