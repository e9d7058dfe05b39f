//! The line of an encoder with BiSS C, as the master's clock moves it (BiSS C protocol description).
//!
//! MA is high at rest. A cycle begins with the first clock after a pause of the timeout, and the encoder latches at its first
//! rising edge. It goes on with the bits of a frame over all words that follow within the timeout.

use super::CORE_HZ;

/// Pause after which the encoder is ready for a new cycle: 20 us.
const TIMEOUT_CYCLES: u64 = CORE_HZ / 50_000;

/// State of the encoder's line.
#[derive(Clone, Copy, Debug, Default)]
pub struct BissLine {
    frame: u64,
    /// Bits that are sent, and the end of the last clock.
    sent: u32,
    last: Option<u64>,
}

/// How the master clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocking {
    /// The clock is high at rest.
    pub is_high_at_rest: bool,
    /// The line is read at rising edges.
    pub reads_at_rise: bool,
    /// Cycles of a clock.
    pub cycles: u64,
}

impl BissLine {
    /// Returns the bits that a word of the master reads which begins now. `latch` returns the levels of a frame that is latched
    /// at this time, the first one in the highest bit.
    pub fn word(
        &mut self,
        at: u64,
        bits: u32,
        clocking: Clocking,
        latch: &mut dyn FnMut(u64) -> u64,
    ) -> u16 {
        let high = ((1u32 << bits) - 1) as u16;
        if !clocking.is_high_at_rest {
            // The encoder waits for a high clock.
            return high;
        }
        let is_new = self.last.is_none_or(|last| at > last + TIMEOUT_CYCLES);
        if is_new {
            let frame = latch(at + clocking.cycles / 2);
            // At a falling edge the line is that before the first rising one.
            self.frame = if clocking.reads_at_rise { frame } else { frame >> 1 | 1 << 63 };
            self.sent = 0;
        }
        self.last = Some(at + u64::from(bits) * clocking.cycles);
        let word = self.frame.checked_shl(self.sent).map_or(0, |rest| rest >> (64 - bits)) as u16;
        self.sent += bits;
        word
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_without_a_pause_are_one_frame() {
        let clocking = Clocking { is_high_at_rest: true, reads_at_rise: true, cycles: 32 };
        let mut line = BissLine::default();
        let mut latched = Vec::new();
        let mut word = |at| {
            line.word(at, 14, clocking, &mut |time| {
                latched.push(time);
                0xC123_4567_89AB_CDEF
            })
        };
        assert_eq!((word(1000), word(1450)), (0x3048, 0x3456));
        assert_eq!(word(9500), 0x3048);
        assert_eq!(latched, [1016, 9516]);
        let other = Clocking { is_high_at_rest: false, ..clocking };
        assert_eq!(BissLine::default().word(0, 14, other, &mut |_| 0), 0x3FFF);
    }
}
