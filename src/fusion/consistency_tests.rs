//! Graphs with known truth: what is wrong goes, what is right stays.

use proptest::prelude::*;

use super::Verdict::{Contradicted, Doubtful, Kept};
use super::*;
use crate::geometry::Angle;
use crate::registration::Covariance;

fn edge(truth: &[Pose2], a: usize, b: usize, weight: f64) -> Edge {
    Edge {
        a,
        b,
        pose_a_b: truth[a].inverse() * truth[b],
        covariance: Covariance::diagonal(0.02, 0.002),
        weight,
        certain: false,
    }
}

fn wrong(truth: &[Pose2], a: usize, b: usize, weight: f64) -> Edge {
    let mut edge = edge(truth, a, b, weight);
    edge.pose_a_b = edge.pose_a_b * Pose2::new(4.0, -1.0, Angle::from_degrees(90.0));
    edge
}

fn world(maps: u32) -> (Vec<Pose2>, Vec<Moments>) {
    let truth = (0..maps).map(|i| {
        let i = f64::from(i);
        Pose2::new(7.0 * i, 3.0 * (i * 1.3).sin(), Angle::from_radians(i * 2.1))
    });
    (truth.collect(), vec![Moments::new([2.0, 1.0], 6.0); maps as usize])
}

fn judge(moments: &[Moments], edges: &[Edge]) -> Vec<Verdict> {
    verdicts(moments, edges, &ConsistencyRules::default())
}

#[test]
fn a_wrong_edge_between_well_connected_maps_is_dropped_even_when_it_is_the_heaviest() {
    let (truth, moments) = world(4);
    let edges = [
        edge(&truth, 0, 1, 100.0),
        edge(&truth, 1, 2, 100.0),
        edge(&truth, 0, 2, 90.0),
        edge(&truth, 1, 3, 80.0),
        edge(&truth, 2, 3, 80.0),
        wrong(&truth, 0, 3, 150.0),
    ];
    let verdicts = judge(&moments, &edges);
    assert_eq!(verdicts[5], Verdict::Contradicted);
    assert!(
        verdicts[..5].iter().all(|&verdict| verdict == Verdict::Kept),
        "{verdicts:?}"
    );
}

#[test]
fn of_three_edges_that_contradict_each_other_none_bridges_unless_it_is_much_heavier() {
    let (truth, moments) = world(3);
    let triangle = |heavy: f64| {
        [
            edge(&truth, 0, 1, heavy),
            edge(&truth, 1, 2, 100.0),
            wrong(&truth, 0, 2, 80.0),
        ]
    };
    assert_eq!(judge(&moments, &triangle(100.0)), [Doubtful, Doubtful, Contradicted]);
    assert_eq!(judge(&moments, &triangle(200.0)), [Kept, Doubtful, Contradicted]);
}

#[test]
fn a_light_wrong_edge_does_not_break_a_chain_of_heavy_ones() {
    let (truth, moments) = world(8);
    let mut edges: Vec<Edge> = (0..7).map(|i| edge(&truth, i, i + 1, 300.0)).collect();
    edges.push(wrong(&truth, 0, 7, 45.0));
    let verdicts = judge(&moments, &edges);
    assert_eq!(verdicts[7], Verdict::Contradicted);
    assert!(verdicts[..7].iter().all(|&verdict| verdict == Verdict::Kept));
}

#[test]
fn what_an_operator_has_said_is_never_dropped() {
    let (truth, moments) = world(3);
    let mut said = wrong(&truth, 0, 2, 0.0);
    said.certain = true;
    let edges = [edge(&truth, 0, 1, 500.0), edge(&truth, 1, 2, 400.0), said];
    let verdicts = judge(&moments, &edges);
    assert_eq!(verdicts[2], Verdict::Kept);
    assert_eq!(verdicts[1], Verdict::Contradicted);
}

#[test]
fn an_edge_in_no_loop_stands_on_its_own_evidence() {
    let (truth, moments) = world(2);
    assert_eq!(judge(&moments, &[wrong(&truth, 0, 1, 50.0)]), [Verdict::Kept]);
}

#[test]
fn two_edges_over_the_same_maps_make_a_loop() {
    let (truth, moments) = world(2);
    let edges = [edge(&truth, 0, 1, 500.0), wrong(&truth, 1, 0, 50.0)];
    assert_eq!(judge(&moments, &edges), [Verdict::Kept, Verdict::Contradicted]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_search_finds_the_heaviest_consistent_set(
        bad in proptest::collection::vec(any::<bool>(), 10), weights in proptest::collection::vec(10.0..200.0_f64, 10),
    ) {
        // five maps, all ten pairs, each right or wrong in its own way; against all 2^10 subsets
        let (truth, moments) = world(5);
        let pairs: Vec<(usize, usize)> = (0..5).flat_map(|a| (a + 1..5).map(move |b| (a, b))).collect();
        let edges: Vec<Edge> = pairs
            .iter()
            .zip(bad.iter().zip(&weights))
            .enumerate()
            .map(|(i, (&(a, b), (&bad, &weight)))| {
                let mut edge = edge(&truth, a, b, weight);
                if bad {
                    let i = u32::try_from(i).expect("ten");
                    edge.pose_a_b = edge.pose_a_b * Pose2::new(3.0 + 2.0 * f64::from(i), -f64::from(i * i), Angle::ZERO);
                }
                edge
            })
            .collect();
        let rules = ConsistencyRules::default();
        let graph = Graph { moments: &moments, edges: &edges, rules: &rules };
        let lost = |removed: &[bool]| -> f64 {
            removed.iter().zip(&weights).filter(|(removed, _)| **removed).map(|(_, weight)| weight).sum()
        };
        let least = (0_u32..1 << 10)
            .map(|set| (0..10).map(|i| set >> i & 1 == 1).collect::<Vec<_>>())
            .filter(|removed| graph.broken_loop(removed).is_none())
            .map(|removed| lost(&removed))
            .fold(f64::INFINITY, f64::min);
        let verdicts = verdicts(&moments, &edges, &rules);
        let removed: Vec<bool> = verdicts.iter().map(|&verdict| verdict == Verdict::Contradicted).collect();
        prop_assert!(graph.broken_loop(&removed).is_none());
        prop_assert!((lost(&removed) - least).abs() < 1e-9, "lost {} where {least} would do", lost(&removed));
    }
}
