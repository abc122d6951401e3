//! Which things hang together.

/// Sets of `0..n` that only grow. The first of a set is always its smallest number.
#[derive(Debug, Clone)]
pub(super) struct UnionFind {
    parent: Vec<usize>,
}

impl UnionFind {
    pub(super) fn new(n: usize) -> Self {
        Self {
            parent: (0..n).collect(),
        }
    }

    /// The smallest number of the set that `a` is in.
    pub(super) fn first(&self, mut a: usize) -> usize {
        while self.parent[a] != a {
            a = self.parent[a];
        }
        a
    }

    pub(super) fn same(&self, a: usize, b: usize) -> bool {
        self.first(a) == self.first(b)
    }

    /// Whether they were apart before.
    pub(super) fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.first(a), self.first(b));
        self.parent[a.max(b)] = a.min(b);
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_known_by_their_smallest_number() {
        let mut sets = UnionFind::new(5);
        assert!(sets.join(4, 2) && sets.join(2, 3) && !sets.join(3, 4));
        assert_eq!([0, 1, 2, 3, 4].map(|a| sets.first(a)), [0, 1, 2, 2, 2]);
        assert!(sets.same(3, 4) && !sets.same(0, 4));
    }
}
