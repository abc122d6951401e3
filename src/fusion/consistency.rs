//! Which accepted registrations can be true together.
//!
//! **Convention.** As in `pose_graph`. The distance of two poses of a map is the RMS over its occupied cells.
//!
//! **Method.** Going around a loop of edges must lead back to where one started. Of all sets of edges without a broken
//! loop the heaviest is kept:
//!
//! 1. for each edge, the shortest way between its ends over other edges makes a loop; the loop is broken when both ways
//!    lay a map more than `tolerance * sqrt(max(edges, 3) / 3)` apart;
//! 2. at least one edge of a broken loop is wrong: branch over which, lightest first, and bound by the weight taken away
//!    (exact within [`STEPS_MAX`] steps, and the best found so far beyond);
//! 3. what was taken away speaks against every edge of the way that replaces it. Where such an edge is the only bridge
//!    between two parts and not `trust` times as heavy as what spoke against it, nobody knows which of the two is wrong:
//!    the bridge is taken away too.
//!
//! **Cost.** Each step looks at all edges and a short way for each; without broken loops there is one step.
//!
//! **Fails when** wrong edges agree among themselves and outweigh the right ones. An edge that is in no loop cannot be
//! contradicted: it stands on its own evidence.

use std::collections::VecDeque;

use super::{Edge, Moments};
use crate::geometry::Pose2;

/// What is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConsistencyRules {
    /// How far, in metres, a loop of three edges may miss its start. Default 0.5: bent maps close loops no better, and
    /// wrong registrations miss by metres.
    pub tolerance_m: f64,
    /// How many times heavier a lone bridge must be than the edge that speaks against it. Default 2.
    pub trust: f64,
}

impl Default for ConsistencyRules {
    fn default() -> Self {
        Self {
            tolerance_m: 0.5,
            trust: 2.0,
        }
    }
}

/// What became of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It agrees with all others that are kept.
    Kept,
    /// It contradicts edges that outweigh it.
    Contradicted,
    /// It is a lone bridge, and an edge of about its weight speaks against it.
    Doubtful,
}

/// The most steps of the search for the heaviest set.
const STEPS_MAX: usize = 2000;

/// What becomes of each edge.
#[must_use]
pub fn verdicts(moments: &[Moments], edges: &[Edge], rules: &ConsistencyRules) -> Vec<Verdict> {
    let mut search = Search {
        graph: Graph { moments, edges, rules },
        removed: vec![false; edges.len()],
        locked: edges.iter().map(|edge| edge.certain).collect(),
        best: None,
        steps: 0,
    };
    search.run(0.0);
    let removed = search
        .best
        .map_or_else(|| search.removed.clone(), |(_, removed)| removed);
    let doubtful = search.graph.doubtful(&removed);
    removed
        .iter()
        .zip(doubtful)
        .map(|(&removed, doubtful)| match (removed, doubtful) {
            (true, _) => Verdict::Contradicted,
            (false, true) => Verdict::Doubtful,
            (false, false) => Verdict::Kept,
        })
        .collect()
}

struct Search<'a> {
    graph: Graph<'a>,
    removed: Vec<bool>,
    /// Edges that a branch must not take away: an earlier branch has.
    locked: Vec<bool>,
    best: Option<(f64, Vec<bool>)>,
    steps: usize,
}

impl Search<'_> {
    fn run(&mut self, weight: f64) {
        self.steps += 1;
        if self
            .best
            .as_ref()
            .is_some_and(|&(best, _)| weight >= best || self.steps > STEPS_MAX)
        {
            return;
        }
        let Some(mut broken) = self.graph.broken_loop(&self.removed) else {
            self.best = Some((weight, self.removed.clone()));
            return;
        };
        broken.retain(|&edge| !self.locked[edge]);
        let weight_of = |edge: usize| self.graph.edges[edge].weight.max(0.0);
        broken.sort_by(|&a, &b| weight_of(a).total_cmp(&weight_of(b)).then(b.cmp(&a)));
        let branches: Vec<(usize, f64)> = broken.into_iter().map(|edge| (edge, weight_of(edge))).collect();
        for &(edge, own) in &branches {
            self.removed[edge] = true;
            self.run(weight + own);
            self.removed[edge] = false;
            self.locked[edge] = true;
        }
        for (edge, _) in branches {
            self.locked[edge] = false;
        }
    }
}

struct Graph<'a> {
    moments: &'a [Moments],
    edges: &'a [Edge],
    rules: &'a ConsistencyRules,
}

impl Graph<'_> {
    /// The edges of the shortest broken loop, if there is one.
    fn broken_loop(&self, removed: &[bool]) -> Option<Vec<usize>> {
        (0..self.edges.len())
            .filter(|&edge| !removed[edge])
            .filter_map(|edge| {
                let way = self.way(edge, removed)?;
                (!self.closes(edge, &way)).then(|| std::iter::once(edge).chain(way).collect::<Vec<_>>())
            })
            .min_by_key(Vec::len)
    }

    /// The shortest way over other edges from an edge's `a` to its `b`; of equally short ones, the first by index.
    fn way(&self, edge: usize, removed: &[bool]) -> Option<Vec<usize>> {
        let (start, end) = (self.edges[edge].a, self.edges[edge].b);
        let mut reached_by: Vec<Option<usize>> = vec![None; self.moments.len()];
        let mut open = VecDeque::from([start]);
        while let Some(node) = open.pop_front() {
            if node == end {
                let mut way = Vec::new();
                let mut at = end;
                while at != start {
                    let by = reached_by[at]?;
                    way.push(by);
                    at = self.edges[by].a + self.edges[by].b - at;
                }
                way.reverse();
                return Some(way);
            }
            for (other, link) in self.edges.iter().enumerate() {
                if other == edge || removed[other] || (link.a != node && link.b != node) {
                    continue;
                }
                let next = link.a + link.b - node;
                if next != start && reached_by[next].is_none() {
                    reached_by[next] = Some(other);
                    open.push_back(next);
                }
            }
        }
        None
    }

    fn closes(&self, edge: usize, way: &[usize]) -> bool {
        let Edge { a, b, pose_a_b, .. } = self.edges[edge];
        let (mut at, mut pose_a_at) = (a, Pose2::IDENTITY);
        for &link in way {
            let link = &self.edges[link];
            let forward = link.a == at;
            pose_a_at = pose_a_at
                * if forward {
                    link.pose_a_b
                } else {
                    link.pose_a_b.inverse()
                };
            at = if forward { link.b } else { link.a };
        }
        let missed = self.moments[b]
            .distance(pose_a_b, pose_a_at)
            .max(self.moments[a].distance(pose_a_b.inverse(), pose_a_at.inverse()));
        #[expect(
            clippy::cast_precision_loss,
            reason = "a loop has at most as many edges as there are maps"
        )]
        let length = (way.len() + 1).max(3) as f64;
        missed <= self.rules.tolerance_m * (length / 3.0).sqrt()
    }

    /// Step 3.
    fn doubtful(&self, removed: &[bool]) -> Vec<bool> {
        let mut doubtful = vec![false; self.edges.len()];
        for against in (0..self.edges.len()).filter(|&edge| removed[edge]) {
            for link in self.way(against, removed).unwrap_or_default() {
                let edge = &self.edges[link];
                let lone = self.way(link, removed).is_none();
                doubtful[link] |= lone && !edge.certain && edge.weight < self.rules.trust * self.edges[against].weight;
            }
        }
        doubtful
    }
}

#[cfg(test)]
#[path = "consistency_tests.rs"]
mod tests;
