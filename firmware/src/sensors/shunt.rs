//! Phase currents from low-side shunts.
//!
//! An amplifier shifts the small shunt voltage to the middle of the converter's range, so that both signs
//! fit. The exact offset depends on board and temperature. It is measured at each start, while the bridge
//! is off and no current flows. An offset far from the middle or an unsteady one indicates a broken
//! amplifier or a turning motor, and the joint must not be driven. At either end of the range the amplifier
//! saturates and the current is unknown, so the sample is invalid.

/// Number of counts of a 12-bit converter.
pub const CONVERTER_RANGE_COUNTS: u16 = 4096;
/// Number of samples averaged for an offset.
pub const OFFSET_SAMPLES: u32 = 256;
/// Maximum deviation of an offset from the middle, counts.
const MAX_OFFSET_COUNTS: u16 = CONVERTER_RANGE_COUNTS / 10;
/// Maximum spread of the samples while the offset is measured, counts.
const MAX_SPREAD_COUNTS: u16 = 64;
/// Counts at either end of the range at which the amplifier saturates.
const RAIL_COUNTS: u16 = 8;

/// Offsets of an amplifier that are accepted, exclusive, counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OffsetRange {
    /// Bound below.
    pub above: u16,
    /// Bound above.
    pub below: u16,
}

impl OffsetRange {
    /// Offsets of an amplifier that shifts to the middle of the range.
    pub const CENTRAL: Self = Self {
        above: CONVERTER_RANGE_COUNTS / 2 - MAX_OFFSET_COUNTS,
        below: CONVERTER_RANGE_COUNTS / 2 + MAX_OFFSET_COUNTS,
    };

    /// Returns the largest current that an amplifier measures in both directions for any offset that is accepted, A.
    pub const fn measurable_a(self, amperes_per_count: f32) -> f32 {
        let (down, up) = (self.above, CONVERTER_RANGE_COUNTS - self.below);
        let counts = if down < up { down } else { up } - RAIL_COUNTS;
        counts as f32 * amperes_per_count.abs()
    }
}

/// Scaling of the amplifier of one phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shunt {
    /// Counts at zero current.
    offset: f32,
    /// Current per count, A. Negative if a current into the motor lowers the counts.
    amperes_per_count: f32,
}

impl Shunt {
    /// Returns the same scaling with this sign: negative if a current into the motor lowers the counts.
    #[must_use]
    pub fn with_sign(self, sign: f32) -> Self {
        Self { amperes_per_count: self.amperes_per_count.abs().copysign(sign), ..self }
    }

    /// Returns the current into the motor, A; `None` if the amplifier saturates.
    #[inline(always)]
    pub fn current_a(&self, counts: u16) -> Option<f32> {
        let is_valid = (RAIL_COUNTS..CONVERTER_RANGE_COUNTS - RAIL_COUNTS).contains(&counts);
        is_valid.then_some((f32::from(counts) - self.offset) * self.amperes_per_count)
    }
}

/// Measures the offset of one amplifier.
#[derive(Clone, Copy, Debug)]
pub struct OffsetFinder {
    sum: u32,
    samples: u32,
    min: u16,
    max: u16,
}

impl Default for OffsetFinder {
    fn default() -> Self {
        Self { sum: 0, samples: 0, min: u16::MAX, max: 0 }
    }
}

impl OffsetFinder {
    /// Adds a sample, taken with the bridge off.
    pub fn add_sample(&mut self, counts: u16) {
        if self.samples < OFFSET_SAMPLES {
            self.sum += u32::from(counts);
            self.samples += 1;
            self.min = self.min.min(counts);
            self.max = self.max.max(counts);
        }
    }

    /// Returns the scaling after [`OFFSET_SAMPLES`] samples, if they are plausible for an offset of this range.
    pub fn shunt(&self, range: OffsetRange, amperes_per_count: f32) -> Option<Shunt> {
        let is_steady = self.max.saturating_sub(self.min) <= MAX_SPREAD_COUNTS;
        let is_central = self.min > range.above && self.max < range.below;
        let is_valid = self.samples == OFFSET_SAMPLES && is_steady && is_central;
        let offset = self.sum as f32 / OFFSET_SAMPLES as f32;
        is_valid.then_some(Shunt { offset, amperes_per_count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure_offset(counts: impl Fn(u32) -> u16) -> Option<Shunt> {
        let mut finder = OffsetFinder::default();
        for sample in 0..OFFSET_SAMPLES {
            assert_eq!(finder.shunt(OffsetRange::CENTRAL, 0.02), None, "too early");
            finder.add_sample(counts(sample));
        }
        // Further samples are ignored.
        finder.add_sample(0);
        finder.shunt(OffsetRange::CENTRAL, 0.02)
    }

    #[test]
    fn offset_averages_noise_and_current_has_the_right_sign() {
        let shunt = measure_offset(|sample| 2060 + (sample % 5) as u16).unwrap();
        assert!((shunt.current_a(2062).unwrap()).abs() < 0.001);
        assert!((shunt.current_a(3062).unwrap() - 20.0).abs() < 0.001);
        assert!((shunt.current_a(1062).unwrap() + 20.0).abs() < 0.001);
        let turned = shunt.with_sign(-1.0);
        assert!((turned.current_a(3062).unwrap() + 20.0).abs() < 0.001);
        assert_eq!(turned.with_sign(1.0), shunt);
    }

    #[test]
    fn measurable_current_is_measured_at_the_largest_offset() {
        for offset in [2048 - 408, 2048 + 408] {
            let shunt = measure_offset(|_| offset).unwrap();
            let counts = (OffsetRange::CENTRAL.measurable_a(-0.02) / 0.02) as u16;
            for counts in [offset - counts, offset + counts] {
                assert!(shunt.current_a(counts).is_some(), "{counts}");
            }
        }
    }

    #[test]
    fn saturated_counts_give_no_current() {
        let shunt = measure_offset(|_| 2048).unwrap();
        for counts in [0, 7, 4088, 4095, u16::MAX] {
            assert_eq!(shunt.current_a(counts), None);
        }
        assert!(shunt.current_a(8).is_some() && shunt.current_a(4087).is_some());
    }

    #[test]
    fn offset_off_centre_or_unsteady_is_refused() {
        assert_eq!(measure_offset(|_| 2048 + 410), None);
        assert_eq!(measure_offset(|_| 0), None);
        assert_eq!(measure_offset(|sample| if sample == 50 { 2120 } else { 2048 }), None);
        assert!(measure_offset(|sample| if sample == 50 { 2112 } else { 2048 }).is_some());
    }
}
