//! Labelled pairs of recorded maps, handed in from outside, for the comparison.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::numbers::{count, real};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;

/// Two recorded maps and what is known of them.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedPair {
    /// Its name in its list.
    pub label: RecordedLabel,
    /// The map that stays.
    pub fixed: Arc<OccupancyGrid>,
    /// The map that is registered to it.
    pub moving: Arc<OccupancyGrid>,
    /// Pose of the moving map's frame in the fixed map's; `None` when they show different places.
    pub truth: Option<Pose2>,
    /// RMS error in metres up to which an answer is right.
    pub tolerance_m: f64,
}

/// What a list says of a pair before its maps are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedLabel {
    /// Its name in its list.
    pub id: String,
    /// Where its maps come from.
    pub source: String,
    /// Whether the maps show one place.
    pub matching: bool,
}

/// Indices of at most `each` pairs of every source, matching and not, evenly spread over the list: a part of it that can
/// be gone through in minutes.
#[must_use]
pub fn chosen(labels: &[RecordedLabel], each: usize) -> Vec<usize> {
    let mut groups: BTreeMap<(&str, bool), Vec<usize>> = BTreeMap::new();
    for (index, label) in labels.iter().enumerate() {
        groups.entry((&label.source, label.matching)).or_default().push(index);
    }
    let mut kept: Vec<usize> = groups
        .into_values()
        .flat_map(|group| {
            let wanted = each.min(group.len());
            let step = real(group.len()) / real(wanted.max(1));
            (0..wanted)
                .map(move |k| group[count(real(k) * step)])
                .collect::<Vec<_>>()
        })
        .collect();
    kept.sort_unstable();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_source_gives_as_many_of_both_kinds_as_it_has_up_to_the_limit() {
        let labels: Vec<RecordedLabel> = (0..50)
            .map(|k| RecordedLabel {
                id: k.to_string(),
                source: if k < 40 { "a" } else { "b" }.into(),
                matching: k % 2 == 0,
            })
            .collect();
        let kept = chosen(&labels, 6);
        let of = |source: &str, matching| {
            kept.iter()
                .filter(|k| labels[**k].source == source && labels[**k].matching == matching)
                .count()
        };
        assert_eq!(
            [of("a", true), of("a", false), of("b", true), of("b", false)],
            [6, 6, 5, 5]
        );
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]) && chosen(&[], 6).is_empty());
    }
}
