//! Ports A to G: modes, alternate functions, output levels, and the inputs that the driver reads (RM0440, 9).
//!
//! A signal of a peripheral reaches its pin only through the pin's alternate function (data sheet DS12288, table 13). The
//! connections are those of the board ([`super::wiring`]).

use super::wiring::{Connection, Connections, Pin, STANDARD, Wiring};

const PORTS: usize = 7;
const MODER: u32 = 0x00;
const PUPDR: u32 = 0x0C;
const IDR: u32 = 0x10;
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;
const AFRL: u32 = 0x20;
const AFRH: u32 = 0x24;
const BRR: u32 = 0x28;

/// Values of MODER for an output and an alternate function, and of PUPDR for a resistor to ground.
const OUTPUT: u32 = 1;
const ALTERNATE: u32 = 2;
const PULLED_DOWN: u32 = 2;

/// The ports.
#[derive(Clone, Debug)]
pub struct Gpio {
    wiring: &'static Wiring,
    registers: [[u32; 12]; PORTS],
    has_gate_fault: bool,
    torque_allowed: [bool; 2],
    is_touched: bool,
    /// Levels of the Hall sensors, bits 0 to 2; `None` if nothing is connected.
    hall: Option<u8>,
    /// The timer's six signals are connected to the bridge.
    is_bridge_connected: bool,
}

impl Default for Gpio {
    fn default() -> Self {
        Self::wired(&STANDARD)
    }
}

impl Gpio {
    /// Returns the ports of a board after a reset.
    pub fn wired(wiring: &'static Wiring) -> Self {
        let mut registers = [[0; 12]; PORTS];
        // After a reset all pins are analog, apart from the debug port's.
        registers.iter_mut().for_each(|port| port[0] = u32::MAX);
        (registers[0][0], registers[1][0]) = (0xABFF_FFFF, 0xFFFF_FEBF);
        Self {
            wiring,
            registers,
            has_gate_fault: false,
            torque_allowed: [true; 2],
            is_touched: false,
            hall: None,
            is_bridge_connected: false,
        }
    }
}

impl Gpio {
    fn register(&self, port: usize, offset: u32) -> u32 {
        self.registers[port][offset as usize / 4]
    }

    fn mode(&self, Pin { port, number }: Pin) -> u32 {
        self.register(port, MODER) >> (2 * number) & 3
    }

    /// Returns true for the register that shows the levels of the Hall sensors.
    pub fn reads_hall(&self, address: u32) -> bool {
        let port = self.wiring.hall.map(|[first, ..]| first.port as u32);
        port.is_some_and(|port| address == 0x4800_0000 + 0x400 * port + IDR)
    }

    fn output(&self, pin: Pin) -> Option<bool> {
        let is_output = self.mode(pin) == OUTPUT;
        is_output.then(|| self.register(pin.port, ODR) >> pin.number & 1 == 1)
    }

    /// Returns true if all these signals are connected to their pins.
    pub fn connects(&self, signals: Connections) -> bool {
        signals.iter().all(|&Connection { pin, function }| {
            let word = self.register(pin.port, if pin.number < 8 { AFRL } else { AFRH });
            self.mode(pin) == ALTERNATE && word >> (4 * (pin.number % 8)) & 0xF == function
        })
    }

    /// Returns true if the timer's six signals are connected to the bridge.
    pub fn is_bridge_connected(&self) -> bool {
        self.is_bridge_connected
    }

    /// Returns true if the gate driver is awake. It is asleep while the pin is not driven.
    pub fn is_gate_driver_awake(&self) -> bool {
        self.wiring.enable.is_none_or(|pin| self.output(pin) == Some(true))
    }

    /// Returns true if the output of the holding brake is high. It is pulled low while the pin is not driven.
    pub fn is_brake_output_high(&self) -> bool {
        self.wiring.brake.is_some_and(|pin| self.output(pin) == Some(true))
    }

