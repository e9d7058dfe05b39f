//! I2C1 as master, with the pressure sensor of the board and the sensor in the housing (RM0440, 41).
//!
//! A sensor is absent unless the surroundings have it; its address is then not acknowledged. A byte takes nine clocks at
//! 400 kHz. The bus waits while the software has not supplied or read a byte, as by clock stretching.

use super::bme280::{self, Bme280, HousingAir};
use super::ms5837::{self, Ms5837, Water};

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const ISR: u32 = 0x18;
const ICR: u32 = 0x1C;
const RXDR: u32 = 0x24;
const TXDR: u32 = 0x28;

const READS: u32 = 1 << 10;
const START: u32 = 1 << 13;
const STOP: u32 = 1 << 14;
const AUTOMATIC_END: u32 = 1 << 25;

const EMPTY: u32 = 1;
const SEND_NEXT: u32 = 1 << 1;
const RECEIVED: u32 = 1 << 2;
const NOT_ACKNOWLEDGED: u32 = 1 << 4;
const STOPPED: u32 = 1 << 5;
const COMPLETE: u32 = 1 << 6;
const BUSY: u32 = 1 << 15;

/// Nine clocks at 400 kHz.
const BYTE_CYCLES: u64 = 9 * 425;

/// The devices of the bus.
#[derive(Clone, Copy, Debug, Default)]
pub struct Devices {
    /// What the pressure sensor is in; `None` if there is none.
    pub water: Option<Water>,
    /// What the sensor in the housing is in; `None` if there is none.
    pub air: Option<HousingAir>,
    /// Both lines have the controller's signals.
    pub are_connected: bool,
}

/// What is on the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Idle,
    /// The address, until this time.
    Address(u64),
    /// A byte to the device or from it, until this time.
    Byte(u64),
    /// The master waits for the software: for a byte, for its read, or for what follows the last one.
    Held,
}

/// The bus.
#[derive(Clone, Debug, Default)]
pub struct I2c {
    registers: [u32; 16],
    flags: u32,
    phase: Phase,
    /// Bytes that follow in this transfer.
    left: u32,
    pressure: Ms5837,
    housing: Bme280,
    devices: Devices,
}

impl I2c {
    fn control(&self) -> u32 {
        self.registers[CR2 as usize / 4]
    }

    fn address(&self) -> u8 {
        (self.control() >> 1) as u8 & 0x7F
    }

    /// Simulates the bus up to this time.
    fn process(&mut self, now: u64) {
        match self.phase {
            Phase::Address(end) if end <= now => self.end_address(end),
            Phase::Byte(end) if end <= now => self.end_byte(end),
            _ => return,
        }
        self.process(now);
    }

    fn end_address(&mut self, at: u64) {
        self.registers[CR2 as usize / 4] &= !START;
        let is_present = match self.address() {
            ms5837::ADDRESS => self.devices.water.is_some(),
            bme280::ADDRESS => self.devices.air.is_some(),
            _ => false,
        };
        if !(self.devices.are_connected && is_present) {
            // A transfer that is not acknowledged is ended by a stop.
            self.flags |= NOT_ACKNOWLEDGED;
            return self.stop();
        }
        self.left = self.control() >> 16 & 0xFF;
        if self.control() & READS != 0 {
            self.phase = Phase::Byte(at + BYTE_CYCLES);
        } else {
            self.housing.begin_write();
            self.phase = Phase::Held;
            self.continue_write();
        }
    }

    fn end_byte(&mut self, at: u64) {
        self.phase = Phase::Held;
        self.left = self.left.saturating_sub(1);
        if self.control() & READS != 0 {
            let byte = match self.address() {
                bme280::ADDRESS => self.housing.read(at),
                _ => self.pressure.read(at),
            };
            self.registers[RXDR as usize / 4] = byte.into();
            self.flags |= RECEIVED;
            if self.left == 0 {
                self.complete();
            }
        } else {
            self.continue_write();
        }
    }

