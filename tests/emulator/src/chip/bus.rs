//! Reads and writes of registers, by their addresses (RM0440, 2.2).

use super::{
    AIRCR, Chip, DWT_CYCCNT, FLASH_ACR, SPI1_DR, VTOR, adc, comparators, flash, i2c, timer1,
};
use crate::cycles::{Cost, FlashAccess};
use crate::world::World;

impl<W: World> Chip<W> {
    /// Reads a register; returns its value and the cost of the access.
    pub fn read(&mut self, address: u32, size: usize) -> (u32, Cost) {
        let word = self.read_word(address & !3);
        let value = word >> (8 * (address & 3));
        (value & mask(size), bus_cost(address))
    }

    fn read_word(&mut self, address: u32) -> u32 {
        let now = self.now;
        let chip = self.wiring.chip;
        match address {
            _ if is_within(chip.clock, address) => self.timer5.read(address & 0x3FF, now),
            _ if is_within(chip.counter, address) => {
                self.follow_edges();
                self.timer20.read(address & 0x3FF)
            }
            0x4001_2C00..=0x4001_2FFF => self.timer1.read(address & 0x3FF, now),
            0x4000_0400..=0x4000_07FF => self.timer3.read(address & 0x3FF, now),
            0x4002_0000..=0x4002_03FF | 0x4002_0800..=0x4002_083F => self.dma.read(address),
            0x5000_0000..=0x5000_07FF => self.read_converter(address),
            0x4001_3000..=0x4001_33FF => self.spi.read(address & 0x3FF, now),
            0x4000_3C00..=0x4000_3FFF => self.joint_bus.read(address & 0x3FF, now),
            0x4000_5400..=0x4000_57FF => self.i2c.read(address & 0x3FF, now),
            0x4000_6400..=0x4000_67FF | 0x4000_A400..=0x4000_AFFF => self.can.read(address),
            0x4002_2000..=0x4002_23FF if address != FLASH_ACR => self.flash.read(address & 0x3FF),
            0x4800_0000..=0x4800_1BFF => {
                if self.gpio.reads_hall(address) {
                    self.gpio.set_hall(self.world.hall_levels(self.since_sample()));
                }
                self.gpio.read(address)
            }
            0x4002_1000..=0x4002_13FF => self.clock.read(address & 0x3FF),
            0x5006_0800..=0x5006_0BFF => {
                self.random.read(address & 0x3FF, self.clock.has_random_clock())
            }
            0xE000_E100..=0xE000_E4FF | 0xE000_ED18..=0xE000_ED23 => {
                self.nvic.read(address - 0xE000_E000)
            }
            0xE000_ED04 => self.nvic.current() as u32,
            DWT_CYCCNT => now as u32,
            0x4001_0200..=0x4001_021B => {
                let shunts = self.world.shunts();
                let status = comparators::status(
                    self.wiring.overcurrent.comparators,
                    &|at| self.plain(at),
                    address,
                    shunts,
                    self.unwired_comparator,
                );
                status.unwrap_or_else(|| self.plain(address))
            }
            _ => self.plain(address),
        }
    }

    /// Writes a word of the flash, which is plain memory of the machine.
    pub fn program_flash(&mut self, address: u32, word: u32) {
        self.flash.program(address, word, self.now);
        self.after_flash();
    }

    /// A double word of the flash is read, which is plain memory of the machine.
    pub fn check_flash(&mut self, address: u32) {
        self.flash.check_bits(address);
        self.update_lines();
    }

    /// The core waits while its own bank is busy.
    fn after_flash(&mut self) {
        self.now += self.flash.take_stall();
        self.schedule();
        self.update_lines();
    }

    fn read_converter(&self, address: u32) -> u32 {
        match adc::place(address) {
            Some((number, offset)) => self.adc[number].read(offset),
            None => self.plain(address),
        }
    }

    /// Writes a register; returns the cost of the access.
    pub fn write(&mut self, address: u32, size: usize, value: u32) -> Cost {
        let (aligned, shift) = (address & !3, 8 * (address & 3));
        // Narrow writes to plain registers change only their bytes.
        let word = if size == 4 {
            value
        } else {
            let kept = self.plain(aligned) & !(mask(size) << shift);
            kept | (value & mask(size)) << shift
        };
        self.write_word(aligned, address, size, word, value);
        self.schedule();
        self.update_lines();
        bus_cost(address)
    }

