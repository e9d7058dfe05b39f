//! A joint without a compensator, behind the interface of the current loop.

use compensator_core::network::Factors;
use compensator_core::{CompensatorOutput, Flags, Inputs};
use firmware::control::Compensate;

/// A joint without a compensator.
#[derive(Clone, Copy, Debug)]
pub struct NoCompensation {
    /// Maximum current, A.
    pub current_limit_a: f32,
    /// Joint torque per motor current, Nm/A, gear included.
    pub torque_constant_nm_per_a: f32,
}

impl Compensate for NoCompensation {
    fn set_enabled(&mut self, _: bool) {}

    fn is_enabled(&self) -> bool {
        false
    }

    fn step(&mut self, _: &Inputs<f32>) -> CompensatorOutput<f32> {
        CompensatorOutput {
            friction_torque_nm: 0.0,
            compensation_torque_nm: 0.0,
            feed_forward_current_a: 0.0,
            flags: Flags::DISABLED,
        }
    }

    fn sum(&self, command_a: f32, output: &CompensatorOutput<f32>) -> (f32, Flags) {
        let limit_a = self.current_limit_a;
        let sum = if command_a.is_nan() { 0.0 } else { command_a.clamp(-limit_a, limit_a) };
        let mut flags = output.flags;
        flags.set(Flags::COMMAND_INVALID, command_a.is_nan());
        flags.set(Flags::CURRENT_LIMITED, sum != command_a && !command_a.is_nan());
        (sum, flags)
    }

    fn torque_constant_nm_per_a(&self) -> f32 {
        self.torque_constant_nm_per_a
    }

    fn supply(&mut self, _: Option<Factors<f32>>) {}

    fn bristle_torque_nm(&self) -> f32 {
        0.0
    }
}

#[test]
fn no_compensation_passes_and_limits_the_command() {
    let none = NoCompensation { current_limit_a: 5.0, torque_constant_nm_per_a: 1.0 };
    let output = { none }.step(&Inputs::velocity(1.0));
    assert_eq!(none.sum(-4.0, &output), (-4.0, Flags::DISABLED));
    assert_eq!(none.sum(9.0, &output), (5.0, Flags::DISABLED | Flags::CURRENT_LIMITED));
    assert_eq!(none.sum(f32::NAN, &output), (0.0, Flags::DISABLED | Flags::COMMAND_INVALID));
}