    fn continue_write(&mut self) {
        if self.left > 0 {
            self.flags |= SEND_NEXT;
        } else {
            self.complete();
        }
    }

    fn complete(&mut self) {
        if self.control() & AUTOMATIC_END != 0 {
            self.stop();
        } else {
            self.flags |= COMPLETE;
        }
    }

    fn stop(&mut self) {
        self.flags = (self.flags | STOPPED) & !COMPLETE;
        self.registers[CR2 as usize / 4] &= !(START | STOP);
        self.phase = Phase::Idle;
    }

    /// Reads a register.
    pub fn read(&mut self, offset: u32, now: u64) -> u32 {
        self.process(now);
        match offset {
            ISR => self.flags | EMPTY | if self.phase == Phase::Idle { 0 } else { BUSY },
            RXDR => {
                self.flags &= !RECEIVED;
                if self.phase == Phase::Held && self.control() & READS != 0 && self.left > 0 {
                    self.phase = Phase::Byte(now + BYTE_CYCLES);
                }
                self.registers[RXDR as usize / 4]
            }
            _ => self.registers.get(offset as usize / 4).copied().unwrap_or(0),
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, word: u32, now: u64, devices: Devices) {
        self.process(now);
        self.devices = devices;
        match offset {
            ISR => {}
            ICR => self.flags &= !word,
            CR1 if word & 1 == 0 => {
                (self.flags, self.phase) = (0, Phase::Idle);
                self.registers[0] = word;
            }
            TXDR if self.flags & SEND_NEXT != 0 => {
                self.flags &= !SEND_NEXT;
                match self.address() {
                    bme280::ADDRESS => {
                        self.housing.write(word as u8, now, devices.air.unwrap_or_default());
                    }
                    _ => self.pressure.write(word as u8, now, devices.water.unwrap_or_default()),
                }
                self.phase = Phase::Byte(now + BYTE_CYCLES);
            }
            _ => {
                if let Some(register) = self.registers.get_mut(offset as usize / 4) {
                    *register = word;
                }
            }
        }
        if offset == CR2 && word & START != 0 {
            self.flags &= !COMPLETE;
            self.phase = Phase::Address(now + BYTE_CYCLES);
        } else if offset == CR2 && word & STOP != 0 {
            self.stop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const READ_PROM_1: u32 = 0xA2;

    #[test]
    fn transfer_with_sensor_reads_two_bytes_and_without_is_not_acknowledged() {
        for water in [Some(Water::default()), None] {
            let devices = Devices { water, air: None, are_connected: true };
            let mut bus = I2c::default();
            let address = u32::from(ms5837::ADDRESS) << 1;
            bus.write(CR2, address | 1 << 16 | START, 0, devices);
            assert_eq!(bus.read(ISR, 0) & BUSY, BUSY);
            let mut now = 2 * BYTE_CYCLES;
            if water.is_none() {
                assert_eq!(bus.read(ISR, now), EMPTY | NOT_ACKNOWLEDGED | STOPPED);
                continue;
            }
            assert_eq!(bus.read(ISR, now) & SEND_NEXT, SEND_NEXT);
            bus.write(TXDR, READ_PROM_1, now, devices);
            now += 2 * BYTE_CYCLES;
            assert_eq!(bus.read(ISR, now) & COMPLETE, COMPLETE);
            bus.write(CR2, address | READS | 2 << 16 | START | AUTOMATIC_END, now, devices);
            let mut bytes = Vec::new();
            for _ in 0..20 {
                now += BYTE_CYCLES / 2;
                if bus.read(ISR, now) & RECEIVED != 0 {
                    bytes.push(bus.read(RXDR, now));
                }
            }
            assert_eq!(bytes, [34982 >> 8, 34982 & 0xFF]);
            assert_eq!(bus.read(ISR, now), EMPTY | STOPPED);
        }
    }
}
