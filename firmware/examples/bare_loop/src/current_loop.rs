//! A current loop that uses the compensator.

use crate::friction;
use compensator_core::{Compensator, Inputs, ParameterError, Quantity};

/// Sample period of the loop, s: 20 kHz.
const PERIOD_S: f32 = 50e-6;

/// Number of steps in one second.
const STEPS: u32 = 20_000;

/// Current commanded by the motion controller, A.
const COMMAND_A: f32 = 0.5;

/// Runs the loop for one second and returns the largest current, A.
///
/// # Errors
/// Returns the refused parameter and the reason.
pub fn largest_current_a() -> Result<f32, ParameterError> {
    let mut compensator = Compensator::<f32>::build(&friction::configuration(), PERIOD_S)?;
    compensator.set_enabled(true);
    let mut largest_a = 0.0f32;
    for step in 0..STEPS {
        // Up to 1 rad/s and back.
        let share = step as f32 / STEPS as f32;
        let velocity_rad_s = if share < 0.5 { 2.0 * share } else { 2.0 - 2.0 * share };
        // A fresh reading of 1 bar. A model with other terms needs `.with(Quantity::Position, ...)` and so on.
        let inputs = Inputs::velocity(velocity_rad_s).with(Quantity::Pressure, 1e5, 0.0);
        let output = compensator.step(&inputs);
        let (current_a, _flags) = compensator.sum(COMMAND_A, &output);
        largest_a = largest_a.max(current_a);
    }
    Ok(largest_a)
}

#[cfg(test)]
mod tests {
    /// The friction is Coulomb, pressure and viscous torque at 1 rad/s, scaled and divided by the torque
    /// constant.
    #[test]
    fn loop_adds_the_friction_current_to_the_command() {
        let friction_nm = 1.07 + 2.4e-6 * 1e5 + 0.41;
        let expected_a = super::COMMAND_A + 0.8 * friction_nm / 0.9;
        let found_a = super::largest_current_a().unwrap();
        assert!((found_a - expected_a).abs() < 0.02 * expected_a, "{found_a} {expected_a}");
    }
}
