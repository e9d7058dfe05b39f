//! The tests of a board at its start.

use core::fmt;

/// A test of a board at its start. Its number is on the bus: in 2002h:7, in the emergency of the code, and in refusals (2028h).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelfTest {
    /// Pins that the wiring connects are connected, and no others.
    Wiring,
    /// The outputs of the bridge reach the top of their duty.
    Duties,
    /// Clock and phase of the encoder's frames.
    EncoderClock,
    /// Offset of the current amplifier of phase a.
    OffsetA,
    /// Offset of the current amplifier of phase b.
    OffsetB,
    /// The comparator with this number sees its shunt and opens the bridge.
    Comparator(u8),
}

/// Number of the comparator 0, which no chip has.
const COMPARATORS: u8 = 10;

impl SelfTest {
    /// Returns the number of the test, from 1 on.
    pub const fn number(self) -> u8 {
        match self {
            Self::Wiring => 1,
            Self::Duties => 2,
            Self::EncoderClock => 3,
            Self::OffsetA => 4,
            Self::OffsetB => 5,
            Self::Comparator(comparator) => COMPARATORS + comparator,
        }
    }

    /// Returns the test with this number.
    pub const fn from_number(number: u8) -> Option<Self> {
        Some(match number {
            1 => Self::Wiring,
            2 => Self::Duties,
            3 => Self::EncoderClock,
            4 => Self::OffsetA,
            5 => Self::OffsetB,
            11..=19 => Self::Comparator(number - COMPARATORS),
            _ => return None,
        })
    }

    /// Returns the first of these tests that has not passed.
    pub fn first_failed(tests: &[(Self, bool)]) -> Option<Self> {
        tests.iter().find(|(_, has_passed)| !has_passed).map(|(test, _)| *test)
    }
}

impl fmt::Display for SelfTest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.number())?;
        match self {
            Self::Wiring => f.write_str("pins of the wiring"),
            Self::Duties => f.write_str("duty of the outputs"),
            Self::EncoderClock => f.write_str("clock of the encoder"),
            Self::OffsetA => f.write_str("offset of the amplifier of phase a"),
            Self::OffsetB => f.write_str("offset of the amplifier of phase b"),
            Self::Comparator(comparator) => write!(f, "comparator {comparator}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_is_that_of_one_test_and_none_is_zero() {
        let tests: Vec<_> = (0..=u8::MAX).filter_map(SelfTest::from_number).collect();
        assert_eq!(tests.len(), 14);
        for test in tests {
            assert_eq!(SelfTest::from_number(test.number()), Some(test));
        }
        assert_eq!(SelfTest::from_number(0), None);
    }

    #[test]
    fn first_failed_with_two_failures_returns_the_first() {
        let tests =
            [(SelfTest::Wiring, true), (SelfTest::Duties, false), (SelfTest::OffsetA, false)];
        assert_eq!(SelfTest::first_failed(&tests), Some(SelfTest::Duties));
        assert_eq!(SelfTest::first_failed(&tests[..1]), None);
    }
}
