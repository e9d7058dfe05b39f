//! Ports A to G: output levels, and the inputs that the driver reads (RM0440, 9).

const PORTS: usize = 7;
const IDR: u32 = 0x10;
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;
const BRR: u32 = 0x28;

/// Gate driver's enable PC6, its fault PB10 (low when there is one), and the encoder's select PA4 (low).
const ENABLE: (usize, u32) = (2, 6);
const FAULT: (usize, u32) = (1, 10);
const SELECT: (usize, u32) = (0, 4);
/// Output of the holding brake PC7.
const BRAKE: (usize, u32) = (2, 7);

/// The ports.
#[derive(Clone, Debug)]
pub struct Gpio {
    registers: [[u32; 12]; PORTS],
    has_gate_fault: bool,
}

impl Default for Gpio {
    fn default() -> Self {
        let mut registers = [[0; 12]; PORTS];
        // After a reset all pins are analog, apart from the debug port's.
        registers.iter_mut().for_each(|port| port[0] = u32::MAX);
        (registers[0][0], registers[1][0]) = (0xABFF_FFFF, 0xFFFF_FEBF);
        Self { registers, has_gate_fault: false }
    }
}

impl Gpio {
    fn output(&self, (port, pin): (usize, u32)) -> Option<bool> {
        let is_output = self.registers[port][0] >> (2 * pin) & 3 == 1;
        is_output.then(|| self.registers[port][ODR as usize / 4] >> pin & 1 == 1)
    }

    /// Returns true if the gate driver is awake. It is asleep while the pin is not driven.
    pub fn is_gate_driver_awake(&self) -> bool {
        self.output(ENABLE) == Some(true)
    }

    /// Returns true if the output of the holding brake is high. It is pulled low while the pin is not driven.
    pub fn is_brake_output_high(&self) -> bool {
        self.output(BRAKE) == Some(true)
    }

    /// Returns true if the encoder is selected.
    pub fn is_encoder_selected(&self) -> bool {
        self.output(SELECT) == Some(false)
    }

    /// Sets the fault input of the gate driver.
    pub fn set_gate_fault(&mut self, is_present: bool) {
        self.has_gate_fault = is_present;
    }

    /// Reads a register by its address.
    pub fn read(&self, address: u32) -> u32 {
        let (port, offset) = (((address >> 10) & 0xF) as usize, address & 0x3FF);
        let Some(registers) = self.registers.get(port) else { return 0 };
        if offset != IDR {
            return registers.get(offset as usize / 4).copied().unwrap_or(0);
        }
        let outputs = (0..16)
            .fold(0, |word, pin| word | u32::from(registers[0] >> (2 * pin) & 3 == 1) << pin);
        // Inputs are pulled up.
        let low = if port == FAULT.0 && self.has_gate_fault { 1 << FAULT.1 } else { 0 };
        (registers[ODR as usize / 4] & outputs | !outputs & !low) & 0xFFFF
    }

    /// Writes a register by its address.
    pub fn write(&mut self, address: u32, word: u32) {
        let (port, offset) = (((address >> 10) & 0xF) as usize, address & 0x3FF);
        let Some(registers) = self.registers.get_mut(port) else { return };
        match offset {
            BSRR => {
                let output = &mut registers[ODR as usize / 4];
                *output = *output & !(word >> 16) | word & 0xFFFF;
            }
            BRR => registers[ODR as usize / 4] &= !(word & 0xFFFF),
            IDR => {}
            _ => {
                if let Some(register) = registers.get_mut(offset as usize / 4) {
                    *register = word;
                }
            }
        }
    }
}
