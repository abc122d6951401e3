//! Whole and real numbers: the casts of this room, each with its reason.

/// A count as a real number.
#[expect(clippy::cast_precision_loss, reason = "counts of cells and scans stay below 2^52")]
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

/// As [`count`], for lattice indices.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the saturating cast is what is meant"
)]
pub(super) fn index(value: f64) -> u32 {
    value as u32
}
