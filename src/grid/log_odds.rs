//! The log odds of a cell, with unknown as a state that arithmetic cannot reach.

use std::fmt;

/// What is known of one cell: nothing, or the log odds `ln(p / (1 - p))` of its being occupied (paper eq. 11).
///
/// Stored as a whole number of quanta of 1/128 in 16 bits, so that sums are exact: maps add up to the same bytes in
/// any order and on any number of threads. Known values lie in [-255, 255]; sums saturate there. Unknown is a separate
/// state: no sum of known values is unknown, and unknown changes nothing that it is added to.
///
/// A known cell between the thresholds says as little about the place as an unknown one, and its
/// [`state`](LogOdds::state) says so, but it keeps its log odds.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct LogOdds(i16);

/// The three states that a cell can be in for registration, pictures and files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum CellState {
    /// Never seen, or seen and undecided.
    Unknown = 0,
    /// Known to be free: p at most [`LogOdds::FREE_MAX`].
    Free = 1,
    /// Known to be occupied: p at least [`LogOdds::OCCUPIED_MIN`].
    Occupied = 2,
}

const QUANTA: f64 = 128.0;
const LIMIT: i16 = 255 * 128;
const NOTHING: i16 = i16::MIN;

/// `ln(0.65 / 0.35)` and `ln(0.196 / 0.804)` in quanta: the thresholds of ROS map files, here once as whole numbers.
const OCCUPIED_FROM: i16 = 79;
const FREE_TO: i16 = -181;

impl LogOdds {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self(NOTHING);
    /// What a single map can say at most for free: the probability [`LogOdds::PROBABILITY_MIN`].
    pub const FREE: Self = Self(-SURE);
    /// What a single map can say at most for occupied.
    pub const OCCUPIED: Self = Self(SURE);
    /// Probabilities below this are read as this one: a map file that says 0 % means "below half a percent", and a sum
    /// of log odds must stay able to change its mind.
    pub const PROBABILITY_MIN: f64 = 0.004;
    /// A cell is occupied from this probability on (`occupied_thresh` of ROS map files).
    pub const OCCUPIED_MIN: f64 = 0.65;
    /// A cell is free up to this probability (`free_thresh` of ROS map files).
    pub const FREE_MAX: f64 = 0.196;

    /// The log odds of a probability in [0, 1], clamped to [`LogOdds::PROBABILITY_MIN`] from both ends; unknown when it
    /// is not a number.
    #[must_use]
    pub fn from_probability(p: f64) -> Self {
        if p.is_nan() {
            return Self::UNKNOWN;
        }
        let p = p.clamp(Self::PROBABILITY_MIN, 1.0 - Self::PROBABILITY_MIN);
        Self::from_value((p / (1.0 - p)).ln())
    }

    /// The nearest log odds to `value`, saturating at +-255; unknown when it is not a number.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounded and clamped to the range of i16 just before"
    )]
    pub fn from_value(value: f64) -> Self {
        if value.is_nan() {
            return Self::UNKNOWN;
        }
        Self((value * QUANTA).round().clamp(f64::from(-LIMIT), f64::from(LIMIT)) as i16)
    }

    /// The cell as it is kept in files: whole quanta of 1/128, unknown as the least number of 16 bits.
    #[must_use]
    #[inline]
    pub fn to_bits(self) -> i16 {
        self.0
    }

    /// The cell that was kept as `bits`; numbers beyond +-255 saturate.
    #[must_use]
    #[inline]
    pub fn from_bits(bits: i16) -> Self {
        match bits {
            NOTHING => Self::UNKNOWN,
            bits => Self(bits.clamp(-LIMIT, LIMIT)),
        }
    }

    /// The log odds, `None` for unknown.
    #[must_use]
    pub fn value(self) -> Option<f64> {
        self.is_known().then(|| f64::from(self.0) / QUANTA)
    }

    /// The probability of being occupied, `None` for unknown.
    #[must_use]
    pub fn probability(self) -> Option<f64> {
        self.value().map(|l| 1.0 / (1.0 + (-l).exp()))
    }

    /// Whether anything was ever said of the cell.
    #[must_use]
    #[inline]
    pub fn is_known(self) -> bool {
        self.0 != NOTHING
    }

    /// Which of the three states the cell is in.
    #[must_use]
    #[inline]
    pub fn state(self) -> CellState {
        match self.0 {
            NOTHING => CellState::Unknown,
            l if l >= OCCUPIED_FROM => CellState::Occupied,
            l if l <= FREE_TO => CellState::Free,
            _ => CellState::Unknown,
        }
    }

    /// Both pieces of evidence together (paper eq. 14: `l_fused = l_1 + l_2`); unknown adds nothing.
    #[must_use]
    #[inline]
    pub fn fused_with(self, other: Self) -> Self {
        match (self.is_known(), other.is_known()) {
            (true, true) => Self(self.0.saturating_add(other.0).clamp(-LIMIT, LIMIT)),
            (true, false) => self,
            (false, _) => other,
        }
    }
}

