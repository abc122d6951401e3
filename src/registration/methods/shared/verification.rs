//! Verification of a hypothesis (eq. 33 and 34), what else speaks for it, and the rule that accepts it.
//!
//! **Method.**
//!
//! 1. V over the cells known in both maps, at their own resolutions (eq. 33, 34; see `overlap`).
//! 2. Walls: an occupied cell of one map matches when an occupied cell of the other lies in its cell or next to it; it is
//!    violated when it does not and its cell is free in the other map. The scatter of the matched walls' normals tells in
//!    which direction the pose is held worst.
//! 3. The hypotheses of enough overlap come first, then those of greater V; the first is accepted when its V reaches the
//!    threshold, or when the caller asked for an answer below it.
//!
//! **Fails when** V is taken for proof: at wrong poses free space agrees with free space, and more than half of them have
//! V above 92 % on real maps.
//!
//! **Differences from the paper.** See `overlap`, for what counts as disagreement. A least overlap is asked for.

use serde::{Deserialize, Serialize};

use super::hough_image::to_f64;
use super::map::{Map, turned};
use crate::geometry::{Point, Pose2};
use crate::grid::CellState;
use crate::registration::methods::ParameterError;
use crate::registration::overlap::{Comparison, compare};
use crate::registration::{Candidate, Covariance, Evidence, Reason, RunnerUp};

/// Error of a right answer in cells, on each axis amid the common area: measured on maps of known poses.
const SIGMA_CELLS: f64 = 1.5;
/// Error of a right answer's rotation in radians: a quarter of a degree, measured likewise.
const SIGMA_RAD: f64 = 0.0044;
/// Hypotheses nearer to each other than this RMS distance in metres are one: the tolerance by which answers are judged.
const SAME_WITHIN_M: f64 = 0.5;
/// At most so many hypotheses are told.
const CANDIDATES: usize = 16;

/// Which cells count as disagreement (eq. 33).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Disagreement {
    /// Cells known in both maps, of two states.
    #[default]
    KnownInBoth,
    /// The paper's words: cells known in at least one map and of unequal state. No partial overlap reaches 92 % so.
    KnownInOne,
}

/// When a hypothesis is accepted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rule {
    /// What V counts.
    pub(crate) disagreement: Disagreement,
    /// The V that an answer needs, in [0, 1] (eq. 34).
    pub(crate) threshold: f64,
    /// The overlap that an answer needs, in [0, 1].
    pub(crate) overlap_min: f64,
    /// The caller asked for the best hypothesis whatever its V.
    pub(crate) accept_unverified: bool,
}

impl Rule {
    /// The V that whatever is published must have; none when the caller asked for answers below the threshold.
    pub(crate) fn required(&self) -> Option<f64> {
        (!self.accept_unverified).then_some(self.threshold)
    }

    /// Whether threshold and overlap are shares, by the names that they have in every method's parameters.
    pub(crate) fn check(&self) -> Result<(), ParameterError> {
        ParameterError::check("verification_threshold", self.threshold, 0.0, 1.0, "(a share)")?;
        ParameterError::check("overlap_min", self.overlap_min, 0.0, 1.0, "(a share)")
    }

    /// The best of ranked hypotheses, or why it is not accepted.
    pub(crate) fn verdict(&self, best: Option<&Candidate>) -> Result<Candidate, Reason> {
        let nothing = Reason::NoOverlap {
            score: 0.0,
            needed: self.threshold,
        };
        let best = best.ok_or(nothing)?;
        match best.evidence.verification_index {
            None => Err(nothing),
            // Departs from section 4.3, which asks for V alone: a least overlap as well.
            Some(_) if best.evidence.overlap < self.overlap_min => Err(Reason::NoOverlap {
                score: best.evidence.overlap,
                needed: self.overlap_min,
            }),
            Some(index) if index >= self.threshold || self.accept_unverified => Ok(best.clone()),
            Some(verification_index) => Err(Reason::VerificationFailed {
                verification_index,
                threshold: self.threshold,
            }),
        }
    }
}

