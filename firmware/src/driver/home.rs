//! The home of a joint over a reset or a power cut: what is kept, and what the next start makes of it.
//!
//! An encoder on the motor is absolute within its range: a turn of the motor, or the number of turns that it counts
//! ([`has_turns`]). After a start the joint is therefore where it was, or a number of whole ranges away. Kept are the position,
//! angle and turns of the encoder at the same time, and whether the joint could move.
//! The next start takes the nearest position that fits the measured angle, if all of this holds:
//!
//! - the joint was disarmed and at rest at the end of the previous run;
//! - the motor has turned by less than [`MOVED_MAX_TURNS`] of the encoder's range;
//! - gear, directions and encoder are the same.
//!
//! RAM keeps the home over a reset, and a record in flash over a power cut. Otherwise the home is lost, and 2028h has the reason.
//! A move by whole turns of the motor without the driver cannot be seen by an encoder of a single turn.
//! The electrical zero has no part in this: the kept angle is that of the encoder itself.
//!
//! Counts and Hall sensors start anew with each reset, so that a joint with them is homed after each start.

use crate::parameter_set::ParameterSet;
use crate::sensors::encoder::EncoderKind;
use compensator_core::parameters::Text;
use compensator_core::text;

/// Rotation of the motor without the driver up to which its direction is sure, in ranges of the encoder: a turn, or the turns
/// that it counts. It is half a range, less a margin.
pub const MOVED_MAX_TURNS: f32 = 0.4;

/// Rotation of the motor up to which a record in flash stays valid, turns. It is small against the margin of
/// [`MOVED_MAX_TURNS`], and large against what a disarmed joint turns at rest.
pub const RECORD_RANGE_TURNS: f32 = 0.05;
const RECORD_RANGE: u32 = (RECORD_RANGE_TURNS * UNITS_PER_TURN) as u32;

const UNITS_PER_TURN: f32 = (1u64 << 32) as f32;

/// Position of a joint, kept over a reset or a power cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptHome {
    /// Joint position, rad.
    pub position_rad: f32,
    /// Angle of the rotor from the encoder's zero at that position, 2^-32 turns, in the motor's direction.
    pub encoder: u32,
    /// Number of the parameters of the shaft.
    pub shaft: u16,
    /// The joint was armed, or it moved.
    pub may_move: bool,
    /// Number of turns of the encoder in the motor's direction, modulo 2^16; `None` if it counts none.
    pub turns: Option<u16>,
}

impl KeptHome {
    /// Returns the words that are kept.
    pub const fn to_words(self) -> [u32; 4] {
        let (turns, has_turns) = match self.turns {
            Some(turns) => (turns, 1),
            None => (0, 0),
        };
        let flags = self.may_move as u32 | has_turns << 1 | (turns as u32) << 16;
        [self.position_rad.to_bits(), self.encoder, self.shaft as u32, flags]
    }

    /// Returns the home of kept words.
    pub const fn from_words([position, encoder, shaft, flags]: [u32; 4]) -> Self {
        let position_rad = f32::from_bits(position);
        let turns = if flags & 2 == 0 { None } else { Some((flags >> 16) as u16) };
        Self { position_rad, encoder, shaft: shaft as u16, may_move: flags & 1 != 0, turns }
    }

    /// Returns true if a joint with the `present` position has turned by less than `RECORD_RANGE_TURNS` since this one.
    pub fn is_near(&self, present: &Self) -> bool {
        let turned = present.encoder.wrapping_sub(self.encoder) as i32;
        self.shaft == present.shaft && turned.unsigned_abs() < RECORD_RANGE
    }

    /// Returns the position, rad, at which the encoder shows this angle, 2^-32 turns, and this number of turns.
    ///
    /// # Errors
    /// Returns why it is not known.
    pub fn position_at(
        &self,
        encoder: u32,
        turns: Option<u16>,
        set: &ParameterSet,
    ) -> Result<f32, Text> {
        let (turned, range) = match (self.turns, turns) {
            (Some(kept), Some(turns)) => {
                let whole = f32::from(turns.wrapping_sub(kept) as i16);
                let part = (encoder as f32 - self.encoder as f32) / UNITS_PER_TURN;
                (wrapped_turns(whole + part, set), turns_range(set))
            }
            _ => (encoder.wrapping_sub(self.encoder) as i32 as f32 / UNITS_PER_TURN, 1.0),
        };
        if self.shaft != shaft_number(set) {
            Err(text!(
                "the home is lost: gear, directions or encoder are others than in the previous run"
            ))
        } else if self.may_move {
            Err(text!("the home is lost: the joint was armed or moved when the previous run ended"))
        } else if turned.abs() > MOVED_MAX_TURNS * range {
            Err(text!(
                "the home is lost: the motor has turned by more than 0.4 of the encoder's range since the previous run"
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

/// Returns true if the encoder counts turns.
pub fn has_turns(set: &ParameterSet) -> bool {
    EncoderKind::of(set.sensors.encoder_kind) == EncoderKind::Biss
        && set.sensors.biss_turn_bits >= 1.0
}

/// Returns the number of turns after which the encoder's count begins again; 2^16 at most.
fn turns_range(set: &ParameterSet) -> f32 {
    (1u32 << (set.sensors.biss_turn_bits as u32).min(16)) as f32
}

/// Returns a difference of turns within half the range of the encoder.
pub fn wrapped_turns(turns: f32, set: &ParameterSet) -> f32 {
    let range = turns_range(set);
    // The range is a power of two, so that this is exact. `%` takes 0.7 KB of an image.
    let rest = turns - range * ((turns / range) as i32 as f32);
    if rest > 0.5 * range {
        rest - range
    } else if rest < -0.5 * range {
        rest + range
    } else {
        rest
    }
}

/// Returns the position of the encoder, turns, with a resolution of 0.01 turns.
pub fn encoder_turns_of(turns: u16, encoder: u32) -> f32 {
    f32::from(turns) + encoder as f32 / UNITS_PER_TURN
}

/// Returns a number of the parameters that relate the encoder to the joint.
pub fn shaft_number(set: &ParameterSet) -> u16 {
    let (motor, sensors) = (&set.motor, &set.sensors);
    let values = [
        motor.gear_ratio,
        motor.joint_direction,
        motor.encoder_direction,
        sensors.encoder_kind,
        sensors.biss_turn_bits,
    ];
    let number =
        values.into_iter().fold(0u32, |number, value| number.rotate_left(7) ^ value.to_bits());
    (number ^ number >> 16) as u16
}

/// Returns the rotation of the joint in a turn of the rotor, rad.
pub fn joint_rad_per_turn(set: &ParameterSet) -> f32 {
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
            turns: None,
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
                let position = home.position_at(home.encoder.wrapping_add(turned), None, &set);
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
            home.position_at(home.encoder.wrapping_add(turned), None, set).is_err()
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