/// A sum of the log odds of many maps that saturates only when it is read: the same total in any order, however many
/// maps there are. (A chain of [`LogOdds::fused_with`] may depend on the order once it has touched the limit.)
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LogOddsSum {
    quanta: i32,
    known: bool,
}

impl LogOddsSum {
    /// Adds what one map says (paper eq. 14); unknown adds nothing.
    #[inline]
    pub fn add(&mut self, seen: LogOdds) {
        if seen.is_known() {
            self.quanta += i32::from(seen.0); // 65,000 maps at the limit fit
            self.known = true;
        }
    }

    /// What all maps say together; unknown when none of them knew anything.
    #[must_use]
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "clamped to the range of i16 just before")]
    pub fn total(self) -> LogOdds {
        if self.known {
            LogOdds(self.quanta.clamp(i32::from(-LIMIT), i32::from(LIMIT)) as i16)
        } else {
            LogOdds::UNKNOWN
        }
    }
}

/// `ln(0.996 / 0.004)` in quanta.
const SURE: i16 = 706;

impl fmt::Debug for LogOdds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.value() {
            Some(value) => write!(f, "LogOdds({value:.3})"),
            None => write!(f, "LogOdds(unknown)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_log_odds() -> impl Strategy<Value = LogOdds> {
        prop_oneof![
            Just(LogOdds::UNKNOWN),
            (-300.0..300.0_f64).prop_map(LogOdds::from_value)
        ]
    }

    proptest! {
        #[test]
        fn known_values_never_add_up_to_unknown(a in -300.0..300.0_f64, b in -300.0..300.0_f64) {
            prop_assert!(LogOdds::from_value(a).fused_with(LogOdds::from_value(b)).is_known());
        }

        #[test]
        fn fusing_is_commutative_and_unknown_is_its_neutral_element(a in any_log_odds(), b in any_log_odds()) {
            prop_assert_eq!(a.fused_with(b), b.fused_with(a));
            prop_assert_eq!(a.fused_with(LogOdds::UNKNOWN), a);
        }

        #[test]
        fn a_cell_survives_its_bits(cell in any_log_odds(), bits in proptest::num::i16::ANY) {
            prop_assert_eq!(LogOdds::from_bits(cell.to_bits()), cell);
            prop_assert_eq!(LogOdds::from_bits(bits).is_known(), bits != i16::MIN);
        }

        #[test]
        fn log_odds_add_as_numbers_do(a in -100.0..100.0_f64, b in -100.0..100.0_f64) {
            let sum = LogOdds::from_value(a).fused_with(LogOdds::from_value(b)).value().expect("known");
            prop_assert!((sum - (a + b)).abs() <= 1.0 / 128.0 + 1e-12);
        }

        #[test]
        fn a_sum_of_many_maps_does_not_depend_on_their_order(mut values in proptest::collection::vec(any_log_odds(), 1..9)) {
            let total = |values: &[LogOdds]| {
                let mut sum = LogOddsSum::default();
                for &value in values {
                    sum.add(value);
                }
                sum.total()
            };
            let before = total(&values);
            values.reverse();
            prop_assert_eq!(total(&values), before);
            prop_assert_eq!(total(&values[..1]), values[0]);
            if let [first, second] = values[..] {
                prop_assert_eq!(before, first.fused_with(second));
            }
        }

        #[test]
        fn every_percent_survives_the_way_through_log_odds(percent in 0_u8..=100) {
            let p = LogOdds::from_probability(f64::from(percent) / 100.0).probability().expect("known");
            prop_assert_eq!((p * 100.0).round(), f64::from(percent));
        }
    }

    #[test]
    fn the_whole_number_thresholds_are_those_of_the_ros_map_files() {
        let of = |p: f64| LogOdds::from_value((p / (1.0 - p)).ln()).0;
        assert_eq!(OCCUPIED_FROM, of(LogOdds::OCCUPIED_MIN));
        assert_eq!(FREE_TO, of(LogOdds::FREE_MAX));
        assert_eq!(SURE, of(1.0 - LogOdds::PROBABILITY_MIN));
    }

    #[test]
    fn contradicting_maps_leave_a_known_but_undecided_cell() {
        let cell = LogOdds::FREE.fused_with(LogOdds::OCCUPIED);
        assert!(cell.is_known());
        assert_eq!(cell.state(), CellState::Unknown);
    }

    #[test]
    fn a_probability_that_is_not_a_number_is_unknown() {
        assert_eq!(LogOdds::from_probability(f64::NAN), LogOdds::UNKNOWN);
        assert_eq!(LogOdds::from_value(f64::NAN), LogOdds::UNKNOWN);
    }
}
