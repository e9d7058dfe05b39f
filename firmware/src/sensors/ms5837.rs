//! Water pressure and temperature from an MS5837-30BA on I2C.
//!
//! The sensor converts pressure (D1) and its own temperature (D2), one at a time and some milliseconds each,
//! and has six calibration words in a PROM whose first word carries a CRC-4. Temperature comes first,
//! for the pressure depends on it; far from 20 deg C a square is taken off both (data sheet, "second order").
//! All of it is integers of 64 bits, as the data sheet computes.
//!
//! [`Ms5837::poll`] does at most one transfer of four bytes and never waits: call it once a millisecond with the
//! time. A transfer that fails, or a PROM that reads wrong, begins from the reset again after a
//! pause, on a bus that is freed before.

use embedded_hal::i2c::I2c;

/// The bus it is on: I2C that can be made free again.
pub trait SensorBus: I2c {
    /// Frees the lines ([`super::bus_recovery`]) and restarts the controller. Called before the first transfer after one
    /// that failed, at most once in [`RETRY_US`].
    fn recover(&mut self);
}

/// Address on the bus; it has one.
pub const ADDRESS: u8 = 0x76;

const RESET: u8 = 0x1E;
const PROM: u8 = 0xA0;
const READ: u8 = 0x00;
/// Conversions of the oversampling 4096: resolution 20 Pa.
const CONVERT_PRESSURE: u8 = 0x48;
const CONVERT_TEMPERATURE: u8 = 0x58;

/// After a reset, before the PROM is loaded, us.
const RESET_US: u64 = 20_000;
/// A conversion takes at most 9.04 ms.
const CONVERSION_US: u64 = 10_000;
/// After a failure, us.
pub const RETRY_US: u64 = 200_000;

/// What it measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Absolute pressure, Pa.
    pub pressure_pa: f32,
    /// Temperature of the water at the sensor, deg C.
    pub temperature_c: f32,
}

/// Why a poll failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PressureError<E> {
    /// The bus.
    I2c(E),
    /// The calibration does not fit its CRC.
    Calibration,
    /// The sensor gave 0: the conversion was disturbed.
    NoConversion,
}

/// Calibration words C1 to C6.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Calibration([u16; 6]);

impl Calibration {
    /// Reads the PROM's words 0 to 6; `None` where the CRC in word 0 does not fit.
    pub fn parse(prom: &[u16; 7]) -> Option<Self> {
        let [first, c1, c2, c3, c4, c5, c6] = *prom;
        let words = [first & 0x0FFF, c1, c2, c3, c4, c5, c6, 0];
        // All zeros fits its CRC, and is what a bus held low reads.
        let blank = prom.iter().all(|word| *word == 0);
        (crc4(&words) == first >> 12 && !blank).then_some(Self([c1, c2, c3, c4, c5, c6]))
    }

    /// Pressure and temperature from both conversions.
    pub fn measurement(&self, d1: u32, d2: u32) -> Measurement {
        let [c1, c2, c3, c4, c5, c6] = self.0.map(i64::from);
        let (d1, d2) = (i64::from(d1), i64::from(d2));
        // Hundredths of a degree; shifts round down, as in the data sheet's own code.
        let dt = d2 - (c5 << 8);
        let temperature = 2000 + ((dt * c6) >> 23);
        let offset = (c2 << 16) + ((c4 * dt) >> 7);
        let slope = (c1 << 15) + ((c3 * dt) >> 8);
        let warm = temperature - 2000;
        let (less_t, less_offset, less_slope) = if warm < 0 {
            let cold = temperature + 1500;
            let very = if cold < 0 { cold * cold } else { 0 };
            let square = warm * warm;
            ((3 * dt * dt) >> 33, ((3 * square) >> 1) + 7 * very, ((5 * square) >> 3) + 4 * very)
        } else {
            ((2 * dt * dt) >> 37, (warm * warm) >> 4, 0)
        };
        let pressure = (((d1 * (slope - less_slope)) >> 21) - (offset - less_offset)) >> 13;
        Measurement {
            // Tenths of a millibar are tens of pascals.
            pressure_pa: pressure as f32 * 10.0,
            temperature_c: (temperature - less_t) as f32 * 0.01,
        }
    }
}

