//! The stroke: the travel of the joint between two reversals, compared with the strokes of the training data.
//!
//! The ranges of momentary inputs do not identify the motion. For example, an earthquake stays within the speeds of a
//! sine test, but moves the damper only inside its gap. A sine test with full stroke never does. The stroke
//! distinguishes the two.

use crate::number::Real;

/// Strokes of the training data, and the threshold that distinguishes a reversal from noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeRange<T> {
    /// Shortest stroke of the training data, rad or m.
    pub least: T,
    /// Longest stroke of the training data, rad or m.
    pub most: T,
    /// Return travel that counts as a reversal, rad or m.
    pub reversal: T,
    /// Evaluation period, s.
    pub period_s: T,
}

impl<T: Real> StrokeRange<T> {
    /// Converts the range to another number type.
    pub fn convert<R: Real>(&self) -> StrokeRange<R> {
        let number = |value: T| R::from_f64(value.value());
        StrokeRange {
            least: number(self.least),
            most: number(self.most),
            reversal: number(self.reversal),
            period_s: number(self.period_s),
        }
    }
}

/// Tracks the current and the previous stroke.
#[derive(Clone, Copy, Debug, Default)]
pub struct StrokeTracker<T> {
    /// Signed travel since the last reversal, rad or m.
    since_reversal: T,
    /// Largest travel since the last reversal, signed, rad or m.
    farthest: T,
    /// Length of the previous stroke, rad or m.
    last: T,
}

impl<T: Real> StrokeTracker<T> {
    /// Advances by one evaluation at this velocity (rad/s or m/s; NaN counts as rest).
    ///
    /// Returns true if the stroke ([`StrokeTracker::length`]) is within the range of the training data.
    #[inline]
    pub fn is_known(&mut self, velocity: T, range: &StrokeRange<T>) -> bool {
        self.since_reversal = self.since_reversal + velocity.or_zero_if_nan() * range.period_s;
        let onwards = self.since_reversal * self.farthest >= T::zero();
        if onwards && self.since_reversal.abs() > self.farthest.abs() {
            self.farthest = self.since_reversal;
        }
        let back = (self.farthest - self.since_reversal).abs();
        if back > range.reversal {
            self.last = self.farthest.abs();
            self.since_reversal = self.since_reversal - self.farthest;
            self.farthest = self.since_reversal;
        }
        let length = self.length();
        length >= range.least && length <= range.most
    }

    /// Returns the length of the previous or of the current stroke, whichever is longer, rad or m.
    pub fn length(&self) -> T {
        self.last.at_least(self.farthest.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stroke_within_trained_range_is_known_and_outside_is_not() {
        let range = StrokeRange { least: 0.04, most: 0.08, reversal: 5e-4, period_s: 1.0 / 128.0 };
        let known = |amplitude: f64| {
            let mut stroke = StrokeTracker::default();
            let mut last = (false, 0.0);
            for step in 0..1024 {
                let phase = core::f64::consts::TAU * f64::from(step) / 128.0;
                // This noise is below the reversal threshold.
                let noise = if step % 2 == 0 { 0.02 } else { -0.02 };
                let velocity = amplitude * core::f64::consts::TAU * libm::cos(phase) + noise;
                last = (stroke.is_known(velocity, &range), stroke.length());
            }
            last
        };
        for (amplitude, expected) in [(0.03, true), (0.005, false), (0.06, false)] {
            let (is_known, length) = known(amplitude);
            assert_eq!(is_known, expected, "{amplitude}");
            assert!((length - 2.0 * amplitude).abs() < 0.05 * amplitude + 2e-4, "{length}");
        }
        let mut rest = StrokeTracker::default();
        assert!(!rest.is_known(f64::NAN, &range));
        assert_eq!(rest.length(), 0.0);
    }
}
