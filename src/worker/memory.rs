//! What was computed before and would come out the same: features of maps, and registrations of pairs.
//!
//! A session's maps change one at a time. With n robots a new map needs the features of one map and n - 1 registrations;
//! the others are remembered. Remembering sits between `fusion` and the method, so that an answer is the same document
//! whether it was remembered or not.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::model::Digest;
use crate::registration::{Control, MapFeatures, Method, MethodName, Registration};

/// Remembers what methods computed, up to a number of maps and of pairs. Clones share the memory.
#[derive(Debug, Clone)]
pub struct Memory {
    features: Arc<Mutex<Recent<MapKey, MapFeatures>>>,
    pairs: Arc<Mutex<Recent<PairKey, Registration>>>,
}

/// A method with its parameters, and a map.
type MapKey = (Digest, Digest);
/// A method with its parameters, the fixed map and the moving one.
type PairKey = (Digest, Digest, Digest);

impl Memory {
    /// A memory for the features of `maps` maps and for the pairs among as many.
    #[must_use]
    pub fn new(maps: usize) -> Self {
        Self {
            features: Arc::new(Mutex::new(Recent::new(maps))),
            pairs: Arc::new(Mutex::new(Recent::new(maps * maps.saturating_sub(1) / 2))),
        }
    }

    /// The method with this memory. `key` stands for the method with all its parameters.
    pub(super) fn remembering(&self, method: Arc<dyn Method>, key: Digest) -> Arc<Remembering> {
        Arc::new(Remembering {
            method,
            key,
            memory: self.clone(),
            registered: AtomicUsize::new(0),
        })
    }
}

/// A method that does not compute twice.
pub(super) struct Remembering {
    method: Arc<dyn Method>,
    key: Digest,
    memory: Memory,
    registered: AtomicUsize,
}

/// Features, and whose.
struct Known {
    map: Digest,
    features: MapFeatures,
}

impl Remembering {
    /// How many pairs have their answer.
    pub(super) fn registered(&self) -> usize {
        self.registered.load(Ordering::Relaxed)
    }
}

impl Method for Remembering {
    fn name(&self) -> MethodName {
        self.method.name()
    }

    fn features(&self, map: &OccupancyGrid) -> MapFeatures {
        let digest = Digest::of_grid(map);
        let known = recall(&self.memory.features, &(self.key, digest));
        let features = known.unwrap_or_else(|| {
            let features = self.method.features(map);
            keep(&self.memory.features, (self.key, digest), features.clone());
            features
        });
        MapFeatures::new(Known { map: digest, features })
    }

    fn register(&self, fixed: &MapFeatures, moving: &MapFeatures, control: &dyn Control) -> Registration {
        let (fixed, moving): (&Known, &Known) = (fixed.of(), moving.of());
        let pair = (self.key, fixed.map, moving.map);
        let known = recall(&self.memory.pairs, &pair);
        let registration = known.unwrap_or_else(|| {
            let registration = self.method.register(&fixed.features, &moving.features, control);
            // an answer that was cut short is no answer
            if control.should_stop().is_none() {
                keep(&self.memory.pairs, pair, registration.clone());
            }
            registration
        });
        self.registered.fetch_add(1, Ordering::Relaxed);
        registration
    }

    fn required_verification(&self) -> Option<f64> {
        self.method.required_verification()
    }

    fn verify_at(
        &self,
        fixed: &MapFeatures,
        moving: &MapFeatures,
        pose_fixed_moving: Pose2,
        control: &dyn Control,
    ) -> Registration {
        let (fixed, moving): (&Known, &Known) = (fixed.of(), moving.of());
        self.method
            .verify_at(&fixed.features, &moving.features, pose_fixed_moving, control)
    }
}

fn recall<K: Ord + Clone, V: Clone>(recent: &Mutex<Recent<K, V>>, key: &K) -> Option<V> {
    recent.lock().unwrap_or_else(PoisonError::into_inner).get(key)
}

fn keep<K: Ord + Clone, V>(recent: &Mutex<Recent<K, V>>, key: K, value: V) {
    recent.lock().unwrap_or_else(PoisonError::into_inner).insert(key, value);
}

/// The values that were used last, at most so many.
#[derive(Debug)]
struct Recent<K, V> {
    most: usize,
    uses: u64,
    values: BTreeMap<K, (u64, V)>,
    by_use: BTreeMap<u64, K>,
}

impl<K: Ord + Clone, V> Recent<K, V> {
    fn new(most: usize) -> Self {
        Self {
            most,
            uses: 0,
            values: BTreeMap::new(),
            by_use: BTreeMap::new(),
        }
    }

