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

/// A small whole number as a real.
#[inline]
#[expect(clippy::cast_precision_loss, reason = "sums over small windows are far below 2^24")]
pub(super) fn exact(value: i32) -> f32 {
    value as f32
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

/// The index below a value, clamped to 0 and `last`, which is at most 2^30; NaN is 0. Of these, vector instructions
/// convert many at once.
#[expect(clippy::inline_always, reason = "must take on the vector width of its caller")]
#[inline(always)]
pub(super) fn clamped_index(value: f32, last: f32) -> u32 {
    debug_assert!((0.0..=1_073_741_824.0).contains(&last), "{last} cells");
    let value = if value > 0.0 { value } else { 0.0 };
    let value = if value < last { value } else { last };
    #[expect(
        unsafe_code,
        reason = "the checked cast is one instruction for each value instead of one for eight"
    )]
    // SAFETY: the value is a number (a comparison with NaN is false, so that 0 or `last` stands in its place) within 0 and
    // `last`, which `Lattice` and `CELLS_MAX` keep below 2^30: its whole part fits i32.
    let index: i32 = unsafe { value.to_int_unchecked() };
    index.cast_unsigned()
}

/// As [`index`], in 32 bits.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "saturates by definition of `as`")]
pub(super) fn short_index(value: f32) -> u32 {
    (value as i32).cast_unsigned()
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
