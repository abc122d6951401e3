//! What maps are called in a result, when their files are called alike.

use std::collections::BTreeSet;

/// Names that differ: each map keeps its own name unless an earlier map has it, and then gets the first of `name-2`,
/// `name-3` ... that no earlier map has. Empty names become `map`.
///
/// The command and the service both name maps by this rule, so that their results are equal.
#[must_use]
pub fn distinct_names<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let mut distinct = Vec::new();
    for name in names {
        let name = match name.as_ref() {
            "" => "map",
            name => name,
        };
        let free = (1_usize..=usize::MAX)
            .map(|count| match count {
                1 => name.to_owned(),
                _ => format!("{name}-{count}"),
            })
            .find(|candidate| !taken.contains(candidate))
            .expect("invariant: there are more numbers than maps");
        taken.insert(free.clone());
        distinct.push(free);
    }
    distinct
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_a_name_keeps_it_and_the_others_are_counted() {
        assert_eq!(
            distinct_names(["map", "b", "map", "map"]),
            ["map", "b", "map-2", "map-3"]
        );
    }

    #[test]
    fn a_counted_name_does_not_clash_with_one_that_was_there() {
        assert_eq!(distinct_names(["map-2", "map", "map"]), ["map-2", "map", "map-3"]);
        assert_eq!(distinct_names(["map", "map", "map-2"]), ["map", "map-2", "map-2-2"]);
    }

    #[test]
    fn no_map_is_without_a_name() {
        assert_eq!(distinct_names(["", ""]), ["map", "map-2"]);
    }
}
