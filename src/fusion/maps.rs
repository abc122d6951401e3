//! The maps of a set in the order in which they are gone through, with what the method has computed of each.

use rayon::prelude::*;

use super::input::{KnownPair, Prior, WeldInput, WeldOptions};
use super::outcome::WeldError;
use super::sketch::{Sketch, Sketched};
use super::{Edge, Moments};
use crate::geometry::Pose2;
use crate::registration::{Control, Covariance, MapFeatures, Method, StageTime, Stop};

/// The anchor comes first (index 0), then the others by name.
pub(super) struct Maps<'a> {
    pub(super) options: &'a WeldOptions,
    pub(super) control: &'a dyn Control,
    pub(super) inputs: Vec<&'a WeldInput>,
    /// Index of each map among the caller's inputs.
    pub(super) given: Vec<usize>,
    pub(super) features: Vec<MapFeatures>,
    pub(super) moments: Vec<Moments>,
    sketches: Vec<Sketch>,
}

impl<'a> Maps<'a> {
    pub(super) fn new(
        inputs: &'a [WeldInput],
        options: &'a WeldOptions,
        control: &'a dyn Control,
    ) -> Result<Self, WeldError> {
        check(inputs, options)?;
        let mut given: Vec<usize> = (0..inputs.len()).collect();
        given.sort_by(|&a, &b| {
            let key = |index: usize| (index != options.anchor, &inputs[index].name, index);
            key(a).cmp(&key(b))
        });
        let ordered: Vec<&WeldInput> = given.iter().map(|&index| &inputs[index]).collect();
        let (features, sketches): (Vec<_>, Vec<_>) = ordered
            .par_iter()
            .map(|input| {
                let features = input.features.clone();
                let features = features.unwrap_or_else(|| options.method.features(&input.grid));
                (features, Sketch::of(&input.grid, options.contradiction.tolerance_m))
            })
            .unzip();
        Ok(Self {
            options,
            control,
            inputs: ordered,
            given,
            features,
            moments: sketches.iter().map(|sketch| sketch.moments).collect(),
            sketches,
        })
    }

    pub(super) fn len(&self) -> usize {
        self.inputs.len()
    }

    pub(super) fn sketched(&self, map: usize) -> Sketched<'_> {
        (&self.inputs[map].grid, &self.sketches[map])
    }

    pub(super) fn method(&self) -> &dyn Method {
        &*self.options.method
    }

    /// Index here of a map that the caller names by its index among the inputs.
    fn here(&self, given: usize) -> usize {
        let at = self.given.iter().position(|&index| index == given);
        at.expect("invariant: indices of the inputs were checked")
    }

    pub(super) fn is_forbidden(&self, a: usize, b: usize) -> bool {
        let pair = [self.given[a], self.given[b]];
        let named = |forbidden: &[usize; 2]| *forbidden == pair || *forbidden == [pair[1], pair[0]];
        self.options.forbidden.iter().any(named)
    }

    /// A pair that was registered before, with its maps named by their index here. Not one that was accepted by less than
    /// the method requires now: it is registered again.
    pub(super) fn remembered(&self) -> impl Iterator<Item = (usize, usize, &'a KnownPair)> {
        let required = self.method().required_verification();
        let suffices = move |pair: &&KnownPair| {
            let accepted = pair.registration.accepted();
            accepted.is_none_or(|accepted| accepted.evidence.suffices(required))
        };
        let known = self.options.known_pairs.iter().filter(suffices);
        known.map(|pair| (self.here(pair.fixed), self.here(pair.moving), pair))
    }

    /// What operators have fixed, as edges that are never doubted: from the anchor, and between other maps.
    pub(super) fn certain_edges(&self) -> Vec<Edge> {
        let certain = |a: usize, b: usize, pose_a_b: Pose2| Edge {
            a,
            b,
            pose_a_b,
            covariance: Covariance::diagonal(1e-3, 1e-4),
            weight: 0.0,
            certain: true,
        };
        let fixed = self
            .inputs
            .iter()
            .enumerate()
            .filter_map(|(map, input)| match input.prior {
                Some(Prior::Fixed(pose)) if map != 0 => Some(certain(0, map, pose)),
                _ => None,
            });
        let pairs = self.options.fixed_pairs.iter().map(|pair| {
            let (fixed, moving) = (self.here(pair.fixed), self.here(pair.moving));
            if moving == 0 {
                certain(moving, fixed, pair.pose_fixed_moving.inverse())
            } else {
                certain(fixed, moving, pair.pose_fixed_moving)
            }
        });
        fixed.chain(pairs).collect()
    }

    /// Whether an operator has said where a map lies.
    pub(super) fn is_fixed(&self, map: usize) -> bool {
        self.certain_edges().iter().any(|edge| edge.b == map)
    }

    /// The poses that nothing moves: the anchor's and those that operators have fixed.
    pub(super) fn held(&self) -> Vec<(usize, Pose2)> {
        let certain = self.certain_edges();
        let from_anchor = certain.iter().filter(|edge| edge.a == 0);
        let fixed = from_anchor.map(|edge| (edge.b, edge.pose_a_b));
        std::iter::once((0, Pose2::IDENTITY)).chain(fixed).collect()
    }

    pub(super) fn go_on(&self) -> Result<(), WeldError> {
        match self.control.should_stop() {
            Some(stop) => Err(WeldError::Stopped(stop)),
            None => Ok(()),
        }
    }
}

