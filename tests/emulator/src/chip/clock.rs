//! Clocks and reset flags: every oscillator is ready at once (RM0440, 7).

const CR: u32 = 0x00;
const CFGR: u32 = 0x08;
const AHB2ENR: u32 = 0x4C;
const CSR: u32 = 0x94;
const CRRCR: u32 = 0x98;

/// Requests and answers in CR: internal oscillator, crystal, PLL.
const READY: [(u32, u32); 3] = [(8, 10), (16, 17), (24, 25)];
const REMOVE_FLAGS: u32 = 1 << 23;

/// Reset flags of CSR.
pub mod reset {
    /// Pin.
    pub const PIN: u32 = 1 << 26;
    /// Brown-out or power-on.
    pub const POWER: u32 = 1 << 27;
    /// Software.
    pub const SOFTWARE: u32 = 1 << 28;
    /// Independent watchdog.
    pub const WATCHDOG: u32 = 1 << 29;
}

/// The clocks.
#[derive(Clone, Debug)]
pub struct Clock {
    registers: [u32; 64],
}

impl Default for Clock {
    fn default() -> Self {
        let mut registers = [0; 64];
        registers[CR as usize / 4] = 1 << 8;
        registers[CFGR as usize / 4] = 1;
        registers[CSR as usize / 4] = reset::PIN | reset::POWER;
        Self { registers }
    }
}

impl Clock {
    /// Sets the reset flags.
    pub fn set_reset_flags(&mut self, flags: u32) {
        self.registers[CSR as usize / 4] = flags;
    }

    /// Returns true if the random number generator has its clocks: on the bus, and the oscillator of 48 MHz.
    pub fn has_random_clock(&self) -> bool {
        let is_on = |offset: u32, bit: u32| self.registers[offset as usize / 4] >> bit & 1 == 1;
        is_on(CRRCR, 0) && is_on(AHB2ENR, 26)
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> u32 {
        let word = self.registers.get(offset as usize / 4).copied().unwrap_or(0);
        match offset {
            CR => READY.iter().fold(word, |word, (request, answer)| {
                word & !(1 << answer) | (word >> request & 1) << answer
            }),
            CFGR => word & !0xC | (word & 3) << 2,
            CSR | CRRCR => word & !2 | (word & 1) << 1,
            _ => word,
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, word: u32) {
        let kept = if offset == CSR && word & REMOVE_FLAGS != 0 { word & 0xFF } else { word };
        if let Some(register) = self.registers.get_mut(offset as usize / 4) {
            *register = kept;
        }
    }
}
