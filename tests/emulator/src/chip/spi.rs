//! SPI1 and SPI3: frames one after the other, as a master (RM0440, 39.5). Two words wait in its transmit FIFO.
//!
//! The encoder changes its bits at rising edges and takes those of the master at falling ones: CPOL = 0, CPHA = 1. In any other
//! mode an end of the wire looks at the bit before, so its word arrives one bit late. The first bit is then that of the line at
//! rest, which is pulled up.
//!
//! An encoder with BiSS C has words of other lengths, and only the clock and the line back.

use super::biss::Clocking;
use std::collections::VecDeque;

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SR: u32 = 0x08;
const DR: u32 = 0x0C;

const FULL: u32 = 1;
const EMPTY: u32 = 1 << 1;
const OVERRUN: u32 = 1 << 6;
const BUSY: u32 = 1 << 7;
const ENABLED: u32 = 1 << 6;
/// CPHA and CPOL in CR1, and the frames that the encoder needs: 16 bits, the highest one first, from a master.
const PHASE: u32 = 1;
const POLARITY: u32 = 1 << 1;
const MASTER: u32 = 1 << 2;
const LOWEST_FIRST: u32 = 1 << 7;
const SIZE_16: u32 = 0xF << 8;
const AT_REST: u16 = 0x8000;
const RECEIVE_DMA: u32 = 1;
const SEND_DMA: u32 = 1 << 1;
/// Words of the transmit FIFO.
const WAITING_WORDS: usize = 2;

/// What the bus exchanges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusFrame {
    /// 16 bits, as an AS504x receives them.
    Word(u16),
    /// Clocks of a word of another length, from this time on.
    Clocks {
        /// First edge of the clock, cycles.
        begin: u64,
        /// Number of clocks.
        bits: u32,
        /// Clock and edges.
        clocking: Clocking,
    },
}

/// The bus.
#[derive(Clone, Debug, Default)]
pub struct Spi {
    registers: [u32; 16],
    /// End of each frame on the line, and its answer.
    frames: VecDeque<(u64, u16)>,
    received: VecDeque<u16>,
    has_overrun: bool,
}

impl Spi {
    fn finish(&mut self, now: u64) {
        while let Some((_, answer)) = self.frames.pop_front_if(|(end, _)| *end <= now) {
            let is_full = self.received.len() == WAITING_WORDS;
            self.has_overrun |= is_full;
            if !is_full {
                self.received.push_back(answer);
            }
        }
    }

    /// Returns what a word of the bus, and the encoder's answer, arrive as: `None` if the frame is no frame of the encoder.
    fn shifts(&self) -> Option<[bool; 2]> {
        let (first, second) = (self.registers[CR1 as usize / 4], self.registers[CR2 as usize / 4]);
        let is_frame = first & (MASTER | LOWEST_FIRST) == MASTER && second & SIZE_16 == SIZE_16;
        is_frame.then_some(match first & (PHASE | POLARITY) {
            PHASE => [false, false],
            // The master, too, changes its bit at the falling edge at which the encoder looks.
            0b11 => [true, true],
            _ => [false, true],
        })
    }

    fn requests_dma(&self) -> bool {
        self.registers[CR2 as usize / 4] & RECEIVE_DMA != 0
    }

    /// Returns true if it requests a word to send by DMA.
    pub fn wants_word(&self) -> bool {
        let [first, second] = [CR1, CR2].map(|at| self.registers[at as usize / 4]);
        first & ENABLED != 0 && second & SEND_DMA != 0 && self.frames.len() <= WAITING_WORDS
    }

    /// Time of the next DMA request, cycles.
    pub fn next_event(&self) -> u64 {
        self.frames.front().filter(|_| self.requests_dma()).map_or(u64::MAX, |(end, _)| *end)
    }

    /// Ends the frame that is due. Returns true if it requests DMA, which then reads the answer.
    pub fn process(&mut self, now: u64) -> bool {
        self.finish(now);
        self.requests_dma() && !self.received.is_empty()
    }

    /// Reads a register.
    pub fn read(&mut self, offset: u32, now: u64) -> u32 {
        self.finish(now);
        match offset {
            SR => {
                let full = if self.received.is_empty() { 0 } else { FULL };
                let busy = if self.frames.is_empty() { EMPTY } else { BUSY };
                full | busy | if self.has_overrun { OVERRUN } else { 0 }
            }
            DR => {
                self.has_overrun = false;
                self.received.pop_front().map_or(0, u32::from)
            }
            _ => self.registers.get(offset as usize / 4).copied().unwrap_or(0),
        }
    }

    /// Writes a register. A write to DR sends a word, which `exchange` answers.
    pub fn write(
        &mut self,
        offset: u32,
        word: u32,
        now: u64,
        exchange: &mut dyn FnMut(BusFrame) -> u16,
    ) {
        self.finish(now);
        if offset == DR {
            let control = self.registers[CR1 as usize / 4];
            // A word beyond the FIFO is lost.
            if control & ENABLED != 0 && self.frames.len() <= WAITING_WORDS {
                let divider = 2u64 << (control >> 3 & 7);
                let bits = (self.registers[CR2 as usize / 4] >> 8 & 0xF) + 1;
                let begin = self.frames.back().map_or(now, |(end, _)| *end);
                let late = |word: u16, is_late: bool| {
                    if is_late { word >> 1 | AT_REST } else { word }
                };
                let answer = match self.shifts() {
                    Some([sent, received]) => {
                        let answer = exchange(BusFrame::Word(late(word as u16, sent)));
                        late(answer, received)
                    }
                    None if control & (MASTER | LOWEST_FIRST) == MASTER => {
                        let is_high_at_rest = control & POLARITY != 0;
                        let reads_at_rise = is_high_at_rest == (control & PHASE != 0);
                        let clocking = Clocking { is_high_at_rest, reads_at_rise, cycles: divider };
                        exchange(BusFrame::Clocks { begin, bits, clocking })
                    }
                    None => u16::MAX,
                };
                self.frames.push_back((begin + u64::from(bits) * divider, answer));
            }
        } else if let Some(register) = self.registers.get_mut(offset as usize / 4) {
            *register = word;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(mode: u32) -> u32 {
        let mut bus = Spi::default();
        bus.write(CR2, SIZE_16, 0, &mut |_| 0);
        bus.write(CR1, ENABLED | MASTER | mode, 0, &mut |_| 0);
        bus.write(DR, 0x4001, 0, &mut |frame| match frame {
            BusFrame::Word(word) => word + 0x1003,
            BusFrame::Clocks { .. } => 0,
        });
        bus.read(DR, 1000)
    }

    #[test]
    fn words_in_other_mode_arrive_one_bit_late() {
        assert_eq!(answer(PHASE), 0x5004);
        assert_eq!(answer(0), 0xA802);
        assert_eq!(answer(POLARITY), 0xA802);
        assert_eq!(answer(PHASE | POLARITY), (0xA000 + 0x1003) >> 1 | 0x8000);
        assert_eq!(answer(PHASE | LOWEST_FIRST), 0xFFFF);
    }
}
