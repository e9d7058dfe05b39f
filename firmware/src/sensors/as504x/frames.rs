//! Commands and answers: the 16 bits of a frame.
//!
//! | bits | command | answer |
//! |---|---|---|
//! | 15 | even parity | even parity |
//! | 14 | 1: read | error flag |
//! | 13 to 0 | register | angle, or content of the register |
//!
//! An answer does not name its register, so the driver keeps what it awaits ([`Awaited`]). Flipped bits are found by the
//! parity, and a value that does not change by [`STUCK_AFTER_PAIRS`].

/// Type of the encoder, which differ in the address of their diagnostics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EncoderType {
    /// AS5047P: DIAAGC at 3FFCh.
    #[default]
    As5047p,
    /// AS5048A: diagnostics and AGC at 3FFDh.
    As5048a,
}

impl EncoderType {
    pub(super) const fn read_diagnostics(self) -> u16 {
        match self {
            Self::As5047p => command(0x3FFC),
            Self::As5048a => command(0x3FFD),
        }
    }
}

/// Number of pairs with an identical angle after which it counts as stuck: 0.2 s at 20 kHz.
///
/// With a noise of three counts at most every eighth sample repeats the previous one. Even with a tenth of
/// that noise and the angle in the middle of a count, the value still changes within this time.
pub const STUCK_AFTER_PAIRS: u16 = 4000;

/// Command to read the angle; both types have this address.
pub(super) const READ_ANGLE: u16 = command(0x3FFF);
/// Command to read the error register, which clears it.
pub(super) const READ_ERRORS: u16 = command(0x0001);

/// Faults of the magnet in the diagnostics of both types: 9 CORDIC overflow, 10 field too strong, 11 too weak.
const MAGNET_FAULTS: u16 = 0b1110 << 8;

/// Bit 14: in an answer the error flag, in a command *read*.
pub(super) const ERROR: u16 = 1 << 14;
/// The lower 14 bits: angle, register or register content.
pub(super) const DATA: u16 = ERROR - 1;

/// Returns a read command, with even parity in the top bit.
const fn command(register: u16) -> u16 {
    let word = ERROR | (register & DATA);
    word | ((word.count_ones() as u16 & 1) << 15)
}

/// Reason why a frame contains no angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderError {
    /// The parity is wrong.
    Parity,
    /// The angle has not changed for [`STUCK_AFTER_PAIRS`] pairs.
    Stuck,
    /// The encoder reports an error. The error register is being read, which clears the flag.
    Flagged,
    /// The frame carries no angle: it is the answer about errors or diagnostics.
    NoAngle,
    /// The frames of this period were not exchanged in time.
    Missing,
}

/// Content of the next answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Awaited {
    Angle,
    Errors,
    Diagnostics,
}

/// Evaluates answers: parity, flag, and whether the angle still changes.
#[derive(Debug)]
pub(super) struct AnswerCheck {
    /// Last diagnostics.
    diagnostics: u16,
    /// Last angle, and number of pairs since it changed.
    last: u16,
    identical_pairs: u16,
}

impl AnswerCheck {
    pub const fn new() -> Self {
        Self { diagnostics: 0, last: 0, identical_pairs: 0 }
    }

    pub const fn has_magnet_fault(&self) -> bool {
        self.diagnostics & MAGNET_FAULTS != 0
    }

    /// Returns the angle of an answer of which `awaited` is expected.
    #[inline(always)]
    pub fn angle(&mut self, awaited: Awaited, answer: u16) -> Result<u16, EncoderError> {
        if !answer.count_ones().is_multiple_of(2) {
            return Err(EncoderError::Parity);
        }
        match awaited {
            // The read has cleared the flag. Which error it was changes nothing.
            Awaited::Errors => Err(EncoderError::NoAngle),
            Awaited::Angle | Awaited::Diagnostics if answer & ERROR != 0 => {
                Err(EncoderError::Flagged)
            }
            Awaited::Diagnostics => {
                self.diagnostics = answer & DATA;
                Err(EncoderError::NoAngle)
            }
            Awaited::Angle => {
                let angle = answer & DATA;
                self.identical_pairs =
                    if angle == self.last { self.identical_pairs.saturating_add(1) } else { 0 };
                self.last = angle;
                if self.identical_pairs < STUCK_AFTER_PAIRS {
                    Ok(angle)
                } else {
                    Err(EncoderError::Stuck)
                }
            }
        }
    }
}
