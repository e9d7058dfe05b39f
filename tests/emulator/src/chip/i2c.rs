//! I2C1 without a device: every address is not acknowledged (RM0440, 41).

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const ISR: u32 = 0x18;
const ICR: u32 = 0x1C;

const START: u32 = 1 << 13;
const AUTOMATIC_END: u32 = 1 << 25;
const STOP: u32 = 1 << 14;
const EMPTY: u32 = 1;
const NOT_ACKNOWLEDGED: u32 = 1 << 4;
const STOPPED: u32 = 1 << 5;
/// Nine clocks at 400 kHz, and the start.
const ADDRESS_CYCLES: u64 = 25 * 170;

/// The bus.
#[derive(Clone, Debug, Default)]
pub struct I2c {
    registers: [u32; 16],
    flags: u32,
    /// End of the address that is on the bus.
    address_ends: Option<u64>,
}

impl I2c {
    fn process(&mut self, now: u64) {
        if self.address_ends.is_some_and(|end| end <= now) {
            self.address_ends = None;
            // A transfer that is not acknowledged is ended by a stop.
            self.flags |= NOT_ACKNOWLEDGED | STOPPED;
            self.registers[CR2 as usize / 4] &= !(START | STOP);
        }
    }

    /// Reads a register.
    pub fn read(&mut self, offset: u32, now: u64) -> u32 {
        self.process(now);
        match offset {
            ISR => self.flags | EMPTY | u32::from(self.address_ends.is_some()) << 15,
            _ => self.registers.get(offset as usize / 4).copied().unwrap_or(0),
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, word: u32, now: u64) {
        self.process(now);
        match offset {
            ICR => self.flags &= !word,
            CR1 if word & 1 == 0 => {
                (self.flags, self.address_ends) = (0, None);
                self.registers[0] = word;
            }
            _ => {
                if let Some(register) = self.registers.get_mut(offset as usize / 4) {
                    *register = word;
                }
            }
        }
        if offset == CR2 && word & START != 0 {
            self.address_ends = Some(now + ADDRESS_CYCLES);
        } else if offset == CR2 && word & (STOP | AUTOMATIC_END) == STOP {
            self.flags |= STOPPED;
        }
    }
}