/// The paper's V of a comparison, by the chosen disagreement.
pub(crate) fn verification_index(comparison: &Comparison, disagreement: Disagreement) -> Option<f64> {
    match disagreement {
        Disagreement::KnownInBoth => comparison.verification_index(),
        Disagreement::KnownInOne => comparison.verification_index_over_union(),
    }
}

/// A hypothesis with its evidence. `maps` are in their own cells, `fixed` and `moving` in cells of one size; `support_m` is
/// the wall that holds its weaker direction, counted here when the search does not know it.
pub(crate) fn verified(
    maps: (&Map, &Map),
    (fixed, moving): (&Map, &Map),
    pose_fixed_moving: Pose2,
    support_m: Option<f64>,
    rule: &Rule,
) -> Candidate {
    let comparison = compare(&maps.0.states, &maps.1.states, pose_fixed_moving);
    let index = verification_index(&comparison, rule.disagreement);
    let there = walls_in(moving, fixed, pose_fixed_moving);
    let back = walls_in(fixed, moving, pose_fixed_moving.inverse());
    let support_m = support_m.unwrap_or_else(|| {
        let of_moving = turned(there.scatter, pose_fixed_moving.yaw().sin_cos());
        smaller_eigenvalue([0, 1, 2].map(|k| f64::midpoint(of_moving[k], back.scatter[k])))
    });
    Candidate {
        pose_fixed_moving,
        covariance: covariance(pose_fixed_moving, moving),
        evidence: Evidence {
            score: index.unwrap_or(0.0),
            probability: None,
            verification_index: index,
            overlap: comparison.overlap(),
            matched_wall_m: f64::midpoint(there.matched_m, back.matched_m),
            violated_wall_m: f64::midpoint(there.violated_m, back.violated_m),
            weaker_direction_m: support_m,
            runner_up: None,
        },
    }
}

/// The hypotheses, the best first, each with its rival: those of enough overlap before the others, then by V.
pub(crate) fn ranked(mut candidates: Vec<Candidate>, moving: &Map, rule: &Rule) -> Vec<Candidate> {
    let enough = |candidate: &Candidate| candidate.evidence.overlap >= rule.overlap_min;
    candidates.sort_by(|a, b| {
        let by_score = b.evidence.score.total_cmp(&a.evidence.score);
        enough(b).cmp(&enough(a)).then(by_score) // stable: of equal ones that which the search found first
    });
    let rivals: Vec<Option<RunnerUp>> = candidates
        .iter()
        .take(CANDIDATES)
        .map(|candidate| {
            candidates.iter().find_map(|other| {
                let distance_m = moving.distance_between(candidate.pose_fixed_moving, other.pose_fixed_moving);
                (distance_m > SAME_WITHIN_M).then_some(RunnerUp {
                    pose_fixed_moving: other.pose_fixed_moving,
                    score: other.evidence.score,
                    distance_m,
                })
            })
        })
        .collect();
    candidates.truncate(CANDIDATES);
    for (candidate, rival) in candidates.iter_mut().zip(rivals) {
        candidate.evidence.runner_up = rival;
    }
    candidates
}

/// The same hypothesis told of the pair the other way round; `moving` is the map that moves then.
pub(crate) fn inverted(mut candidate: Candidate, moving: &Map) -> Candidate {
    let pose = candidate.pose_fixed_moving.inverse();
    candidate.pose_fixed_moving = pose;
    candidate.covariance = covariance(pose, moving);
    if let Some(rival) = &mut candidate.evidence.runner_up {
        rival.pose_fixed_moving = rival.pose_fixed_moving.inverse();
        rival.distance_m = moving.distance_between(pose, rival.pose_fixed_moving);
    }
    candidate
}

struct Walls {
    matched_m: f64,
    violated_m: f64,
    /// Sum of the matched cells' [`Map::scatter`] in metres, in the frame of the map that is looked up.
    scatter: [f64; 3],
}

