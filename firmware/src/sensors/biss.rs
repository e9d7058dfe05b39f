//! An encoder with the BiSS C interface: a position in a frame with a CRC, sent while the master clocks it.
//!
//! ```text
//! MA  idle high | clocks of the master ..................................................
//! SLO idle high | latch, busy: 0 ... | start: 1 | CDS | turns | position | error | warning | CRC | 0 until ready
//! ```
//! The encoder latches its position at the first rising edge of MA. It changes SLO after rising edges, and the master takes
//! each bit at the next one, so that a delay of the line of up to a clock has no effect. The bits of error and warning are low
//! when active. The CRC of 6 bits (polynomial x^6 + x + 1, start 0, sent inverted) covers turns, position, error and warning.
//!
//! A board sends 56 clocks in each period by hardware, at a fixed time before the sample of the currents, so that the age of
//! the position is constant. Turns and position have [`MAX_DATA_BITS`] at most, which leaves the encoder three clocks to be
//! busy.

use super::evaluation::Evaluation;

/// Words of a frame.
pub const WORDS: usize = 4;
/// Words at the start of a frame in which the turns and some bits of the position are.
pub const TURN_WORDS: usize = 3;
/// Bits of a word.
pub const WORD_BITS: u32 = 14;
/// Bits of turns and position together.
pub const MAX_DATA_BITS: u32 = 40;

/// Bits of a frame.
const FRAME_BITS: u32 = WORDS as u32 * WORD_BITS;
/// Bits of error and warning, and of the CRC.
const FLAG_BITS: u32 = 2;
const CRC_BITS: u32 = 6;
/// Bits of the CRC that are evaluated in a step.
const STEP_BITS: u32 = 5;

/// An encoder with a BiSS C interface. Masks refer to the bits behind CDS, from the highest one on.
#[derive(Clone, Copy, Debug)]
pub struct BissEncoder {
    turn_bits: u32,
    /// Bits of an angle that are those of the position.
    angle_mask: u32,
    /// Bits from the turns to the CRC, their mask, and those of error and warning.
    frame_bits: u32,
    frame_mask: u64,
    error_mask: u64,
    warning_mask: u64,
    /// Steps of the CRC over the frame, and its result for a correct one.
    steps: u32,
    residue: u32,
}

impl BissEncoder {
    /// Creates an encoder with these bits of the position, 10 to 32, and of the number of turns; [`MAX_DATA_BITS`] together.
    pub const fn new(bits: u32, turn_bits: u32) -> Self {
        let data_bits = bits + turn_bits;
        let frame_bits = data_bits + FLAG_BITS + CRC_BITS;
        let steps = frame_bits.div_ceil(STEP_BITS);
        // The CRC is sent inverted: its ones are what a correct frame leaves.
        let inversion = ((1u64 << CRC_BITS) - 1) << (64 - frame_bits);
        Self {
            turn_bits,
            angle_mask: u32::MAX << (32 - bits),
            frame_bits,
            frame_mask: u64::MAX << (64 - frame_bits),
            error_mask: 1 << (63 - data_bits),
            warning_mask: 1 << (62 - data_bits),
            steps,
            residue: crc(inversion, steps),
        }
    }

    /// Evaluates the words of a period; `None` if they were not exchanged in time.
    // Not inlined: interrupt and background share one copy.
    #[inline(never)]
    pub fn evaluate(&self, words: Option<[u16; WORDS]>) -> Evaluation {
        let Some(frame) = words.and_then(|words| self.frame(words)) else {
            return Evaluation::Missing;
        };
        // Both are low when active.
        if frame & self.error_mask == 0 {
            return Evaluation::Missing;
        }
        let angle = ((frame << self.turn_bits) >> 32) as u32 & self.angle_mask;
        if frame & self.warning_mask == 0 {
            Evaluation::Doubtful(angle)
        } else {
            Evaluation::Angle(angle)
        }
    }

    /// Returns the bits from the turns to the CRC; `None` if there is no frame or its CRC is wrong.
    #[inline(always)]
    fn frame(&self, [first, second, third, fourth]: [u16; WORDS]) -> Option<u64> {
        let pair = |one: u16, two: u16| u32::from(one) << WORD_BITS | u32::from(two);
        let (begin, end) = (pair(first, second), pair(third, fourth));
        let line = u64::from(begin) << 36 | u64::from(end) << 8;
        // Start and CDS follow the clocks at which the encoder is idle and busy. These are within the first half.
        let begin = begin << 4;
        let idle = begin.leading_ones();
        let busy = (begin << idle).leading_zeros();
        let data_at = idle + busy + 2;
        if idle == 0 || data_at + self.frame_bits > FRAME_BITS {
            return None;
        }
        let frame = line << data_at & self.frame_mask;
        (crc(frame, self.steps) == self.residue).then_some(frame)
    }
}

/// Returns the number of turns, modulo 2^16, from the first words of a frame, for a position near this angle. `bits` are those
/// of the position and of the turns. `None` if there is no frame, or if it has another position.
///
/// It does not check the CRC: the interrupt has cleared the last word.
pub fn turns(
    [first, second, third]: [u16; TURN_WORDS],
    [bits, turn_bits]: [u32; 2],
    angle: u32,
) -> Option<u16> {
    let join = |high: u64, word: u16| high << WORD_BITS | u64::from(word);
    let read_bits = TURN_WORDS as u32 * WORD_BITS;
    let line = join(join(first.into(), second), third) << (64 - read_bits);
    let idle = line.leading_ones();
    let busy = (line << idle).leading_zeros();
    let data_at = idle + busy + 2;
    let position_bits = read_bits.checked_sub(data_at + turn_bits)?.min(bits);
    if idle == 0 || turn_bits == 0 || position_bits < LEAST_POSITION_BITS {
        return None;
    }
    let data = line << data_at;
    let position = (data << turn_bits >> 32) as u32 & u32::MAX << (32 - position_bits);
    let turned = angle.wrapping_sub(position) as i32;
    if turned.unsigned_abs() > 2 << (32 - LEAST_POSITION_BITS) {
        return None;
    }
    // The angle may lie beyond the end of the turn of the frame.
    let both =
        (data >> (64 - turn_bits) << 32 | u64::from(position)).wrapping_add_signed(turned.into());
    Some((both >> 32) as u16)
}

/// Bits of the position with which it can be compared: 64 parts of a turn.
const LEAST_POSITION_BITS: u32 = 6;

/// Returns the CRC of the highest bits, in steps of five: for these, the remainder of x^6 is a multiple of x + 1.
#[inline(always)]
const fn crc(mut bits: u64, steps: u32) -> u32 {
    let (mut crc, mut left) = (0, steps);
    while left > 0 {
        left -= 1;
        let step = (bits >> (64 - STEP_BITS)) as u32 ^ crc >> 1;
        crc = (crc & 1) << 5 ^ step ^ step << 1;
        bits <<= STEP_BITS;
    }
    crc
}

#[cfg(test)]
#[path = "biss_tests.rs"]
mod tests;
