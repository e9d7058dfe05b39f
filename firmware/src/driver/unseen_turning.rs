//! A rotor that turns while its encoder stands: Hall sensors that are all stuck, lines without edges, a magnet off its shaft.
//!
//! Identical samples show a frozen encoder only if a sound one has noise ([`crate::control::observer`]). The current shows any.
//! In the frame of a standing angle, the voltage that the rotor induces rotates. The current along the magnet, whose reference
//! does not depend on the torque, then alternates twice in an electrical turn.
//!
//! ```text
//! level = 0.5 V / (2 pi f L)     f: bandwidth of the current loop;  L: inductance along the magnet
//! ```
//! A disturbance of 0.5 V, that of the dead time, drives less than this level. A held joint induces nothing, for any
//! current and its changes. Braking power that the winding burns has one sign.
//!
//! Half and twice the thresholds, in scenario 26 (simulated). No sound joint raises a fault with any of them:
//!
//! | threshold | half | as it is | twice |
//! |---|---|---|---|
//! | alternations: AS5047P turned by its load at 2 / 9 rad/s, ms | 16 / 14 | 29 / 17 | 51 / 22 |
//! | level: Hall sensors alone at 2 rad/s, ms | 29 | 34 | 34 |

use super::loop_data::LoopReport;
use crate::control::MotorParameters;
use core::f32::consts::TAU;

/// Voltage along the magnet that the dead time may add at a reversal of the torque, V.
const DISTURBANCE_V: f32 = 0.5;
/// Expected voltage from which the encoder is taken to turn, V: half of the disturbance.
const TURNING_V: f32 = 0.25;
/// Minimum level, A: five times the error of the sensors.
const LEVEL_MIN_A: f32 = 0.5;
/// Alternations that show a turning rotor: two and a half electrical turns, so that no swing of a held rotor suffices.
const ALTERNATIONS: u8 = 5;
/// Maximum time between two alternations, ms. A joint that hunts around the edge of a Hall sensor has more.
const GAP_MS: u8 = 10;

/// Memory of the current along the magnet.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UnseenTurning {
    alternations: u8,
    left_ms: u8,
    is_positive: bool,
}

impl UnseenTurning {
    /// Processes a report, once a millisecond; `expected_v` is the voltage that the speed of the encoder induces. Returns true
    /// if the rotor turns while the encoder stands.
    pub(super) fn step(
        &mut self,
        report: &LoopReport,
        motor: &MotorParameters,
        expected_v: f32,
    ) -> bool {
        self.left_ms = self.left_ms.saturating_sub(1);
        if self.left_ms == 0 || expected_v.abs() > TURNING_V {
            *self = Self::default();
        }
        let level_a = DISTURBANCE_V / (TAU * motor.current_bandwidth_hz * motor.inductance_d_h);
        let along_a = report.current_d_a;
        let is_positive = along_a > 0.0;
        if along_a.abs() >= level_a.max(LEVEL_MIN_A)
            && (self.left_ms == 0 || is_positive != self.is_positive)
        {
            *self = Self {
                alternations: self.alternations.saturating_add(1),
                left_ms: GAP_MS,
                is_positive,
            };
        }
        self.alternations > ALTERNATIONS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::loop_data::REPORT_PERIOD_S;

    /// Runs 0.2 s with this current along the magnet, A, and expected voltage, V; returns the time of the report, ms.
    fn found_ms(along_a: impl Fn(f32) -> f32, expected_v: f32) -> Option<usize> {
        let motor = MotorParameters::default();
        let mut turning = UnseenTurning::default();
        (0..200).find(|ms| {
            let current_d_a = along_a(*ms as f32 * REPORT_PERIOD_S);
            let report = LoopReport { current_d_a, ..LoopReport::default() };
            turning.step(&report, &motor, expected_v)
        })
    }

    #[test]
    fn turning_rotor_with_standing_encoder_is_found_within_three_electrical_turns() {
        for hz in [60.0f32, 120.0, 170.0, 330.0, 420.0] {
            let found = found_ms(|t| 2.0 * (TAU * hz * t).sin(), 0.0);
            let most_ms = (1e3 * 3.0 / hz) as usize + 3;
            assert!(found.is_some_and(|ms| ms <= most_ms), "{hz} Hz: {found:?} of {most_ms} ms");
        }
    }

    #[test]
    fn rotor_that_does_not_turn_unseen_is_not_found() {
        let motor = MotorParameters::default();
        let level_a = DISTURBANCE_V / (TAU * motor.current_bandwidth_hz * motor.inductance_d_h);
        let sine = |size_a: f32| move |t: f32| size_a * (TAU * 170.0 * t).sin();
        assert_eq!(found_ms(sine(0.95 * level_a), 0.0), None, "the effect of the dead time");
        assert_eq!(found_ms(sine(5.0), 0.3), None, "the encoder turns");
        assert_eq!(found_ms(|t| -13.0 + sine(13.0)(t), 0.0), None, "burnt braking power");
        assert_eq!(found_ms(|t| 5.0 * (TAU * 40.0 * t).sin(), 0.0), None, "hunting");
        let swing = |t: f32| if t < 0.013 { sine(5.0)(t) } else { 0.0 };
        assert_eq!(found_ms(swing, 0.0), None, "a swing of a held rotor");
        assert_eq!(found_ms(|_| f32::NAN, 0.0), None);
    }
}
