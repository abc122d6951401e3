//! Whole and real numbers, and what is usually asked of a list of them: the casts of this room, each with its reason.

/// A count as a real number.
#[expect(clippy::cast_precision_loss, reason = "counts stay below 2^52")]
pub(super) fn real(count: usize) -> f64 {
    count as f64
}

/// The whole part of a real number, 0 for what is negative or no number.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the saturating cast is what is meant"
)]
pub(super) fn count(value: f64) -> usize {
    value as usize
}

/// As [`count`], for sides of lattices and pictures.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the saturating cast is what is meant"
)]
pub(super) fn index(value: f64) -> u32 {
    value as u32
}

/// The mean; not a number for an empty list.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / real(values.len())
}

/// The value below which the share `q` in [0, 1] of the values lies, between neighbours by their distance; not a number
/// for an empty list.
pub(super) fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = q.clamp(0.0, 1.0) * real(last);
    let (below, above) = (count(at.floor()), count(at.ceil()).min(last));
    sorted[below] + (sorted[above] - sorted[below]) * at.fract()
}

/// The share of the items for which it is so; 0 for none.
pub(super) fn share<T>(items: &[T], so: impl Fn(&T) -> bool) -> f64 {
    if items.is_empty() {
        return 0.0;
    }
    real(items.iter().filter(|item| so(item)).count()) / real(items.len())
}

/// A share as whole percents, for people.
pub(super) fn percent(share: f64) -> String {
    if share.is_finite() {
        format!("{:.0} %", 100.0 * share)
    } else {
        "-".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_neighbours() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!([0.0, 0.5, 1.0].map(|q| quantile(&values, q)), [1.0, 2.5, 4.0]);
        assert!(quantile(&[], 0.5).is_nan());
        assert_eq!(share(&values, |v| *v > 1.5), 0.75);
    }
}
