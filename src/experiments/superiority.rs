//! Where the default engine is not the best: told of every experiment that asks several methods.

use super::answer::Answer;
use super::numbers::{percent, real};
use super::outcome::{Claim, Verdict};

/// What one method does on some pairs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Score {
    pub(super) method: String,
    /// Share of the pairs that are merged where right and refused where there is nothing in common.
    pub(super) decisions: f64,
    /// Median error of the best pose, as by [`median_error_m`].
    pub(super) error_m: f64,
}

/// The median error of the best poses in metres, merged or not; a pair without a pose is infinitely far off.
pub(super) fn median_error_m<'a>(answers: impl IntoIterator<Item = &'a Answer>) -> f64 {
    let mut errors: Vec<f64> = answers
        .into_iter()
        .map(|answer| answer.error_m.unwrap_or(f64::INFINITY))
        .collect();
    errors.sort_by(f64::total_cmp);
    match errors.len() {
        0 => f64::INFINITY,
        pairs => f64::midpoint(errors[(pairs - 1) / 2], errors[pairs / 2]),
    }
}

/// A sentence for each method that decides more pairs rightly than ours, and for each that lies nearer to the truth.
pub(super) fn better_than(ours: &Score, others: &[Score], place: &str) -> Vec<String> {
    let metres = |error: f64| {
        if error.is_finite() {
            format!("{error:.3} m")
        } else {
            "none (no pose)".to_owned()
        }
    };
    let mut told = Vec::new();
    for theirs in others.iter().filter(|theirs| theirs.method != ours.method) {
        if theirs.decisions > ours.decisions + 1e-9 {
            told.push(format!(
                "{place}: {} decides {} rightly, {} {}",
                theirs.method,
                percent(theirs.decisions),
                ours.method,
                percent(ours.decisions)
            ));
        }
        if theirs.error_m < ours.error_m {
            told.push(format!(
                "{place}: {} has a median error of {}, {} {}",
                theirs.method,
                metres(theirs.error_m),
                ours.method,
                metres(ours.error_m)
            ));
        }
    }
    told
}

/// The claim that ours is the best at every place, with the sentences of [`better_than`] on where it is not, of so many
/// comparisons; `summary` goes before.
pub(super) fn claim(beaten: &[String], comparisons: usize, summary: &str) -> Claim {
    let told = if beaten.is_empty() {
        "Nowhere is another method better in either.".to_owned()
    } else {
        format!("Not so in: {}.", beaten.join("; "))
    };
    Claim {
        claim: "Ours: the default engine beats every other method in right decisions and in true error.".into(),
        paper: "-".into(),
        ours: [summary, &told].join(" ").trim().to_owned(),
        verdict: match beaten.len() {
            0 => Verdict::Holds,
            some if real(some) < 0.5 * real(comparisons) => Verdict::InPart,
            _ => Verdict::Fails,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(error_m: Option<f64>) -> Answer {
        Answer {
            merged: false,
            pose: None,
            error_m,
            verification_index: None,
            reason: "",
            seconds: 0.0,
        }
    }

    #[test]
    fn a_pair_without_a_pose_counts_as_farthest_off() {
        let median = |errors: &[Option<f64>]| {
            let answers: Vec<Answer> = errors.iter().copied().map(answer).collect();
            median_error_m(&answers)
        };
        assert_eq!(median(&[Some(3.0), None, Some(1.0)]), 3.0);
        assert_eq!(median(&[Some(2.0), Some(1.0)]), 1.5);
        assert_eq!(median(&[None, Some(1.0)]), f64::INFINITY);
        assert_eq!(median(&[]), f64::INFINITY);
    }

    #[test]
    fn whoever_is_better_in_one_of_both_is_named_also_where_ours_has_no_pose() {
        let score = |method: &str, decisions, error_m| Score {
            method: method.to_owned(),
            decisions,
            error_m,
        };
        let ours = score("hough", 0.5, f64::INFINITY);
        let others = [
            ours.clone(),
            score("a", 0.6, f64::INFINITY),
            score("b", 0.5, 0.2),
            score("c", 0.4, f64::INFINITY),
        ];
        let told = better_than(&ours, &others, "here");
        assert_eq!(
            told,
            [
                "here: a decides 60 % rightly, hough 50 %",
                "here: b has a median error of 0.200 m, hough none (no pose)"
            ]
        );
        assert_eq!(claim(&told, 12, "").verdict, Verdict::InPart);
        assert_eq!(claim(&[], 12, "").verdict, Verdict::Holds);
    }
}
