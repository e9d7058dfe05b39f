//! The bus of the pressure sensor: I2C1, with manual control of its lines for a recovery.
//!
//! The controller keeps its view of the bus until it is disabled: an unfinished start, an arbitration lost
//! to a glitch, a false bus error (ES0430). Clearing `PE` for three of its clocks resets that state and
//! keeps the registers (RM0440, software reset of I2C). Meanwhile the lines are controlled as open-drain
//! pins.

use super::pins::{self, PRESSURE_CLOCK as CLOCK, PRESSURE_DATA as DATA};
use super::scales;
use embassy_stm32::i2c::{Config, Error, I2c, Master};
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac;
use embassy_stm32::pac::gpio::{Gpio, vals::Moder};
use embassy_time::Duration;
use embedded_hal::i2c::{ErrorType, Operation};
use firmware::sensors::bus_recovery::{BusWires, recover};
use firmware::sensors::ms5837::SensorBus;

/// Timeout of a transfer.
const TRANSFER_TIMEOUT: Duration = Duration::from_micros(1000);

/// Half a clock period of manual control, 5 us: 100 kHz, which every sensor supports. Interrupts stay
/// enabled.
const HALF_CLOCK_CYCLES: u32 = scales::CORE_HZ / 200_000;

/// The I2C bus with recovery.
pub struct PressureBus {
    i2c: I2c<'static, Blocking, Master>,
}

impl PressureBus {
    /// Sets up the bus.
    pub fn new(pins: pins::Pressure) -> Self {
        let mut config = Config::default();
        config.frequency = scales::PRESSURE_CLOCK;
        config.timeout = TRANSFER_TIMEOUT;
        Self { i2c: I2c::new_blocking(pins.i2c, pins.clock, pins.data, config) }
    }
}

impl ErrorType for PressureBus {
    type Error = Error;
}

impl embedded_hal::i2c::I2c for PressureBus {
    fn transaction(&mut self, address: u8, steps: &mut [Operation<'_>]) -> Result<(), Error> {
        embedded_hal::i2c::I2c::transaction(&mut self.i2c, address, steps)
    }

    // Forwarded separately: embassy's `transaction` is another code path, which would also be in the image.
    fn write(&mut self, address: u8, bytes: &[u8]) -> Result<(), Error> {
        embedded_hal::i2c::I2c::write(&mut self.i2c, address, bytes)
    }

    fn write_read(&mut self, address: u8, out: &[u8], into: &mut [u8]) -> Result<(), Error> {
        embedded_hal::i2c::I2c::write_read(&mut self.i2c, address, out, into)
    }
}

impl SensorBus for PressureBus {
    fn recover(&mut self) {
        let mut lines = Lines;
        lines.clock(true);
        lines.data(true);
        pac::I2C1.cr1().modify(|w| w.set_pe(false));
        for (port, pin) in [CLOCK, DATA] {
            port.moder().modify(|w| w.set_moder(pin, Moder::OUTPUT));
        }
        // A bus that stays held shows as a sensor without answers.
        recover(&mut lines);
        for (port, pin) in [CLOCK, DATA] {
            port.moder().modify(|w| w.set_moder(pin, Moder::ALTERNATE));
        }
        pac::I2C1.cr1().modify(|w| w.set_pe(true));
    }
}

/// The two lines as pins.
struct Lines;

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

    fn wait(&mut self) {
        cortex_m::asm::delay(HALF_CLOCK_CYCLES);
    }
}
