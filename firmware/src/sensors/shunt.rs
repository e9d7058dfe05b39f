//! Phase currents from low-side shunts.
//!
//! An amplifier lifts the small voltage over a shunt to the middle of the converter's range, so that both
//! signs fit. Where the middle lies differs from board to board and with temperature: it is found at each
//! start, while the bridge is off and no current can flow. A middle far from where it belongs, or one that
//! is not steady, is a broken amplifier or a motor that is being turned, and nothing to drive with. At either
//! end of the range the amplifier is at its rail, and the current may be any larger one: not valid.

/// Counts of a 12-bit converter.
pub const RANGE: u16 = 4096;
/// Samples an offset is the mean of.
pub const OFFSET_SAMPLES: u32 = 256;
/// Farthest an offset may lie from the middle, counts.
const OFFSET_MAX: u16 = RANGE / 10;
/// Farthest two samples may lie apart while the offset is found, counts.
const SPREAD_MAX: u16 = 64;
/// Counts at either end that are the rail.
const RAIL: u16 = 8;

/// One phase's amplifier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shunt {
    /// Counts at no current.
    offset: f32,
    /// Current per count, A; negative where counts fall with the current into the motor.
    amperes_per_count: f32,
}

impl Shunt {
    /// Current into the motor, A; `None` at a rail.
    #[inline(always)]
    pub fn current_a(&self, counts: u16) -> Option<f32> {
        let sound = (RAIL..RANGE - RAIL).contains(&counts);
        sound.then_some((f32::from(counts) - self.offset) * self.amperes_per_count)
    }
}

/// Finds an offset.
#[derive(Clone, Copy, Debug)]
pub struct OffsetFinder {
    sum: u32,
    samples: u32,
    least: u16,
    most: u16,
}

impl Default for OffsetFinder {
    fn default() -> Self {
        Self { sum: 0, samples: 0, least: u16::MAX, most: 0 }
    }
}

impl OffsetFinder {
    /// Takes in a sample with the bridge off.
    pub fn take(&mut self, counts: u16) {
        if self.samples < OFFSET_SAMPLES {
            self.sum += u32::from(counts);
            self.samples += 1;
            self.least = self.least.min(counts);
            self.most = self.most.max(counts);
        }
    }

    /// The amplifier, once there were [`OFFSET_SAMPLES`] and they make sense.
    pub fn shunt(&self, amperes_per_count: f32) -> Option<Shunt> {
        let middle = RANGE / 2;
        let steady = self.most.saturating_sub(self.least) <= SPREAD_MAX;
        let central = self.least > middle - OFFSET_MAX && self.most < middle + OFFSET_MAX;
        let sound = self.samples == OFFSET_SAMPLES && steady && central;
        let offset = self.sum as f32 / OFFSET_SAMPLES as f32;
        sound.then_some(Shunt { offset, amperes_per_count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(counts: impl Fn(u32) -> u16) -> Option<Shunt> {
        let mut finder = OffsetFinder::default();
        for sample in 0..OFFSET_SAMPLES {
            assert_eq!(finder.shunt(0.02), None, "too early");
            finder.take(counts(sample));
        }
        // More samples change nothing.
        finder.take(0);
        finder.shunt(0.02)
    }

    #[test]
    fn noise_is_averaged_out_and_signs_are_right() {
        let shunt = found(|sample| 2060 + (sample % 5) as u16).unwrap();
        assert!((shunt.current_a(2062).unwrap()).abs() < 0.001);
        assert!((shunt.current_a(3062).unwrap() - 20.0).abs() < 0.001);
        assert!((shunt.current_a(1062).unwrap() + 20.0).abs() < 0.001);
        let turned = Shunt { amperes_per_count: -0.02, ..shunt };
        assert!((turned.current_a(3062).unwrap() + 20.0).abs() < 0.001);
    }

    #[test]
    fn a_rail_is_no_current() {
        let shunt = found(|_| 2048).unwrap();
        for counts in [0, 7, 4088, 4095, u16::MAX] {
            assert_eq!(shunt.current_a(counts), None);
        }
        assert!(shunt.current_a(8).is_some() && shunt.current_a(4087).is_some());
    }

    #[test]
    fn what_is_off_centre_or_moves_is_refused() {
        assert_eq!(found(|_| 2048 + 410), None);
        assert_eq!(found(|_| 0), None);
        assert_eq!(found(|sample| if sample == 50 { 2120 } else { 2048 }), None);
        assert!(found(|sample| if sample == 50 { 2112 } else { 2048 }).is_some());
    }
}
