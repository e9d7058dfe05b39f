//! The random number generator (RM0440, 26). Its numbers follow from a seed, so that a test can repeat them.

const CR: u32 = 0x00;
const SR: u32 = 0x04;
const DR: u32 = 0x08;
const ENABLE: u32 = 1 << 2;
const READY: u32 = 1;
const SEED_ERROR: u32 = 1 << 2 | 1 << 6;

/// The generator.
#[derive(Clone, Debug)]
pub struct Random {
    control: u32,
    /// State of a xorshift generator; 0 makes the generator report a seed error.
    state: u32,
}

impl Default for Random {
    fn default() -> Self {
        Self::with_seed(0x5EED_0001)
    }
}

impl Random {
    /// Returns a generator with this seed; with 0 it reports an error.
    pub const fn with_seed(seed: u32) -> Self {
        Self { control: 0, state: seed }
    }

    /// Reads a register. `has_clock`: the oscillator of 48 MHz is on.
    pub fn read(&mut self, offset: u32, has_clock: bool) -> u32 {
        let runs = self.control & ENABLE != 0 && has_clock;
        match offset {
            CR => self.control,
            SR if runs && self.state == 0 => SEED_ERROR,
            SR if runs => READY,
            DR if runs => {
                self.state ^= self.state << 13;
                self.state ^= self.state >> 17;
                self.state ^= self.state << 5;
                self.state
            }
            _ => 0,
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, word: u32) {
        if offset == CR {
            self.control = word;
        }
    }
}