/// The walls of one map looked up in the other.
fn walls_in(walls: &Map, other: &Map, pose_other_walls: Pose2) -> Walls {
    let map = &other.states;
    let lattice = map.lattice();
    let (width, height) = (lattice.width(), lattice.height());
    let motion = (lattice.origin().inverse() * pose_other_walls).motion();
    let (mut matched, mut violated, mut scatter) = (0_usize, 0_usize, [0.0; 3]);
    let [cx, cy] = walls.points.center;
    for ([x, y], directions) in walls.points.local.iter().zip(walls.scatter()) {
        let metres = [(cx + f64::from(*x)) * walls.cell(), (cy + f64::from(*y)) * walls.cell()];
        let Some((column, row)) = lattice.cell_of(motion.apply(metres).map(|m| m / lattice.resolution())) else {
            continue;
        };
        let near = |row| {
            (column.saturating_sub(1)..=(column + 1).min(width - 1))
                .any(|column| map.at(column, row) == CellState::Occupied)
        };
        if (row.saturating_sub(1)..=(row + 1).min(height - 1)).any(near) {
            matched += 1;
            for (sum, share) in scatter.iter_mut().zip(directions) {
                *sum += f64::from(*share) * walls.cell();
            }
        } else if map.at(column, row) == CellState::Free {
            violated += 1;
        }
    }
    Walls {
        matched_m: to_f64(matched) * walls.cell(),
        violated_m: to_f64(violated) * walls.cell(),
        scatter,
    }
}

/// Smaller eigenvalue of `[[a, b], [b, c]]`, at least 0.
pub(crate) fn smaller_eigenvalue([a, b, c]: [f64; 3]) -> f64 {
    (f64::midpoint(a, c) - (0.5 * (a - c)).hypot(b)).max(0.0)
}

