//! Casts between counts, indices and reals, each with the reason why it loses nothing that matters.

/// A count or index as a real: exact below 2^24, and a rounding of 6e-8 beyond does no harm to geometry.
#[inline]
#[expect(
    clippy::cast_precision_loss,
    reason = "counts are far below 2^24, or the rounding is harmless"
)]
pub(super) fn real(count: usize) -> f32 {
    count as f32
}

/// A count or index as a real, exact below 2^52.
#[inline]
#[expect(clippy::cast_precision_loss, reason = "counts are far below 2^52")]
pub(super) fn real64(count: usize) -> f64 {
    count as f64
}

/// A signed index as a real.
#[inline]
#[expect(clippy::cast_precision_loss, reason = "indices are far below 2^24")]
pub(super) fn signed(index: isize) -> f32 {
    index as f32
}

/// f64 to f32, for coordinates near the middle of a map.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    reason = "7 digits are a tenth of a millimetre at a kilometre"
)]
pub(super) fn narrow(value: f64) -> f32 {
    value as f32
}

/// The whole number at or below a value; the caller knows that it is small. Saturates, NaN is 0.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "saturates by definition of `as`")]
pub(super) fn floor(value: f32) -> isize {
    value.floor() as isize
}

/// A value that is at least 0, cut to the index below it. Saturates, NaN is 0.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates by definition of `as`"
)]
pub(super) fn index(value: f32) -> usize {
    value as usize
}

/// A length in metres as a whole number of cells, rounded up.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates by definition of `as`"
)]
pub(super) fn ceil64(value: f64) -> usize {
    value.ceil() as usize
}

/// A ratio rounded to the nearest whole number.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates by definition of `as`"
)]
pub(super) fn round64(value: f64) -> usize {
    value.round() as usize
}
