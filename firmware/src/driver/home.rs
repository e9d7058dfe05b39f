//! The home of a joint over a reset: what is kept while the driver runs, and what the next start makes of it.
//!
//! An encoder on the motor is absolute within a turn of the motor. After a reset the joint is therefore where it was, or a
//! number of whole turns away. Kept are the position, the encoder's angle at the same time, and whether the joint could move.
//! The next start takes the nearest position that fits the measured angle, if all of this holds:
//!
//! - the joint was disarmed and at rest at the end of the previous run;
//! - the motor has turned by less than [`MOVED_MAX_TURNS`];
//! - gear, directions and encoder are the same.
//!
//! Otherwise the home is lost, and 2028h has the reason. A move by whole turns of the motor without the driver cannot be seen.
//! The electrical zero has no part in this: the kept angle is that of the encoder itself.
//!
//! Counts and Hall sensors start anew with each reset, so that a joint with them is homed after each start.

use crate::parameter_set::ParameterSet;
use crate::sensors::encoder::EncoderKind;
use compensator_core::parameters::Text;
use compensator_core::text;

/// Rotation of the motor without the driver up to which its direction is sure, turns: half a turn, less a margin.
pub const MOVED_MAX_TURNS: f32 = 0.4;

const UNITS_PER_TURN: f32 = (1u64 << 32) as f32;

/// Position of a joint, kept over a reset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptHome {
    /// Joint position, rad.
    pub position_rad: f32,
    /// Angle of the rotor from the encoder's zero at that position, 2^-32 turns, in the motor's direction.
    pub encoder: u32,
    /// Number of the parameters of the shaft.
    pub shaft: u32,
    /// The joint was armed, or it moved.
    pub may_move: bool,
}

impl KeptHome {
    /// Returns the words that are kept.
    pub const fn to_words(self) -> [u32; 4] {
        [self.position_rad.to_bits(), self.encoder, self.shaft, self.may_move as u32]
    }

    /// Returns the home of kept words.
    pub const fn from_words([position, encoder, shaft, may_move]: [u32; 4]) -> Self {
        let position_rad = f32::from_bits(position);
        Self { position_rad, encoder, shaft, may_move: may_move != 0 }
    }

    /// Returns the position at which the encoder shows this angle.
    ///
    /// # Errors
    /// Returns why it is not known.
    pub fn position_at(&self, encoder: u32, set: &ParameterSet) -> Result<f32, Text> {
        let turned = encoder.wrapping_sub(self.encoder) as i32 as f32 / UNITS_PER_TURN;
        if self.shaft != shaft_number(set) {
            Err(text!(
                "the home is lost: gear, directions or encoder are others than before the reset"
            ))
        } else if self.may_move {
            Err(text!("the home is lost: the joint was armed or moved at the reset"))
        } else if turned.abs() > MOVED_MAX_TURNS {
            Err(text!(
                "the home is lost: the motor has turned by more than 0.4 turns since the reset"
            ))
        } else {
            Ok(self.position_rad + turned * joint_rad_per_turn(set))
        }
    }
}

/// Returns true if the angle of the encoder has the same meaning after a reset.
pub fn is_absolute(set: &ParameterSet) -> bool {
    let kind = EncoderKind::of(set.sensors.encoder_kind);
    matches!(kind, EncoderKind::As5047p | EncoderKind::As5048a | EncoderKind::Biss)
}

/// Returns a number of the parameters that relate the encoder to the joint.
pub fn shaft_number(set: &ParameterSet) -> u32 {
    let (motor, sensors) = (&set.motor, &set.sensors);
    let values =
        [motor.gear_ratio, motor.joint_direction, motor.encoder_direction, sensors.encoder_kind];
    values.into_iter().fold(0, |number: u32, value| number.rotate_left(7) ^ value.to_bits())
}

/// Returns the rotation of the joint in a turn of the rotor, rad.
fn joint_rad_per_turn(set: &ParameterSet) -> f32 {
    let motor = &set.motor;
    core::f32::consts::TAU * motor.joint_direction / motor.gear_ratio
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUARTER: u32 = 1 << 30;

    fn kept(set: &ParameterSet) -> KeptHome {
        KeptHome {
            position_rad: 1.5,
            encoder: u32::MAX - 5,
            shaft: shaft_number(set),
            may_move: false,
        }
    }

    #[test]
    fn position_after_a_reset_is_the_nearest_that_fits_the_angle() {
        let mut set = ParameterSet::default();
        for (encoder, joint) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)] {
            set.motor.encoder_direction = encoder;
            set.motor.joint_direction = joint;
            let home = KeptHome::from_words(kept(&set).to_words());
            assert_eq!(home, kept(&set));
            for (turned, sign) in [(QUARTER, 1.0), (QUARTER.wrapping_neg(), -1.0)] {
                let position = home.position_at(home.encoder.wrapping_add(turned), &set);
                let expected = 1.5 + sign * joint * core::f32::consts::TAU / 4.0 / 51.0;
                assert!((position.expect("it is known") - expected).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn home_is_lost_after_motion_or_near_half_a_turn_or_with_another_gear() {
        let set = ParameterSet::default();
        let home = kept(&set);
        let reason = |home: KeptHome, turned: f32, set: &ParameterSet| {
            let turned = (turned * UNITS_PER_TURN) as i32 as u32;
            home.position_at(home.encoder.wrapping_add(turned), set).is_err()
        };
        assert!(!reason(home, 0.39, &set) && reason(home, 0.41, &set) && reason(home, -0.41, &set));
        assert!(reason(KeptHome { may_move: true, ..home }, 0.0, &set));
        let mut other = set.clone();
        other.motor.gear_ratio = 50.0;
        assert!(reason(home, 0.0, &other));
        other = set.clone();
        other.motor.encoder_offset_rad = 1.0;
        assert!(!reason(home, 0.0, &other), "the electrical zero has no part in it");
        other.sensors.encoder_kind = 4.0;
        assert!(!is_absolute(&other) && is_absolute(&set));
    }
}