/// CRC-4 of the data sheet: polynomial 3, over eight words, the high byte first.
fn crc4(words: &[u16; 8]) -> u16 {
    let mut rest = 0u16;
    for byte in words.iter().flat_map(|word| word.to_be_bytes()) {
        rest ^= u16::from(byte);
        for _ in 0..8 {
            rest = if rest & 0x8000 != 0 { (rest << 1) ^ 0x3000 } else { rest << 1 };
        }
    }
    rest >> 12
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Reset,
    Prom(u8),
    ConvertTemperature,
    ReadTemperature,
    ConvertPressure { d2: u32 },
    ReadPressure { d2: u32 },
}

/// A sensor on its bus.
#[derive(Debug)]
pub struct Ms5837<B> {
    bus: B,
    step: Step,
    due_us: u64,
    prom: [u16; 7],
    calibration: Option<Calibration>,
    failed: bool,
}

impl<B: SensorBus> Ms5837<B> {
    /// A sensor nothing is known of yet.
    pub fn new(bus: B) -> Self {
        Self { bus, step: Step::Reset, due_us: 0, prom: [0; 7], calibration: None, failed: false }
    }

    /// Goes on by one transfer, where one is due; gives a measurement when one is complete.
    ///
    /// # Errors
    /// Says what failed; go on calling, it begins anew after a pause.
    pub fn poll(&mut self, now_us: u64) -> Result<Option<Measurement>, PressureError<B::Error>> {
        if now_us < self.due_us {
            return Ok(None);
        }
        if core::mem::take(&mut self.failed) {
            self.bus.recover();
        }
        let result = self.advance(now_us);
        if result.is_err() {
            self.failed = true;
            self.step = Step::Reset;
            self.calibration = None;
            self.due_us = now_us + RETRY_US;
        }
        result
    }

    fn advance(&mut self, now_us: u64) -> Result<Option<Measurement>, PressureError<B::Error>> {
        let (next, wait_us) = match self.step {
            Step::Reset => {
                self.send(RESET)?;
                (Step::Prom(0), RESET_US)
            }
            Step::Prom(place) => {
                let [high, low] = self.receive(PROM + 2 * place)?;
                if let Some(word) = self.prom.get_mut(usize::from(place)) {
                    *word = u16::from_be_bytes([high, low]);
                }
                if usize::from(place) + 1 < self.prom.len() {
                    (Step::Prom(place + 1), 0)
                } else {
                    let read = Calibration::parse(&self.prom);
                    self.calibration = Some(read.ok_or(PressureError::Calibration)?);
                    (Step::ConvertTemperature, 0)
                }
            }
            Step::ConvertTemperature => {
                self.send(CONVERT_TEMPERATURE)?;
                (Step::ReadTemperature, CONVERSION_US)
            }
            Step::ReadTemperature => (Step::ConvertPressure { d2: self.converted()? }, 0),
            Step::ConvertPressure { d2 } => {
                self.send(CONVERT_PRESSURE)?;
                (Step::ReadPressure { d2 }, CONVERSION_US)
            }
            Step::ReadPressure { d2 } => {
                let d1 = self.converted()?;
                self.step = Step::ConvertTemperature;
                self.due_us = now_us;
                return Ok(self.calibration.map(|calibration| calibration.measurement(d1, d2)));
            }
        };
        self.step = next;
        self.due_us = now_us + wait_us;
        Ok(None)
    }

    fn send(&mut self, command: u8) -> Result<(), PressureError<B::Error>> {
        self.bus.write(ADDRESS, &[command]).map_err(PressureError::I2c)
    }

    fn receive<const N: usize>(&mut self, command: u8) -> Result<[u8; N], PressureError<B::Error>> {
        let mut bytes = [0; N];
        self.bus.write_read(ADDRESS, &[command], &mut bytes).map_err(PressureError::I2c)?;
        Ok(bytes)
    }

    fn converted(&mut self) -> Result<u32, PressureError<B::Error>> {
        let [high, middle, low] = self.receive(READ)?;
        match u32::from_be_bytes([0, high, middle, low]) {
            0 => Err(PressureError::NoConversion),
            counts => Ok(counts),
        }
    }
}

#[cfg(test)]
#[path = "ms5837_tests.rs"]
mod tests;
