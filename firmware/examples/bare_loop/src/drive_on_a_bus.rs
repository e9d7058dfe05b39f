//! Feed-forward over the bus, for a drive that is not ours.
//!
//! A master that moves a CiA 402 drive computes the friction from the *set-point* and sends it in object 60B2h (torque offset,
//! thousandths of the rated torque, `i16`), mapped to a receive PDO of the drive. The drive adds it to the torque of its own loops.
//! No measurement enters, so the feed-forward cannot oscillate with the joint. The compensator limits torque and slew rate.

use crate::friction;
use compensator_core::{Compensator, Inputs, ParameterError, Quantity, Reading};

/// Period of the set-points, s: one for each SYNC.
const PERIOD_S: f32 = 1e-3;

/// Friction of one drive as a torque offset.
pub struct FeedForward {
    compensator: Compensator<f32>,
    /// Torque of one thousandth, Nm: object 6076h of the drive times its gear ratio.
    nm_per_permille: f32,
}

impl FeedForward {
    /// Builds the feed-forward of a joint with this rated torque, Nm, behind the gear.
    ///
    /// # Errors
    /// Returns the refused parameter and the reason.
    pub fn build(rated_torque_nm: f32) -> Result<Self, ParameterError> {
        let mut compensator = Compensator::build(&friction::configuration(), PERIOD_S)?;
        compensator.set_enabled(true);
        Ok(Self { compensator, nm_per_permille: rated_torque_nm / 1000.0 })
    }

    /// Returns the data of the receive PDO for a set-point: its velocity, rad/s, and the last pressure, Pa.
    pub fn step(&mut self, velocity_rad_s: f32, pressure_pa: Reading<f32>) -> [u8; 2] {
        let inputs = Inputs::velocity(velocity_rad_s).with_reference(velocity_rad_s).with(
            Quantity::Pressure,
            pressure_pa.value,
            pressure_pa.age_s,
        );
        let torque_nm = self.compensator.step(&inputs).compensation_torque_nm;
        // The cast saturates.
        ((torque_nm / self.nm_per_permille) as i16).to_le_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_returns_the_friction_of_the_set_point_in_thousandths() {
        let mut drive = FeedForward::build(20.0).unwrap();
        let settled = |drive: &mut FeedForward, velocity: f32| {
            let data = (0..2000).map(|_| drive.step(velocity, Reading::fresh(1e5))).last().unwrap();
            i16::from_le_bytes(data)
        };
        // 80 % of Coulomb, pressure and viscous torque.
        let expected = 1000.0 * 0.8 * (1.07 + 2.4e-6 * 1e5 + 0.41) / 20.0;
        for (velocity, expected) in [(1.0, expected), (-1.0, -expected)] {
            let found = f32::from(settled(&mut drive, velocity));
            assert!((found - expected).abs() < 1.5, "{velocity}: {found} {expected}");
        }
    }
}