    /// Returns true if software selects the encoder.
    pub fn is_encoder_selected(&self) -> bool {
        self.wiring.select.is_some_and(|pin| self.output(pin) == Some(false))
    }

    /// Sets the fault input of the gate driver.
    pub fn set_gate_fault(&mut self, is_present: bool) {
        self.has_gate_fault = is_present;
    }

    /// Sets the channels of safe torque off.
    pub fn set_torque_allowed(&mut self, channels: [bool; 2]) {
        self.torque_allowed = channels;
    }

    /// Sets the levels of the Hall sensors.
    pub fn set_hall(&mut self, levels: Option<u8>) {
        self.hall = levels;
    }

    /// Sets the input of the touch probe.
    pub fn set_touched(&mut self, is_touched: bool) {
        self.is_touched = is_touched;
    }

    /// Levels of the pins of a port that are no outputs. What the board does not drive follows the port's resistors; without
    /// one it is high.
    fn inputs(&self, port: usize) -> u32 {
        let pulls = self.register(port, PUPDR);
        let mut levels = (0..16)
            .filter(|pin| pulls >> (2 * pin) & 3 != PULLED_DOWN)
            .fold(0, |word, pin| word | 1 << pin);
        let fault = self.wiring.fault.map(|pin| (pin, !self.has_gate_fault));
        let torque = self
            .wiring
            .torque_allowed
            .map(|pins| [0, 1].map(|at| (pins[at], self.torque_allowed[at])));
        let hall = self.wiring.hall.map(|pins| {
            [0, 1, 2].map(|at| (pins[at], self.hall.is_none_or(|word| word >> at & 1 == 1)))
        });
        let touch = self.wiring.touch.map(|pin| (pin, self.is_touched));
        let driven = fault.into_iter().chain(touch).chain(torque.into_iter().flatten());
        for (pin, is_high) in driven.chain(hall.into_iter().flatten()) {
            if pin.port == port {
                levels = levels & !(1 << pin.number) | u32::from(is_high) << pin.number;
            }
        }
        levels
    }

    /// Reads a register by its address.
    pub fn read(&self, address: u32) -> u32 {
        let (port, offset) = (((address >> 10) & 0xF) as usize, address & 0x3FF);
        let Some(registers) = self.registers.get(port) else { return 0 };
        if offset != IDR {
            return registers.get(offset as usize / 4).copied().unwrap_or(0);
        }
        let outputs = (0..16).fold(0, |word, number| {
            word | u32::from(self.mode(Pin { port, number }) == OUTPUT) << number
        });
        (registers[ODR as usize / 4] & outputs | self.inputs(port) & !outputs) & 0xFFFF
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
        if matches!(offset, MODER | AFRL | AFRH) {
            self.is_bridge_connected = self.connects(self.wiring.bridge);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PORT_B: u32 = 0x4800_0400;

    #[test]
    fn signal_with_another_alternate_function_is_not_connected() {
        let mut gpio = Gpio::default();
        gpio.write(PORT_B + AFRH, 12 << 8);
        assert!(!gpio.connects(STANDARD.break_input), "the pin is analog");
        gpio.write(PORT_B + MODER, 0xFFEF_FEBF);
        assert!(gpio.connects(STANDARD.break_input));
        gpio.write(PORT_B + AFRH, 11 << 8);
        assert!(!gpio.connects(STANDARD.break_input));
    }

    #[test]
    fn input_shows_what_drives_it_and_otherwise_its_resistor() {
        let mut gpio = Gpio::default();
        gpio.set_gate_fault(true);
        assert_eq!(gpio.read(PORT_B + IDR), 0xFBFF);
        gpio.write(PORT_B + PUPDR, PULLED_DOWN);
        assert_eq!(gpio.read(PORT_B + IDR), 0xFBFE);
        gpio.set_torque_allowed([true, false]);
        assert_eq!(gpio.read(PORT_B + 0x400 + IDR), 0xE7FF);
    }
}