/// Takes the time of stages one after the other.
pub(super) struct Stages<'a> {
    control: &'a dyn Control,
    since: std::time::Duration,
    times: Vec<StageTime>,
}

impl<'a> Stages<'a> {
    pub(super) fn start(control: &'a dyn Control) -> Self {
        Self {
            control,
            since: control.now(),
            times: Vec::new(),
        }
    }

    /// The stage that ran since the last one has ended.
    pub(super) fn ended(&mut self, stage: &'static str) {
        let now = self.control.now();
        self.times.push(StageTime {
            stage,
            duration: now.saturating_sub(self.since),
        });
        self.since = now;
    }

    pub(super) fn times(self) -> Vec<StageTime> {
        self.times
    }
}

/// A registration that was stopped is no answer.
pub(super) fn stop_of(registration: &crate::registration::Registration) -> Option<Stop> {
    use crate::registration::{Reason, Registration};
    match registration {
        Registration::Rejected(rejection) => match rejection.reason {
            Reason::Deadline => Some(Stop::Deadline),
            Reason::Cancelled => Some(Stop::Cancelled),
            _ => None,
        },
        Registration::Accepted(_) => None,
    }
}

fn check(inputs: &[WeldInput], options: &WeldOptions) -> Result<(), WeldError> {
    let maps = inputs.len();
    if maps == 0 {
        return Err(WeldError::NoMaps);
    }
    let forbidden = options
        .forbidden
        .iter()
        .flatten()
        .map(|&index| ("a forbidden pair", index));
    let known = options.known_pairs.iter().flat_map(|pair| [pair.fixed, pair.moving]);
    let fixed_pairs = options.fixed_pairs.iter().map(|pair| [pair.fixed, pair.moving]);
    let tied = fixed_pairs.clone().flatten().map(|index| ("a fixed pair", index));
    let named = std::iter::once(("the anchor", options.anchor))
        .chain(forbidden)
        .chain(tied)
        .chain(known.map(|index| ("a known pair", index)));
    for (what, index) in named {
        if index >= maps {
            return Err(WeldError::NoSuchMap { what, index, maps });
        }
    }
    let anchor = &inputs[options.anchor];
    if matches!(anchor.prior, Some(Prior::Fixed(pose)) if pose != Pose2::IDENTITY) {
        return Err(WeldError::AnchorFixedElsewhere(anchor.name.clone()));
    }
    let fixed = |index: usize| index == options.anchor || matches!(inputs[index].prior, Some(Prior::Fixed(_)));
    let fixed_to = |pair: [usize; 2]| {
        fixed_pairs
            .clone()
            .any(|tied| tied == pair || tied == [pair[1], pair[0]])
    };
    let held = |[a, b]: [usize; 2]| a != b && (fixed(a) && fixed(b) || fixed_to([a, b]));
    match options.forbidden.iter().find(|pair| held(**pair)) {
        Some(&[a, b]) => Err(WeldError::FixedAndForbidden(
            inputs[a].name.clone(),
            inputs[b].name.clone(),
        )),
        None => Ok(()),
    }
}