    fn insert(&mut self, key: K, value: V) {
        self.uses += 1;
        if let Some((used, _)) = self.values.insert(key.clone(), (self.uses, value)) {
            self.by_use.remove(&used);
        }
        self.by_use.insert(self.uses, key);
        while self.values.len() > self.most {
            let Some((_, oldest)) = self.by_use.pop_first() else {
                return;
            };
            self.values.remove(&oldest);
        }
    }
}

impl<K: Ord + Clone, V: Clone> Recent<K, V> {
    fn get(&mut self, key: &K) -> Option<V> {
        let (used, value) = self.values.get_mut(key)?;
        self.uses += 1;
        let key = self.by_use.remove(used)?;
        *used = self.uses;
        self.by_use.insert(self.uses, key);
        Some(value.clone())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::grid::Lattice;
    use crate::registration::{Reason, Rejection, Stop, Unhurried};

    #[test]
    fn what_was_not_used_for_longest_is_forgotten_first() {
        let mut recent = Recent::new(2);
        recent.insert('a', 1);
        recent.insert('b', 2);
        assert_eq!(recent.get(&'a'), Some(1));
        recent.insert('c', 3);
        assert_eq!(
            (recent.get(&'a'), recent.get(&'b'), recent.get(&'c')),
            (Some(1), None, Some(3))
        );
        recent.insert('c', 4);
        assert_eq!((recent.get(&'a'), recent.get(&'c')), (Some(1), Some(4)));
        assert_eq!(recent.by_use.len(), 2);
    }

    /// Counts what it is asked.
    #[derive(Default)]
    struct Counting {
        features: AtomicUsize,
        pairs: AtomicUsize,
    }

    impl Method for Counting {
        fn name(&self) -> MethodName {
            MethodName::HoughPeaks
        }
        fn features(&self, map: &OccupancyGrid) -> MapFeatures {
            self.features.fetch_add(1, Ordering::Relaxed);
            MapFeatures::new(map.lattice().width())
        }
        fn register(&self, fixed: &MapFeatures, moving: &MapFeatures, _: &dyn Control) -> Registration {
            self.pairs.fetch_add(1, Ordering::Relaxed);
            Registration::Rejected(Rejection {
                reason: Reason::NoOverlap {
                    score: f64::from(*fixed.of::<u32>()),
                    needed: f64::from(*moving.of::<u32>()),
                },
                candidates: Vec::new(),
                stages: Vec::new(),
            })
        }
        fn required_verification(&self) -> Option<f64> {
            Some(0.875)
        }
    }

    struct Cancelled;
    impl Control for Cancelled {
        fn now(&self) -> Duration {
            Duration::ZERO
        }
        fn should_stop(&self) -> Option<Stop> {
            Some(Stop::Cancelled)
        }
    }

    fn grid(width: u32) -> OccupancyGrid {
        OccupancyGrid::unknown(Lattice::new(width, 1, 0.05, Pose2::IDENTITY).expect("valid"))
    }

    #[test]
    fn features_and_pairs_are_computed_once_a_method_and_maps() {
        let (memory, counting) = (Memory::new(8), Arc::new(Counting::default()));
        let (key, other_key) = (Digest::of_bytes(b"a"), Digest::of_bytes(b"b"));
        let mut answers = Vec::new();
        for key in [key, key, other_key] {
            let method = memory.remembering(Arc::clone(&counting) as Arc<dyn Method>, key);
            let (a, b) = (method.features(&grid(3)), method.features(&grid(4)));
            answers.push((method.register(&a, &b, &Unhurried), method.register(&b, &a, &Unhurried)));
            assert_eq!(method.registered(), 2);
            assert_eq!(method.required_verification(), Some(0.875));
        }
        assert_eq!(answers[0], answers[1]);
        assert_ne!(answers[0].0, answers[0].1, "a pair the other way round is another pair");
        assert_eq!(counting.features.load(Ordering::Relaxed), 4);
        assert_eq!(counting.pairs.load(Ordering::Relaxed), 4);
    }

    #[test]
    fn an_answer_that_was_cut_short_is_not_remembered() {
        let (memory, counting) = (Memory::new(8), Arc::new(Counting::default()));
        let method = memory.remembering(Arc::clone(&counting) as Arc<dyn Method>, Digest::of_bytes(b"a"));
        let features = method.features(&grid(3));
        for _ in 0..2 {
            method.register(&features, &features, &Cancelled);
        }
        assert_eq!(counting.pairs.load(Ordering::Relaxed), 2);
    }
}
