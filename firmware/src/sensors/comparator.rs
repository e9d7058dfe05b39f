//! Levels of comparators that open the bridge at a phase current, without the processor.
//!
//! The level follows the parameter `overcurrent_a`, at which the current loop opens the bridge itself. It
//! lies above it, so that a working processor trips first and reports the value, and never above what the
//! board withstands.

use super::shunt::CONVERTER_RANGE_COUNTS;

/// Distance from `overcurrent_a` to the level: a share for the gain of the amplifiers, and a constant for
/// offsets of converter, comparator and amplifier, A.
const GAIN_SHARE: f32 = 0.05;
const OFFSET_A: f32 = 2.0;

/// Returns the phase current at which comparators open the bridge, A: above `overcurrent_a`, at most
/// `ceiling_a`. A value that is not a current gives the ceiling.
pub fn break_current_a(overcurrent_a: f32, ceiling_a: f32) -> f32 {
    let wanted_a = overcurrent_a.abs() * (1.0 + GAIN_SHARE) + OFFSET_A;
    // NaN fails the comparison.
    if wanted_a < ceiling_a { wanted_a } else { ceiling_a }
}

/// Levels of the comparators at the amplifiers of two phases, and at their mean, in converter counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComparatorLevels {
    /// Upper and lower level of the amplifier of a phase.
    pub phase: [u16; 2],
    /// Upper and lower level of the mean of two amplifiers. It shows half of the current in the third phase,
    /// because the three currents add up to zero.
    pub mean: [u16; 2],
}

impl ComparatorLevels {
    /// Returns the levels of a phase current, A, for amplifiers of this scale. Beyond the range of the
    /// amplifiers a level is at the end of the range.
    pub const fn for_current(break_a: f32, amperes_per_count: f32) -> Self {
        let middle = CONVERTER_RANGE_COUNTS / 2;
        let counts = break_a / amperes_per_count;
        // The cast saturates and rounds down, which is the lower current.
        let counts = if counts < 0.0 { -counts } else { counts } as u16;
        let phase = if counts < middle { counts } else { middle - 1 };
        let mean = phase / 2;
        Self { phase: [middle + phase, middle - phase], mean: [middle + mean, middle - mean] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scale of the STM32G474 board.
    const AMPERES_PER_COUNT: f32 = -3.3 / (4096.0 * 0.001 * 20.0);

    #[test]
    fn break_current_is_above_the_parameter_and_at_most_the_ceiling() {
        assert_eq!(break_current_a(40.0, 44.0), 44.0);
        for overcurrent_a in [0.5, 5.0, 20.0, 39.0] {
            let break_a = break_current_a(overcurrent_a, 44.0);
            assert!(break_a > overcurrent_a + 1.9 && break_a < 44.0, "{overcurrent_a}: {break_a}");
        }
        for odd in [41.0, 1e4, f32::INFINITY, f32::NAN] {
            assert_eq!(break_current_a(odd, 44.0), 44.0, "{odd}");
        }
        assert_eq!(break_current_a(-5.0, 44.0), break_current_a(5.0, 44.0));
    }

    #[test]
    fn levels_are_symmetric_and_stay_in_the_range() {
        let levels = ComparatorLevels::for_current(44.0, AMPERES_PER_COUNT);
        let [above, below] = levels.phase.map(|counts| f32::from(counts) - 2048.0);
        assert_eq!(above, -below);
        assert!((43.9..=44.0).contains(&(above * AMPERES_PER_COUNT.abs())), "{above}");
        // The mean shows half of the current.
        assert_eq!(levels.mean.map(|counts| counts.abs_diff(2048)), [(above / 2.0) as u16; 2]);
        let widest = ComparatorLevels::for_current(1e9, AMPERES_PER_COUNT);
        assert_eq!(widest.phase, [4095, 1]);
    }
}
