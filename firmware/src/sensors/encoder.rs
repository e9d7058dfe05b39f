//! The motor's encoder, of the kind that the parameter `encoder_kind` selects.
//!
//! ```text
//! board: EncoderInputs (frames, counts, levels) -> MotorEncoder::angle -> binary angle, or None
//! ```
//! A board supplies what it has read in a period, and the kind of the encoder turns it into an angle. No angle means
//! that this period has no valid one: the observer coasts, and past `encoder_coast_s` the bridge opens.
//!
//! | kind | encoder | angle after a start |
//! |---|---|---|
//! | 0, 1 | AS5047P, AS5048A ([`super::as504x`]) | at once |
//! | 2 | ABZ, a quadrature encoder with an index ([`super::quadrature`]) | from the first index on |
//! | 3 | ABZ with Hall sensors | at once, from the Hall sensors |
//! | 4 | Hall sensors alone ([`super::hall`]) | at once |
//! | 5 | an absolute encoder with BiSS C ([`super::biss`]) | at once |

use super::as504x::{ANGLE_BITS, EncoderType, FramePairs};
pub use super::encoder_kind::EncoderKind;

use super::biss::{self, BissEncoder};
use super::evaluation::Evaluation;
use super::hall::{HallEncoder, sector};
use super::quadrature::{Quadrature, QuadratureEncoder};
use crate::control::encoder_angle;
use crate::start_values::StartValues;

/// What a board reads of an encoder in each period. An encoder calls only the functions of its kind.
pub trait EncoderInputs {
    /// Returns the answers of the two frames of this period ([`FramePairs`]); `None` if they were not exchanged in time.
    fn frames(&mut self) -> Option<[u16; 2]>;

    /// Sets the commands of the next two frames.
    fn set_commands(&mut self, commands: [u16; 2]);

    /// Returns counter, index and edges of a quadrature encoder.
    fn quadrature(&mut self) -> Quadrature;

    /// Returns the levels of the three Hall sensors, bits 0 to 2.
    fn hall(&mut self) -> u8;

    /// Returns the words of a BiSS frame; `None` if they were not exchanged in time.
    fn biss(&mut self) -> Option<[u16; biss::WORDS]>;
}

/// Periods without an angle after a contradiction: longer than the longest `encoder_coast_s`, so that the bridge opens.
pub const INVALID_PERIODS: u16 = 500;

/// Periods for which a fault is reported at least: 0.5 s.
const WARNING_PERIODS: u16 = 10_000;

/// The kinds but the AS504x.
#[derive(Debug)]
enum OtherEncoder {
    None,
    Quadrature(QuadratureEncoder),
    Hall(HallEncoder),
    Biss(BissEncoder),
}

/// The motor's encoder.
#[derive(Debug)]
pub struct MotorEncoder {
    frames: FramePairs,
    other: OtherEncoder,
    /// Lowest bit of the angle, which changes in each period where identical samples are no sign of a frozen encoder; and what
    /// changes it, 0 or 1.
    low_bit: u32,
    changes_low_bit: u32,
    /// There was an angle. A start without one is no fault.
    has_started: bool,
    /// Periods left without an angle, and with a warning.
    invalid_left: u16,
    warning_left: u16,
}

impl MotorEncoder {
    /// Creates the encoder that the values of a start select.
    pub fn new(start: &StartValues) -> Self {
        let kind = start.kind();
        let is_as5048a = kind == EncoderKind::As5048a;
        let encoder_type = if is_as5048a { EncoderType::As5048a } else { EncoderType::As5047p };
        let other = match kind {
            EncoderKind::As5047p | EncoderKind::As5048a => OtherEncoder::None,
            EncoderKind::Abz | EncoderKind::AbzHall => {
                let has_hall = kind == EncoderKind::AbzHall;
                OtherEncoder::Quadrature(QuadratureEncoder::new(start, has_hall))
            }
            EncoderKind::Hall => OtherEncoder::Hall(HallEncoder::new(start.pole_pairs)),
            EncoderKind::Biss => {
                let [bits, turn_bits] =
                    [start.biss_bits, start.biss_turn_bits].map(|bits| bits as u32);
                OtherEncoder::Biss(BissEncoder::new(bits, turn_bits))
            }
        };
        let frames = FramePairs::new(encoder_type);
        let changes_low_bit = u32::from(kind.has_wide_steps(start.abz_lines));
        Self {
            frames,
            other,
            low_bit: 0,
            changes_low_bit,
            has_started: false,
            invalid_left: 0,
            warning_left: 0,
        }
    }

    /// Returns the angle of this period, in 2^-32 turns of the motor; `None` if there is no valid one. Call it once a period.
    #[inline(always)]
    pub fn angle(&mut self, inputs: &mut impl EncoderInputs) -> Option<u32> {
        if matches!(self.other, OtherEncoder::None) {
            let angle = self.frames.angle(inputs.frames()).ok();
            inputs.set_commands(self.frames.commands());
            return angle.map(|angle| encoder_angle(u32::from(angle), ANGLE_BITS));
        }
        self.other_angle(inputs)
    }

    /// The kinds but the AS504x, apart from its path.
    #[inline(never)]
    fn other_angle(&mut self, inputs: &mut impl EncoderInputs) -> Option<u32> {
        let evaluation = match &mut self.other {
            OtherEncoder::None => Evaluation::Missing,
            OtherEncoder::Quadrature(encoder) => {
                encoder.evaluate(inputs.quadrature(), || sector(inputs.hall()))
            }
            OtherEncoder::Hall(encoder) => encoder.evaluate(sector(inputs.hall())),
            OtherEncoder::Biss(encoder) => encoder.evaluate(inputs.biss()),
        };
        self.invalid_left = self.invalid_left.saturating_sub(1);
        self.warning_left = self.warning_left.saturating_sub(1);
        let (angle, is_sound) = match evaluation {
            Evaluation::Angle(angle) => (Some(angle), true),
            Evaluation::Doubtful(angle) => (Some(angle), false),
            Evaluation::Missing => (None, false),
            Evaluation::Contradiction => {
                self.invalid_left = INVALID_PERIODS;
                (None, false)
            }
        };
        self.has_started |= angle.is_some();
        if !is_sound && self.has_started {
            self.warning_left = WARNING_PERIODS;
        }
        self.low_bit ^= self.changes_low_bit;
        angle.filter(|_| self.invalid_left == 0).map(|angle| angle ^ self.low_bit)
    }

    /// Returns true if the encoder has a fault although its angle may still be valid: of the magnet of an AS504x, or of the
    /// index, counts or levels of the others in the last 0.5 s.
    pub const fn has_warning(&self) -> bool {
        self.warning_left > 0 || self.frames.has_magnet_fault()
    }
}
