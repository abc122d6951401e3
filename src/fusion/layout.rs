//! Maps laid out by their edges: groups, and where each map lies in its group.

use super::consistency::ConsistencyRules;
use super::maps::Maps;
use super::union_find::UnionFind;
use super::{Edge, Estimate, optimise};
use crate::geometry::Pose2;

/// An edge and the pair that it came from; `None` for an operator's word and for the join of two groups.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Link {
    pub(super) edge: Edge,
    pub(super) pair: Option<usize>,
}

/// Where each map lies in the frame of the first map of its group.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// The smallest map of each map's group.
    pub(super) first: Vec<usize>,
    /// Where it lies.
    pub(super) places: Vec<Estimate>,
}

impl Layout {
    /// The maps of each group, the anchor's group first.
    pub(super) fn groups(&self) -> Vec<Vec<usize>> {
        let firsts = (0..self.first.len()).filter(|&map| self.first[map] == map);
        let members = |first: usize| (0..self.first.len()).filter(move |&map| self.first[map] == first);
        firsts.map(|first| members(first).collect()).collect()
    }

    /// The maps of the group that is named by its first map.
    pub(super) fn members(&self, first: usize) -> impl Iterator<Item = usize> {
        (0..self.first.len()).filter(move |&map| self.first[map] == first)
    }

    /// Pose of map b's frame in map a's; both are of one group.
    pub(super) fn relative(&self, a: usize, b: usize) -> Pose2 {
        self.places[a].pose.inverse() * self.places[b].pose
    }
}

/// Lays the maps out. Edges that the best layout contradicts all the same are taken away, the worst first: loops were
/// checked a few at a time, and a layout is the check on all of them together.
pub(super) fn lay_out(maps: &Maps<'_>, links: &mut Vec<Link>) -> Layout {
    loop {
        let mut groups = UnionFind::new(maps.len());
        for link in &*links {
            groups.join(link.edge.a, link.edge.b);
        }
        let first: Vec<usize> = (0..maps.len()).map(|map| groups.first(map)).collect();
        let mut held = maps.held();
        held.extend(
            (1..maps.len())
                .filter(|&map| first[map] == map)
                .map(|map| (map, Pose2::IDENTITY)),
        );
        let edges: Vec<Edge> = links.iter().map(|link| link.edge.clone()).collect();
        let places = optimise(&maps.moments, &edges, &held);
        let layout = Layout {
            first,
            places: places
                .into_iter()
                .map(|place| place.expect("invariant: each group has its first map held"))
                .collect(),
        };
        match worst(maps, links, &layout, &maps.options.consistency) {
            Some(link) => links.remove(link),
            None => return layout,
        };
    }
}

fn worst(maps: &Maps<'_>, links: &[Link], layout: &Layout, rules: &ConsistencyRules) -> Option<usize> {
    links
        .iter()
        .enumerate()
        .filter(|(_, link)| !link.edge.certain)
        .map(|(index, link)| {
            let Edge { a, b, pose_a_b, .. } = link.edge;
            (maps.moments[b].distance(layout.relative(a, b), pose_a_b), index)
        })
        .filter(|&(missed, _)| missed > rules.tolerance_m)
        .max_by(|x, y| x.0.total_cmp(&y.0).then(y.1.cmp(&x.1)))
        .map(|(_, index)| index)
}
