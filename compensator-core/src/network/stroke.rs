//! How far the joint goes from one reversal to the next, and which of such strokes were trained on.
//!
//! Ranges of momentary inputs do not say what motion they belong to: an earthquake keeps within the speeds of a
//! sine test and yet moves the damper to and fro inside its gap, which no sine test of full stroke does. The stroke
//! tells them apart.

use crate::number::Real;

/// Travel that was trained on, and how a reversal is told from noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeRange<T> {
    /// Shortest stroke trained on, rad or m.
    pub least: T,
    /// Longest one, rad or m.
    pub most: T,
    /// Way back that makes a reversal, rad or m.
    pub reversal: T,
    /// Time from one evaluation to the next, s.
    pub period_s: T,
}

/// The motion so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stroke<T> {
    /// Way since the last reversal, with its sign.
    since_reversal: T,
    /// Its farthest point.
    farthest: T,
    /// Length of the stroke before.
    last: T,
}

impl<T: Real> Stroke<T> {
    /// Goes on by one evaluation at this velocity (rad/s or m/s; what is no number is rest) and says whether the
    /// stroke, the last one or the one under way if that is longer, is among those trained on.
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

    /// The last stroke, or the one under way if that is longer, rad or m.
    pub fn length(&self) -> T {
        self.last.at_least(self.farthest.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_of_known_amplitude_is_known_after_its_first_stroke_and_a_small_one_is_not() {
        let range = StrokeRange { least: 0.04, most: 0.08, reversal: 5e-4, period_s: 1.0 / 128.0 };
        let known = |amplitude: f64| {
            let mut stroke = Stroke::default();
            let mut last = (false, 0.0);
            for step in 0..1024 {
                let phase = core::f64::consts::TAU * f64::from(step) / 128.0;
                // A little noise makes no reversal.
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
        let mut rest = Stroke::default();
        assert!(!rest.is_known(f64::NAN, &range));
        assert_eq!(rest.length(), 0.0);
    }
}
