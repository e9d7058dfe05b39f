//! Frames that hardware exchanges in pairs, two in each period.
//!
//! The second frame answers the first command, so its angle was latched between the two. The first frame
//! answers the second command of the previous period: the diagnostics, once a second, which therefore cost no
//! angle.

use super::frames::{AnswerCheck, Awaited, EncoderError, EncoderType, READ_ANGLE, READ_ERRORS};

/// Pairs from one reading of the diagnostics to the next: a second at 20 kHz.
const DIAGNOSE_EVERY_PAIRS: u16 = 20_000;
/// Pairs from the start to the first reading: 50 ms.
const DIAGNOSE_AFTER_PAIRS: u16 = 1000;

/// Evaluates pairs of frames.
#[derive(Debug)]
pub struct FramePairs {
    check: AnswerCheck,
    encoder_type: EncoderType,
    /// The next first command reads the error register.
    reads_errors: bool,
    /// The next second command, and the one before it, read the diagnostics.
    reads_diagnostics: bool,
    awaits_diagnostics: bool,
    /// Number of pairs until the next diagnostics.
    pairs_left: u16,
}

impl FramePairs {
    /// Commands of the first pair.
    pub const FIRST_COMMANDS: [u16; 2] = [READ_ANGLE; 2];

    /// Creates the state before the first pair, which holds [`FramePairs::FIRST_COMMANDS`].
    pub const fn new(encoder_type: EncoderType) -> Self {
        Self {
            check: AnswerCheck::new(),
            encoder_type,
            reads_errors: false,
            reads_diagnostics: false,
            awaits_diagnostics: false,
            pairs_left: DIAGNOSE_AFTER_PAIRS,
        }
    }

    /// Returns the commands of the next pair.
    #[inline(always)]
    pub const fn commands(&self) -> [u16; 2] {
        let first = if self.reads_errors { READ_ERRORS } else { READ_ANGLE };
        let second =
            if self.reads_diagnostics { self.encoder_type.read_diagnostics() } else { READ_ANGLE };
        [first, second]
    }

    /// Evaluates the answers of a pair; `None` if it was not exchanged in time. Returns the 14-bit angle,
    /// latched at the end of the first frame.
    ///
    /// # Errors
    /// Returns why there is no angle. Keep calling: the encoder recovers if possible.
    #[inline(always)]
    pub fn angle(&mut self, answers: Option<[u16; 2]>) -> Result<u16, EncoderError> {
        let awaited = if self.reads_errors { Awaited::Errors } else { Awaited::Angle };
        let angle = match answers {
            Some([first, second]) => {
                if self.awaits_diagnostics {
                    // A flag or wrong parity shows in the second answer, too, or the next time.
                    let _ = self.check.angle(Awaited::Diagnostics, first);
                }
                self.check.angle(awaited, second)
            }
            None => Err(EncoderError::Missing),
        };
        self.reads_errors = matches!(angle, Err(EncoderError::Flagged));
        self.awaits_diagnostics = self.reads_diagnostics;
        self.pairs_left -= 1;
        self.reads_diagnostics = self.pairs_left == 0;
        if self.reads_diagnostics {
            self.pairs_left = DIAGNOSE_EVERY_PAIRS;
        }
        angle
    }

    /// Returns true if the last diagnostics report a magnet that is too weak, too strong or misplaced.
    pub const fn has_magnet_fault(&self) -> bool {
        self.check.has_magnet_fault()
    }
}
