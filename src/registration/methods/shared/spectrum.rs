//! The spectrum h(theta) of a Hough image: one number a direction, which no translation changes (eq. 22).
//!
//! **Method.** `h(theta) = f(column theta)` with an f that is invariant to the order of a column: a translation moves the
//! bins of a column and leaves h as it is.

use serde::{Deserialize, Serialize};

use super::hough_image::{HoughImage, to_f64};

/// The order invariant function f of a column of the Hough image (eq. 22).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Spectrum {
    /// The greatest value: the longest wall of each direction. The paper's choice.
    #[default]
    Max,
    /// The mean of the values that are not zero.
    MeanOfNonZeros,
    /// The entropy in bits of the values, normalised to a sum of 1.
    Entropy,
    /// The sum of the squares: that of Censi et al. and of Carpin (2008).
    SumOfSquares,
}

/// `f` of one column (eq. 22).
pub(crate) fn value_of(column: &[u32], f: Spectrum) -> f64 {
    let sum: u64 = column.iter().map(|votes| u64::from(*votes)).sum();
    #[expect(clippy::cast_precision_loss, reason = "votes stay far below 2^52")]
    let sum = sum as f64;
    match f {
        Spectrum::Max => f64::from(column.iter().copied().max().unwrap_or(0)),
        Spectrum::MeanOfNonZeros => {
            let non_zeros = column.iter().filter(|votes| **votes > 0).count();
            if non_zeros == 0 { 0.0 } else { sum / to_f64(non_zeros) }
        }
        Spectrum::Entropy => -column
            .iter()
            .filter(|votes| **votes > 0)
            .map(|votes| f64::from(*votes) / sum)
            .map(|p| p * p.log2())
            .sum::<f64>(),
        Spectrum::SumOfSquares => column.iter().map(|votes| f64::from(*votes).powi(2)).sum(),
    }
}

/// h(theta) of an image (eq. 22), a value a column.
pub(crate) fn spectrum(image: &HoughImage, f: Spectrum) -> Vec<f64> {
    image.columns().map(|column| value_of(column, f)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn f_does_not_depend_on_the_order_of_a_column() {
        for f in [
            Spectrum::Max,
            Spectrum::MeanOfNonZeros,
            Spectrum::Entropy,
            Spectrum::SumOfSquares,
        ] {
            let (a, b) = (value_of(&[0, 3, 5, 0, 2], f), value_of(&[5, 0, 0, 2, 3], f));
            assert!((a - b).abs() < 1e-12);
            assert!(value_of(&[0, 0, 0], f).abs() < 1e-12);
        }
        assert!((value_of(&[0, 3, 5, 0, 1], Spectrum::MeanOfNonZeros) - 3.0).abs() < 1e-12);
        assert!((value_of(&[2, 0, 2, 2, 2], Spectrum::Entropy) - 2.0).abs() < 1e-12);
        assert!((value_of(&[1, 3, 0], Spectrum::SumOfSquares) - 10.0).abs() < 1e-12);
    }
}
