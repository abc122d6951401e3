//! What each stage sees of one pair, with the stages before it right.

use crate::experiments::answer::RIGHT_WITHIN_M;
use crate::experiments::frames::far;
use crate::experiments::pairs::LabelledPair;
use crate::experiments::rotations::{apart_modulo_half_turn, nearest};
use crate::fusion::Moments;
use crate::geometry::{Angle, Pose2};
use crate::registration::methods::HoughPeaksParams;
use crate::registration::methods::hough_peaks::{HoughPeaks, Objective, RotationTuning, TranslationTrace};
use crate::registration::overlap::{StateMap, compare};
use crate::registration::{Registration, register};
use crate::simulation::Random;
/// What the stages see of one pair, each with the stages before it right.
pub(super) struct Sight {
    /// Rank of the true rotation among the candidates by f, from 0; `None` when it is not among them.
    pub(super) rank: [Option<usize>; 3],
    /// Whether psi-hat chooses the true rotation among the candidates and their half turns: as printed, circular.
    pub(super) chosen: [bool; 2],
    /// Error of the candidate and of the tuned rotations in degrees: candidate, ours, as printed.
    pub(super) tuning: [f64; 3],
    /// Peaks of the fixed map that are in the moving map as well, and how their votes differ.
    pub(super) vote_differences: Vec<f64>,
    /// Errors of `T_o` in cells at the true rotation: in near frames, in frames anywhere; `None` without a `T_o`.
    pub(super) translation: [Option<f64>; 2],
    /// Distance in cells of the objective's optimum from the truth: entropy, V over both, V over either.
    pub(super) optimum: [f64; 3],
    /// Whether that optimum lies on the border of the search.
    pub(super) at_border: [bool; 3],
    /// V at the truth: over cells known in both, over cells known in one.
    pub(super) v_at_truth: [f64; 2],
    /// V of hypotheses that are wrong.
    pub(super) v_wrong: Vec<f64>,
}

impl Sight {
    pub(super) fn of(pair: &LabelledPair, seed: u64) -> Option<Self> {
        let truth = pair.truth?;
        let (fixed, moving) = (&pair.fixed, &pair.moving);
        let ours = HoughPeaks::new(HoughPeaksParams::default()).ok()?;
        let printed = HoughPeaks::new(HoughPeaksParams {
            rotation_tuning: RotationTuning::PaperWindow,
            ..HoughPeaksParams::default()
        })
        .ok()?;
        let rotations = ours.rotation_trace(fixed, moving);
        let rank = [0, 1, 2].map(|f: usize| {
            let candidates = &rotations.spectra[f].candidates;
            candidates
                .iter()
                .position(|candidate| apart_modulo_half_turn(*candidate, truth.yaw()) <= 2.0)
        });
        let candidates = &rotations.spectra[0].candidates;
        let chosen = [rotations.psi_hat_tangents, rotations.psi_hat_circular].map(|psi| {
            psi.and_then(|psi| nearest(candidates, psi))
                .is_some_and(|c| (c - truth.yaw()).degrees().abs() <= 2.0)
        });
        let candidate = nearest(candidates, truth.yaw())?;
        let off = |angle: Angle| (angle - truth.yaw()).degrees().abs();
        let tuned = [&ours, &printed].map(|method| off(method.tuned_rotation(fixed, moving, candidate)));
        let cell = fixed.lattice().resolution().max(moving.lattice().resolution());
        let trace = ours.translation_trace(fixed, moving, truth.yaw());
        let mut random = Random::new(seed, &[22, fixed.cells().len() as u64]);
        let (elsewhere, far_truth) = far(moving, truth, &mut random);
        let far_trace = ours.translation_trace(fixed, &elsewhere, far_truth.yaw());
        let around = Self::search(&ours, pair, truth, &mut random);
        let maps = [fixed, moving].map(StateMap::new);
        let at_truth = compare(&maps[0], &maps[1], truth);
        Some(Self {
            rank,
            chosen,
            tuning: [off(candidate), tuned[0], tuned[1]],
            vote_differences: vote_differences(&trace, truth, cell),
            translation: [miss(&trace, truth, cell), miss(&far_trace, far_truth, cell)],
            optimum: around.map(|(distance, _)| distance),
            at_border: around.map(|(_, border)| border),
            v_at_truth: [
                at_truth.verification_index().unwrap_or(f64::NAN),
                at_truth.verification_index_over_union().unwrap_or(f64::NAN),
            ],
            v_wrong: wrong_hypotheses(pair, truth),
        })
    }

