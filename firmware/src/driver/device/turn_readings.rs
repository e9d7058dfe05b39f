//! The number of turns of a BiSS encoder (`biss_turn_bits`), for the home after a start.
//!
//! The interrupt evaluates the angle only. The background reads the turns from the first words of a frame, without the CRC.
//! So they count only if [`EQUAL_READINGS`] readings in a row are equal, and each has the position of the last report. Such a
//! joint is at rest or slow.
//!
//! The turns must also follow the motion that the driver sees. If they contradict it, the home is not kept.

use super::Device;
use crate::driver::home::{encoder_turns_of, has_turns, joint_rad_per_turn, wrapped_turns};
use crate::node::sdo::Abort;
use crate::sensors::biss::{self, TURN_WORDS};
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// Equal readings in a row, one in a millisecond: longer than the loop takes to apply a home.
const EQUAL_READINGS: u8 = 10;
/// Difference between the turns and the motion that is a contradiction, turns.
const MAX_DIFFERENCE: f32 = 0.25;

/// What is known of the turns.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TurnReadings {
    /// First words of the last frame; `None` without an encoder that counts turns.
    pub(super) words: Option<[u16; TURN_WORDS]>,
    last: Option<u16>,
    equal: u8,
    /// Number of the last home, which shifts the position.
    home_number: u32,
    /// Turns less those of the motion, at the first reading since that home.
    offset: Option<f32>,
    contradicts: bool,
}

impl TurnReadings {
    /// Returns true if the turns do not follow the motion.
    pub(super) const fn contradict(&self) -> bool {
        self.contradicts
    }

    /// Returns the number of turns, modulo 2^16; `None` while it is not known.
    pub(super) fn turns(&self) -> Option<u16> {
        self.last.filter(|_| self.equal >= EQUAL_READINGS && !self.contradicts)
    }
}

impl<F: NorFlash> Device<F> {
    /// Evaluates the first words of the last frame of a BiSS encoder, once per tick.
    #[inline(never)]
    pub(super) fn step_turn_readings(&mut self) {
        let (report, set) = (self.base.report(), self.base.set());
        if !has_turns(set) {
            return;
        }
        let bits = [set.sensors.biss_bits as u32, set.sensors.biss_turn_bits as u32];
        let is_reversed = set.motor.encoder_direction < 0.0;
        let (angle, turned_rad) = (self.angle_from_zero(report), report.turned_rad);
        let read = self.turn_readings.words.zip(angle).and_then(|(words, angle)| {
            let encoder = if is_reversed { angle.wrapping_neg() } else { angle } as u32;
            let turns = biss::turns(words, bits, encoder)?;
            // The negative of turns and angle together.
            let carry = u16::from(encoder == 0);
            Some(if is_reversed { (!turns).wrapping_add(carry) } else { turns })
        });
        let readings = &mut self.turn_readings;
        let home_number = self.base.current_loop.home().number;
        if readings.last != read || readings.home_number != home_number {
            readings.equal = 0;
        }
        if readings.home_number != home_number {
            readings.offset = None;
        }
        (readings.last, readings.home_number) = (read, home_number);
        readings.equal = readings.equal.saturating_add(1);
        let (Some(turns), Some(encoder)) = (readings.turns(), angle) else { return };
        let offset = encoder_turns_of(turns, encoder as u32) - turned_rad / joint_rad_per_turn(set);
        let first = *readings.offset.get_or_insert(offset);
        if wrapped_turns(offset - first, set).abs() > MAX_DIFFERENCE {
            readings.contradicts = true;
            let why = text!(
                "the number of turns of the encoder contradicts the motion: the home is not kept"
            );
            let _ = self.base.refuse(Abort::State, why);
        }
    }
}
