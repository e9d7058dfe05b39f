//! SPI1: one frame at a time, as a master (RM0440, 39).

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SR: u32 = 0x08;
const DR: u32 = 0x0C;

const FULL: u32 = 1;
const EMPTY: u32 = 1 << 1;
const OVERRUN: u32 = 1 << 6;
const BUSY: u32 = 1 << 7;
const ENABLED: u32 = 1 << 6;
const RECEIVE_DMA: u32 = 1;
/// Bits of the encoder's frames.
const FRAME_BITS: u64 = 16;

/// The bus.
#[derive(Clone, Debug, Default)]
pub struct Spi {
    registers: [u32; 16],
    /// End of the frame on the line, and its answer.
    frame: Option<(u64, u16)>,
    received: Option<u16>,
    has_overrun: bool,
}

impl Spi {
    fn finish(&mut self, now: u64) {
        if let Some((end, answer)) = self.frame
            && end <= now
        {
            self.frame = None;
            self.has_overrun |= self.received.is_some();
            self.received.get_or_insert(answer);
        }
    }

    fn requests_dma(&self) -> bool {
        self.registers[CR2 as usize / 4] & RECEIVE_DMA != 0
    }

    /// Time of the next DMA request, cycles.
    pub fn next_event(&self) -> u64 {
        self.frame.filter(|_| self.requests_dma()).map_or(u64::MAX, |(end, _)| end)
    }

    /// Ends the frame that is due. Returns true if it requests DMA, which then reads the answer.
    pub fn process(&mut self, now: u64) -> bool {
        self.finish(now);
        self.requests_dma() && self.received.is_some()
    }

    /// Reads a register.
    pub fn read(&mut self, offset: u32, now: u64) -> u32 {
        self.finish(now);
        match offset {
            SR => {
                let full = if self.received.is_some() { FULL } else { 0 };
                let busy = if self.frame.is_some() { BUSY } else { EMPTY };
                full | busy | if self.has_overrun { OVERRUN } else { 0 }
            }
            DR => {
                self.has_overrun = false;
                self.received.take().map_or(0, u32::from)
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
        exchange: &mut dyn FnMut(u16) -> u16,
    ) {
        self.finish(now);
        if offset == DR {
            let control = self.registers[CR1 as usize / 4];
            if control & ENABLED != 0 {
                let divider = 2u64 << (control >> 3 & 7);
                self.frame = Some((now + FRAME_BITS * divider, exchange(word as u16)));
            }
        } else if let Some(register) = self.registers.get_mut(offset as usize / 4) {
            *register = word;
        }
    }
}