    /// The optima of the search that begins within 5 cells of the truth: distance from it in cells, and whether on the border.
    fn search(method: &HoughPeaks, pair: &LabelledPair, truth: Pose2, random: &mut Random) -> [(f64, bool); 3] {
        let cell = pair.fixed.lattice().resolution();
        let start = [random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)];
        let pose = Pose2::new(truth.x() + start[0] * cell, truth.y() + start[1] * cell, truth.yaw());
        let objective = method.objective_around(&pair.fixed, &pair.moving, pose);
        // shifts are along the axes of the fixed map's lattice
        let axes = Pose2::new(0.0, 0.0, -pair.fixed.lattice().origin().yaw());
        let [x, y] = axes.apply(start.map(|cells| -cells));
        let reach = objective.iter().flat_map(|o| o.shift).max().unwrap_or(0);
        let values: [fn(&Objective) -> Option<f64>; 3] = [
            |o| Some(o.entropy),
            |o| o.verification_index.map(|v| -v),
            |o| o.verification_index_over_union.map(|v| -v),
        ];
        values.map(|value| {
            let best = objective
                .iter()
                .filter_map(|o| value(o).map(|v| (v, o.shift)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            best.map_or((f64::INFINITY, true), |(_, shift)| {
                let distance = (f64::from(shift[0]) - x).hypot(f64::from(shift[1]) - y);
                (distance, shift.iter().any(|s| s.abs() == reach))
            })
        })
    }
}

/// How far `T_o` is from the truth, in cells.
fn miss(trace: &TranslationTrace, truth: Pose2, cell: f64) -> Option<f64> {
    let [x, y] = trace.approximate?;
    Some((x - truth.x() / cell).hypot(y - truth.y() / cell))
}

/// Differences of the votes of walls that both maps have: peaks within 1 degree and 2 cells of each other at the truth.
fn vote_differences(trace: &TranslationTrace, truth: Pose2, cell: f64) -> Vec<f64> {
    let turn = Pose2::new(0.0, 0.0, truth.yaw());
    let [mx, my] = turn.apply(trace.moving.center);
    // from the fixed image's centre to the moving one's, at the truth
    let offset = [
        mx + truth.x() / cell - trace.fixed.center[0],
        my + truth.y() / cell - trace.fixed.center[1],
    ];
    trace
        .fixed_peaks
        .iter()
        .filter_map(|peak| {
            let same = trace.moving_peaks.iter().filter(|other| {
                let (sin, cos) = other.theta.sin_cos();
                let rho = other.rho + offset[0] * cos + offset[1] * sin;
                (other.theta - peak.theta).degrees().abs() <= 1.0 && (rho - peak.rho).abs() <= 2.0
            });
            same.map(|other| (other.votes - peak.votes).abs())
                .min_by(f64::total_cmp)
        })
        .collect()
}

/// V of the hypotheses that the pipeline verified and that are wrong.
fn wrong_hypotheses(pair: &LabelledPair, truth: Pose2) -> Vec<f64> {
    // a threshold that only a perfect agreement meets: all hypotheses are told
    let params = HoughPeaksParams {
        verification_threshold: 1.0,
        ..HoughPeaksParams::default()
    };
    let method = HoughPeaks::new(params).expect("invariant: 1 is a share");
    let moments = Moments::of(&pair.moving);
    match register(&method, &pair.fixed, &pair.moving, &crate::registration::Unhurried) {
        Registration::Accepted(_) => Vec::new(),
        Registration::Rejected(rejection) => rejection
            .candidates
            .iter()
            .filter(|candidate| moments.distance(candidate.pose_fixed_moving, truth) > RIGHT_WITHIN_M)
            .filter_map(|candidate| candidate.evidence.verification_index)
            .collect(),
    }
}