/// Independent errors amid the moving map's walls, told of its frame's origin.
fn covariance(pose: Pose2, moving: &Map) -> Covariance {
    let middle: Point = pose.apply(moving.points.center.map(|cells| cells * moving.cell()));
    let (rx, ry) = (pose.x() - middle[0], pose.y() - middle[1]);
    let (m, r) = ((SIGMA_CELLS * moving.cell()).powi(2), SIGMA_RAD.powi(2));
    // the origin moves by the error of the middle plus the rotation's error across the arm (rx, ry)
    Covariance([
        [m + r * ry * ry, -r * rx * ry, -r * ry],
        [-r * rx * ry, m + r * rx * rx, r * rx],
        [-r * ry, r * rx, r],
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::grid::Lattice;
    use crate::registration::overlap::StateMap;

    const RULE: Rule = Rule {
        disagreement: Disagreement::KnownInBoth,
        threshold: 0.92,
        overlap_min: 0.1,
        accept_unverified: false,
    };

    fn striped(width: u32, origin: Pose2) -> Map {
        let lattice = Lattice::new(width, 40, 0.1, origin).expect("valid");
        let state = |i: usize| match i % 7 {
            0 => CellState::Occupied,
            1..=4 => CellState::Free,
            _ => CellState::Unknown,
        };
        Map::new(StateMap::from_states(
            lattice,
            (0..lattice.cell_count()).map(state).collect(),
        ))
    }

    fn candidate(index: Option<f64>, overlap: f64, x: f64) -> Candidate {
        Candidate {
            pose_fixed_moving: Pose2::new(x, 0.0, Angle::ZERO),
            covariance: Covariance::diagonal(0.1, 0.1),
            evidence: Evidence {
                score: index.unwrap_or(0.0),
                probability: None,
                verification_index: index,
                overlap,
                matched_wall_m: 0.0,
                violated_wall_m: 0.0,
                weaker_direction_m: 0.0,
                runner_up: None,
            },
        }
    }

    #[test]
    fn nothing_below_the_threshold_is_accepted_unless_the_caller_asks() {
        let (good, poor) = (candidate(Some(0.92), 0.5, 0.0), candidate(Some(0.91), 0.5, 0.0));
        assert_eq!(RULE.verdict(Some(&good)), Ok(good.clone()));
        let failed = Reason::VerificationFailed {
            verification_index: 0.91,
            threshold: 0.92,
        };
        assert_eq!(RULE.verdict(Some(&poor)), Err(failed));
        let asked = Rule {
            accept_unverified: true,
            ..RULE
        };
        assert_eq!(asked.verdict(Some(&poor)), Ok(poor));
        assert_eq!((RULE.required(), asked.required()), (Some(0.92), None));
        // whatever was asked, without common cells there is nothing to be accepted
        for rule in [RULE, asked] {
            for nothing in [
                None,
                Some(&candidate(None, 0.0, 0.0)),
                Some(&candidate(Some(0.99), 0.05, 0.0)),
            ] {
                assert!(
                    matches!(rule.verdict(nothing), Err(Reason::NoOverlap { .. })),
                    "{nothing:?}"
                );
            }
        }
    }

    #[test]
    fn enough_overlap_comes_before_the_greatest_index_and_rivals_are_really_different() {
        let moving = striped(50, Pose2::IDENTITY);
        let given = vec![
            candidate(Some(0.99), 0.05, 9.0),
            candidate(Some(0.95), 0.5, 1.0),
            candidate(Some(0.97), 0.4, 1.2),
            candidate(Some(0.90), 0.9, 5.0),
        ];
        let ranked = ranked(given, &moving, &RULE);
        let order: Vec<f64> = ranked.iter().map(|candidate| candidate.pose_fixed_moving.x()).collect();
        assert_eq!(order, [1.2, 1.0, 5.0, 9.0]);
        let rival = ranked[0].evidence.runner_up.expect("5 m is elsewhere");
        assert!((rival.pose_fixed_moving.x() - 5.0).abs() < 1e-9 && (rival.distance_m - 3.8).abs() < 1e-6);
    }

    #[test]
    fn walls_match_next_to_walls_and_are_violated_in_free_space() {
        let lattice = Lattice::new(10, 4, 0.5, Pose2::IDENTITY).expect("valid");
        let of = |row: [CellState; 10]| {
            let states = (0..4).flat_map(|_| row).collect();
            Map::new(StateMap::from_states(lattice, states))
        };
        let (u, f, o) = (CellState::Unknown, CellState::Free, CellState::Occupied);
        let one = of([u, o, f, f, f, f, f, o, f, o]);
        let other = of([u, f, o, f, f, f, f, f, f, u]);
        // of the three columns the first matches the neighbour, the second lies in free space, the third is unknown there
        let walls = walls_in(&one, &other, Pose2::IDENTITY);
        assert!((walls.matched_m - 2.0).abs() < 1e-9 && (walls.violated_m - 2.0).abs() < 1e-9);
        // the matched wall runs along y: it holds x and nothing else
        let [xx, xy, yy] = walls.scatter;
        assert!((xx - 2.0).abs() < 1e-6 && xy.abs() < 1e-6 && yy.abs() < 1e-6);
        assert!(smaller_eigenvalue(walls.scatter) < 1e-6);
    }

    #[test]
    fn an_inverted_hypothesis_is_the_same_told_from_the_other_side() {
        let moving = striped(50, Pose2::new(1.0, 2.0, Angle::from_degrees(10.0)));
        let pose = Pose2::new(3.0, -1.0, Angle::from_degrees(40.0));
        let mut there = candidate(Some(0.9), 0.5, 0.0);
        there.pose_fixed_moving = pose;
        let back = inverted(inverted(there.clone(), &moving), &moving);
        assert!(moving.distance_between(back.pose_fixed_moving, pose) < 1e-9);
        assert_eq!(back.evidence, there.evidence);
    }

    #[test]
    fn far_from_the_walls_the_frames_origin_is_known_less_well() {
        let near = striped(50, Pose2::new(-2.5, -2.0, Angle::ZERO));
        let far = striped(50, Pose2::new(97.5, -2.0, Angle::ZERO));
        let of = |map: &Map| covariance(Pose2::new(1.0, 2.0, Angle::from_degrees(30.0)), map).0;
        let along = |c: [[f64; 3]; 3]| c[0][0] + c[1][1];
        assert!(along(of(&far)) > 5.0 * along(of(&near)));
        for c in [of(&near), of(&far)] {
            assert!((c[0][1] - c[1][0]).abs() < 1e-12 && (c[0][2] - c[2][0]).abs() < 1e-12);
            assert!(c[0][0] * c[1][1] > c[0][1] * c[1][0]);
        }
    }
}
