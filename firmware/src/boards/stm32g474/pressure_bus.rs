//! The bus of the pressure sensor: I2C1 in steps, with manual control of its lines for a recovery.
//!
//! The controller keeps its view of the bus until it is disabled: an unfinished start, an arbitration lost
//! to a glitch, a false bus error (ES0430). Clearing `PE` for three of its clocks resets that state and
//! keeps the registers (RM0440, software reset of I2C). Meanwhile the lines are controlled as open-drain
//! pins.

use super::pins::{self, PRESSURE_CLOCK as CLOCK, PRESSURE_DATA as DATA};
use super::scales;
use embassy_stm32::i2c::{Config, I2c, Master};
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac;
use embassy_stm32::pac::gpio::{Gpio, vals::Moder};
use embassy_stm32::pac::i2c::vals::{Autoend, Dir};
use firmware::sensors::bus_recovery::BusWires;
use firmware::sensors::stepped_i2c::{Controller, Events, Segment, SteppedI2c};

/// The I2C bus with recovery.
pub type PressureBus = SteppedI2c<PressureController>;

const I2C: pac::i2c::I2c = pac::I2C1;

/// The controller.
pub struct PressureController {
    /// Has set the controller up; its functions wait and are not used.
    _i2c: I2c<'static, Blocking, Master>,
    lines: Lines,
}

impl PressureController {
    /// Sets up the bus.
    pub fn bus(pins: pins::Pressure) -> PressureBus {
        let mut config = Config::default();
        config.frequency = scales::PRESSURE_CLOCK;
        let i2c = I2c::new_blocking(pins.i2c, pins.clock, pins.data, config);
        SteppedI2c::new(Self { _i2c: i2c, lines: Lines })
    }
}

impl Controller for PressureController {
    type Wires = Lines;

    fn events(&mut self) -> Events {
        let flags = I2C.isr().read();
        Events {
            not_acknowledged: flags.nackf(),
            bus_error: flags.berr() || flags.arlo(),
            can_send: flags.txis(),
            has_byte: flags.rxne(),
            is_complete: flags.tc(),
            has_stopped: flags.stopf(),
        }
    }

    fn start(&mut self, address: u8, count: u8, segment: Segment) {
        I2C.icr().write(|w| {
            w.set_nackcf(true);
            w.set_stopcf(true);
            w.set_berrcf(true);
            w.set_arlocf(true);
        });
        I2C.cr2().write(|w| {
            w.set_sadd(u16::from(address) << 1);
            w.set_dir(if segment == Segment::Read { Dir::READ } else { Dir::WRITE });
            w.set_nbytes(count);
            let is_open = segment == Segment::WriteBeforeRead;
            w.set_autoend(if is_open { Autoend::SOFTWARE } else { Autoend::AUTOMATIC });
            w.set_start(true);
        });
    }

    fn send(&mut self, byte: u8) {
        I2C.txdr().write(|w| w.set_txdata(byte));
    }

    fn receive(&mut self) -> u8 {
        I2C.rxdr().read().rxdata()
    }

    fn reset(&mut self) {
        I2C.cr1().modify(|w| w.set_pe(false));
        // The read takes the clocks that the reset needs.
        let _ = I2C.cr1().read();
        I2C.cr1().modify(|w| w.set_pe(true));
    }

    fn control_lines(&mut self, manually: bool) {
        if manually {
            self.lines.clock(true);
            self.lines.data(true);
            I2C.cr1().modify(|w| w.set_pe(false));
        }
        let mode = if manually { Moder::OUTPUT } else { Moder::ALTERNATE };
        for (port, pin) in [CLOCK, DATA] {
            port.moder().modify(|w| w.set_moder(pin, mode));
        }
        if !manually {
            I2C.cr1().modify(|w| w.set_pe(true));
        }
    }

    fn wires(&mut self) -> &mut Lines {
        &mut self.lines
    }
}

/// The two lines as pins.
pub struct Lines;

fn set_line((port, pin): (Gpio, usize), released: bool) {
    port.bsrr().write(|w| if released { w.set_bs(pin, true) } else { w.set_br(pin, true) });
}

fn is_high((port, pin): (Gpio, usize)) -> bool {
    port.idr().read().idr(pin) == pac::gpio::vals::Idr::HIGH
}

impl BusWires for Lines {
    fn clock(&mut self, released: bool) {
        set_line(CLOCK, released);
    }

    fn data(&mut self, released: bool) {
        set_line(DATA, released);
    }

    fn clock_is_high(&mut self) -> bool {
        is_high(CLOCK)
    }

    fn data_is_high(&mut self) -> bool {
        is_high(DATA)
    }
}
