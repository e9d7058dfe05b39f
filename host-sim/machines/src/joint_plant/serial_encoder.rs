//! An absolute encoder that sends its position as the BiSS C protocol defines (iC-Haus, BiSS C protocol description).
//!
//! It latches at the first rising edge of the master's clock MA, acknowledges at the second, is busy for some clocks, and then
//! sends a start bit, a bit for its registers, turns and position, error and warning (low when active), and a CRC.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// A fault of the encoder or its line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum SerialFault {
    /// No fault.
    #[default]
    None,
    /// The line is open: it is high.
    Open,
    /// The line is low.
    Low,
    /// The position is that at the begin of the fault, with a correct CRC.
    Frozen,
    /// The disc is off its shaft: the position stands, and its noise goes on.
    Detached,
    /// The position falls while the motor turns in its phase sequence.
    Reversed,
    /// Share of the frames with a wrong bit of the position.
    Disturbed(f64),
    /// The encoder reports an error.
    Error,
    /// The encoder warns.
    Warning,
    /// The position is off by this share of a turn.
    Jump(f64),
}

/// An absolute encoder.
#[derive(Clone, Debug)]
pub struct SerialEncoder {
    /// Bits of a turn, and of the number of turns.
    pub bits: u32,
    /// See [`SerialEncoder::bits`].
    pub turn_bits: u32,
    /// Standard deviation of the position, counts.
    pub noise_counts: f64,
    /// Clocks for which the encoder is busy.
    pub busy_clocks: u32,
    fault: SerialFault,
    frozen: Option<u64>,
    stands_at: Option<f64>,
    random: Pcg64,
}

impl SerialEncoder {
    /// An encoder of 18 bits and 12 bits of turns, with a noise of 0.7 counts, that is busy for two clocks.
    pub fn new(seed: u64) -> Self {
        Self {
            bits: 18,
            turn_bits: 12,
            noise_counts: 0.7,
            busy_clocks: 2,
            fault: SerialFault::None,
            frozen: None,
            stands_at: None,
            random: Pcg64::seed_from_u64(seed ^ 0xb155),
        }
    }

    /// Sets the fault from now on.
    pub fn set_fault(&mut self, fault: SerialFault) {
        (self.fault, self.frozen, self.stands_at) = (fault, None, None);
    }

    /// Latches the position at this angle, turns. Returns the levels of the line at the rising edges of the master's clock,
    /// the first one in the highest bit.
    pub fn frame(&mut self, turns: f64) -> u64 {
        match self.fault {
            SerialFault::Open => return u64::MAX,
            SerialFault::Low => return 0,
            _ => {}
        }
        let turns = match self.fault {
            SerialFault::Detached => *self.stands_at.get_or_insert(turns),
            SerialFault::Reversed => -turns,
            SerialFault::Jump(share) => turns + share,
            _ => turns,
        };
        let noise: f64 = StandardNormal.sample(&mut self.random);
        let counts = turns * (1u64 << self.bits) as f64 + self.noise_counts * noise;
        let width = self.bits + self.turn_bits;
        let position = (counts.floor() as i64 as u64) & ((1 << width) - 1);
        let position = match self.fault {
            SerialFault::Frozen => *self.frozen.get_or_insert(position),
            _ => position,
        };
        let has_no_error = u64::from(self.fault != SerialFault::Error);
        let has_no_warning = u64::from(self.fault != SerialFault::Warning);
        let data = position << 2 | has_no_error << 1 | has_no_warning;
        let mut line = Levels::default();
        line.push(0b11, 2);
        line.push(0, self.busy_clocks);
        line.push(0b10, 2);
        line.push(data, width + 2);
        line.push(u64::from(!remainder(data, width + 2) & 0x3F), 6);
        let flip = match self.fault {
            SerialFault::Disturbed(share) if self.random.random_bool(share) => {
                1u64 << (63 - 4 - self.busy_clocks - self.random.random_range(0..width))
            }
            _ => 0,
        };
        line.bits ^ flip
    }
}

/// Remainder of the data, six zeros appended, by x^6 + x + 1: a long division.
fn remainder(data: u64, bits: u32) -> u8 {
    let mut rest = u128::from(data) << 6;
    for place in (6..bits + 6).rev() {
        if rest >> place & 1 == 1 {
            rest ^= 0b100_0011 << (place - 6);
        }
    }
    rest as u8
}

/// Levels of a line, from the highest bit on.
#[derive(Default)]
struct Levels {
    bits: u64,
    count: u32,
}

impl Levels {
    fn push(&mut self, value: u64, bits: u32) {
        for bit in (0..bits).rev() {
            self.bits |= (value >> bit & 1) << (63 - self.count);
            self.count += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_has_its_parts_in_order_and_no_remainder() {
        let mut encoder = SerialEncoder { noise_counts: 0.0, ..SerialEncoder::new(1) };
        let frame = encoder.frame(3.25);
        assert_eq!(frame >> 58, 0b11_00_10);
        assert_eq!(frame << 6 >> 34, 3 << 18 | 1 << 16);
        assert_eq!(frame << 36 >> 62, 0b11);
        assert_eq!(remainder(0b100_0011 << 3, 10), 0);
        let sent = !(frame << 38 >> 58) & 0x3F;
        assert_eq!(u64::from(remainder(frame << 6 >> 32, 32)), sent);
        encoder.set_fault(SerialFault::Open);
        assert_eq!(encoder.frame(0.0), u64::MAX);
    }
}