    fn write_word(&mut self, aligned: u32, address: u32, size: usize, word: u32, value: u32) {
        let now = self.now;
        let chip = self.wiring.chip;
        match aligned {
            _ if is_within(chip.clock, aligned) => self.timer5.write(aligned & 0x3FF, word, now),
            _ if is_within(chip.counter, aligned) => {
                self.follow_edges();
                self.timer20.write(aligned & 0x3FF, word);
            }
            0x4001_2C00..=0x4001_2FFF => self.write_timer(aligned & 0x3FF, word),
            0x5000_0000..=0x5000_07FF => self.write_converter(aligned, word),
            SPI1_DR => self.exchange(word as u16, now, now),
            0x4001_3000..=0x4001_33FF => {
                self.spi.write(aligned & 0x3FF, word, now, &mut |_| 0xFFFF);
            }
            0x4000_0400..=0x4000_07FF => self.timer3.write(aligned & 0x3FF, word),
            0x4000_3C00..=0x4000_3FFF => {
                self.joint_bus.write(aligned & 0x3FF, word, now, &mut |_| 0xFFFF);
                self.feed_joint_bus(now);
            }
            0x4002_0000..=0x4002_03FF | 0x4002_0800..=0x4002_083F => {
                self.dma.write(aligned, word);
                self.feed_joint_bus(now);
            }
            0x4000_5400..=0x4000_57FF => {
                let devices = i2c::Devices {
                    water: self.world.water(),
                    air: self.world.air(),
                    are_connected: self.gpio.connects(self.wiring.sensor_bus),
                };
                self.i2c.write(aligned & 0x3FF, word, now, devices);
            }
            0x4000_6400..=0x4000_67FF | 0x4000_A400..=0x4000_AFFF => {
                self.can.write(aligned, word, now)
            }
            0x4002_2000..=0x4002_23FF => self.write_flash_register(aligned, word),
            0x4800_0000..=0x4800_1BFF => self.write_port(aligned, word),
            0x4002_1000..=0x4002_13FF => self.clock.write(aligned & 0x3FF, word),
            0x5006_0800..=0x5006_0BFF => self.random.write(aligned & 0x3FF, word),
            0x4000_3000..=0x4000_33FF => self.watchdog.write(aligned & 0x3FF, word, now),
            0xE000_E100..=0xE000_E4FF | 0xE000_ED18..=0xE000_ED23 => {
                self.nvic.write(address - 0xE000_E000, size, value);
            }
            VTOR => {
                self.flash.running_bank = word.wrapping_sub(flash::BASE) / flash::BANK_BYTES;
                self.memory.insert(aligned, word);
            }
            AIRCR if word & 0xFFFF_0004 == 0x05FA_0004 => self.request_reset(),
            DWT_CYCCNT => {}
            _ => {
                self.memory.insert(aligned, word);
                if comparators::changes_levels(aligned) {
                    self.update_break_levels();
                }
            }
        }
    }

    fn write_flash_register(&mut self, address: u32, word: u32) {
        if address == FLASH_ACR {
            self.flash_access = FlashAccess::from_register(word);
            self.memory.insert(address, word);
        } else {
            self.flash.write(address & 0x3FF, word, self.now);
            self.after_flash();
        }
    }

    fn write_timer(&mut self, offset: u32, word: u32) {
        if timer1::changes_bridge(offset) {
            self.advance_world(self.now);
        }
        let had_break = self.timer1.has_break();
        let was_running = self.timer1.is_running();
        self.timer1.write(offset, word, self.now);
        if !was_running && self.timer1.is_running() && self.timer1.signals_its_start() {
            self.timer3.start_with_master(self.now);
        }
        if offset == comparators::AF1 {
            self.update_break_levels();
        }
        if had_break && !self.timer1.has_break() {
            self.world.clear_break();
            // The flag is set again while its input is active.
            if self.world.is_overcurrent() {
                self.timer1.set_break(false);
            }
            self.break_by_pin();
            self.break_by_shunts();
        }
    }

    fn write_converter(&mut self, aligned: u32, word: u32) {
        match adc::place(aligned) {
            Some((number, offset)) => {
                let (now, world) = (self.now, &mut self.world);
                self.adc[number].write(offset, word, now, &mut |converter, channel| {
                    world.analog(converter, channel)
                });
            }
            None => {
                self.memory.insert(aligned, word);
                if let Some((converters, divider)) = adc::clock_divider(aligned, word) {
                    self.adc[converters].iter_mut().for_each(|adc| adc.divider = divider);
                }
            }
        }
    }

    fn write_port(&mut self, address: u32, word: u32) {
        let was_awake = self.gpio.is_gate_driver_awake();
        self.advance_if_port_changes(address, word);
        self.gpio.write(address, word);
        self.can.set_connected(self.gpio.connects(self.wiring.can));
        if was_awake && !self.gpio.is_gate_driver_awake() {
            self.world.clear_break();
        }
    }

    fn advance_if_port_changes(&mut self, address: u32, word: u32) {
        let mut after = self.gpio.clone();
        after.write(address, word);
        if after.is_gate_driver_awake() != self.gpio.is_gate_driver_awake() {
            self.advance_world(self.now);
        }
    }
}

/// Returns true if an address is one of the registers of a peripheral.
const fn is_within(base: u32, address: u32) -> bool {
    address & !0x3FF == base
}

const fn mask(size: usize) -> u32 {
    match size {
        1 => 0xFF,
        2 => 0xFFFF,
        _ => u32::MAX,
    }
}

/// Returns the cost of an access beside that of its instruction.
const fn bus_cost(address: u32) -> Cost {
    let upper = match address {
        0x4002_0000..=0x5FFF_FFFF => 1,
        0x4000_0000..=0x4001_FFFF => 3,
        _ => 0,
    };
    Cost { lower: 0, upper }
}
