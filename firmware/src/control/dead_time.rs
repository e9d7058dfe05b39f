//! The voltage that the dead time of the bridge takes from a phase, and its compensation.
//!
//! Between the two switches of a phase both are open for the dead time. The current then flows through a diode, so that a
//! phase loses voltage against its current, twice a period. At a small current it only charges the switches, and less is
//! lost:
//!
//! ```text
//! lost = bus * share * i / (|i| + current_a)        share: dead time over period
//! ```
//! The sum of both changes sign with each current, six times per electrical turn. The loop adds it to the phases before it
//! acts. The currents are those of the *reference*, turned to the angle of the period in which the duties act. Measured
//! currents would close a loop with a gain of `bus share / current_a`, several times the resistance: it oscillates if
//! `share` is too large, and turns the noise of the sensors into voltage at rest. The reference has neither.
//!
//! The exact share is [`charged_share`], which commissioning uses: a current that turns the phase over within the dead time
//! loses all but half of the time that this takes.
//!
//! A share that is wrong by a factor of two leaves at most the distortion of a bridge without compensation.

use super::transform::{Rotating, Rotation, inverse_clarke};

/// Length of the longest vector of the voltages that can be lost, per voltage lost by one phase.
pub const LONGEST_VECTOR: f32 = 4.0 / 3.0;

/// Returns the share of the voltage that a phase loses at a current, which is positive and relative to that of half the loss.
#[inline(always)]
pub fn charged_share(x: f32) -> f32 {
    if x < 1.0 { 0.5 * x } else { 1.0 - 0.5 / x }
}

/// Voltage lost over the current of a phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossModel {
    /// Voltage lost at a large current, per bus voltage.
    pub share: f32,
    /// Current at which half of it is lost, A; positive.
    pub current_a: f32,
}

impl LossModel {
    /// Adds to the voltages of the phases what the bridge will take from them at a current, V.
    #[inline(always)]
    pub fn compensate(
        &self,
        phases_v: [f32; 3],
        current: Rotating,
        then: Rotation,
        bus_v: f32,
    ) -> [f32; 3] {
        let [a, b, c] = inverse_clarke(then.inverse_park(current));
        // Written out: the compiler makes a loop over memory of `map`.
        let (x, y, z) =
            (a.abs() + self.current_a, b.abs() + self.current_a, c.abs() + self.current_a);
        // One division instead of three: it takes as long as fourteen products.
        let (yz, lost_v) = (y * z, self.share * bus_v);
        let per_a = lost_v / (x * yz);
        let [va, vb, vc] = phases_v;
        let x = x * per_a;
        [va + a * (yz * per_a), vb + b * (x * z), vc + c * (x * y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::transform::{Stationary, clarke};

    const MODEL: LossModel = LossModel { share: 0.01, current_a: 0.2 };

    #[test]
    fn compensation_of_a_vector_is_the_loss_of_each_phase() {
        for angle in (0..64u32).map(|i| i << 26) {
            let (then, current) = (Rotation::at(angle), Rotating { d: -0.4, q: 3.0 });
            let flows = inverse_clarke(then.inverse_park(current));
            let added = MODEL.compensate([1.0, -2.0, 1.0], current, then, 48.0);
            for ((added, flow), before) in added.into_iter().zip(flows).zip([1.0, -2.0, 1.0]) {
                let lost = 0.48 * flow / (flow.abs() + 0.2);
                assert!((added - before - lost).abs() < 1e-5, "{flow}: {added} of {before}");
            }
            let Stationary { alpha, beta } = clarke(added);
            assert!(alpha.hypot(beta) < 2.0 + 0.48 * LONGEST_VECTOR + 1e-5);
        }
    }

    #[test]
    fn compensation_without_current_or_share_is_nothing() {
        let (then, phases) = (Rotation::at(77), [0.25, -1.5, 1.25]);
        assert_eq!(MODEL.compensate(phases, Rotating::default(), then, 48.0), phases);
        let none = LossModel { share: 0.0, ..MODEL };
        assert_eq!(none.compensate(phases, Rotating { d: 0.0, q: 9.0 }, then, 48.0), phases);
    }

    #[test]
    fn compensation_of_largest_currents_is_finite_and_bounded() {
        for q in [1e-30, 0.2, 30.0, 1e4] {
            let current = Rotating { d: -q, q };
            let added = MODEL.compensate([0.0; 3], current, Rotation::at(1 << 29), 60.0);
            assert!(added.into_iter().all(|volts| volts.abs() <= 0.6), "{q}: {added:?}");
        }
    }
}
