//! Water pressure and temperature from an MS5837-30BA on I2C.
//!
//! The sensor converts pressure (D1) and its own temperature (D2) one at a time, each in some milliseconds.
//! Six calibration words are in a PROM whose first word holds a CRC-4. Temperature is converted first,
//! because the pressure depends on it. Far from 20 deg C a quadratic correction applies to both (data
//! sheet, "second order"). All arithmetic uses 64-bit integers, as in the data sheet.
//!
//! [`Ms5837::poll`] does at most one transfer of four bytes, and with a bus such as [`super::stepped_i2c`] never waits.
//! Call it once a millisecond with the time. After a failed transfer or an invalid PROM the driver recovers the bus and starts again
//! with a reset after a pause.

use embedded_hal::i2c::I2c;

/// An I2C bus that can be recovered.
pub trait SensorBus: I2c {
    /// Releases the lines ([`super::bus_recovery`]) and restarts the controller. The driver calls it before
    /// the first transfer after a failed one, at most once per [`RETRY_DELAY_US`].
    fn recover(&mut self);

    /// Returns true if this error states that a transfer has not ended: the driver calls again with the same arguments.
    fn is_pending(_error: &Self::Error) -> bool {
        false
    }
}

/// I2C address; it is fixed.
pub const ADDRESS: u8 = 0x76;

const RESET: u8 = 0x1E;
const PROM: u8 = 0xA0;
const READ: u8 = 0x00;
/// Conversion commands with an oversampling of 4096: resolution 20 Pa.
const CONVERT_PRESSURE: u8 = 0x48;
const CONVERT_TEMPERATURE: u8 = 0x58;

/// Wait after a reset until the PROM is loaded, us.
const RESET_US: u64 = 20_000;
/// Wait for a conversion, us; it takes at most 9.04 ms.
const CONVERSION_US: u64 = 10_000;
/// Pause after a failure, us.
pub const RETRY_DELAY_US: u64 = 200_000;

/// One measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Absolute pressure, Pa.
    pub pressure_pa: f32,
    /// Temperature of the water at the sensor, deg C.
    pub temperature_c: f32,
}

/// Reason why a poll failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PressureError<E> {
    /// The I2C transfer failed.
    I2c(E),
    /// The CRC of the calibration is wrong.
    Calibration,
    /// The sensor returned 0: the conversion was disturbed.
    NoConversion,
}

/// Calibration words C1 to C6.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Calibration([u16; 6]);

impl Calibration {
    /// Parses words 0 to 6 of the PROM; `None` if the CRC in word 0 is wrong.
    pub fn parse(prom: &[u16; 7]) -> Option<Self> {
        let [first, c1, c2, c3, c4, c5, c6] = *prom;
        let words = [first & 0x0FFF, c1, c2, c3, c4, c5, c6, 0];
        // All zeros have a valid CRC, and a bus held low reads as zeros.
        let blank = prom.iter().all(|word| *word == 0);
        (crc4(&words) == first >> 12 && !blank).then_some(Self([c1, c2, c3, c4, c5, c6]))
    }

    /// Computes pressure and temperature from both conversions.
    pub fn measurement(&self, d1: u32, d2: u32) -> Measurement {
        let [c1, c2, c3, c4, c5, c6] = self.0.map(i64::from);
        let (d1, d2) = (i64::from(d1), i64::from(d2));
        // In hundredths of a degree. Shifts round down, as in the data sheet's code.
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
            // The unit is 0.1 mbar, which is 10 Pa.
            pressure_pa: pressure as f32 * 10.0,
            temperature_c: (temperature - less_t) as f32 * 0.01,
        }
    }
}

/// CRC-4 of the data sheet: polynomial 3, over eight words, high byte first.
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

/// One sensor on its bus.
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
    /// Creates the driver; the sensor is reset with the first poll.
    pub fn new(bus: B) -> Self {
        Self { bus, step: Step::Reset, due_us: 0, prom: [0; 7], calibration: None, failed: false }
    }

    /// Returns the bus, for another sensor on it.
    pub const fn bus(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Does the next transfer if one is due. Returns a measurement when one is complete.
    ///
    /// # Errors
    /// Returns what failed. Keep calling: the driver starts again after a pause.
    pub fn poll(&mut self, now_us: u64) -> Result<Option<Measurement>, PressureError<B::Error>> {
        if now_us < self.due_us {
            return Ok(None);
        }
        if core::mem::take(&mut self.failed) {
            self.bus.recover();
        }
        let result = self.advance(now_us);
        if matches!(&result, Err(PressureError::I2c(error)) if B::is_pending(error)) {
            return Ok(None);
        }
        if result.is_err() {
            self.failed = true;
            self.step = Step::Reset;
            self.calibration = None;
            self.due_us = now_us + RETRY_DELAY_US;
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

    #[inline(never)]
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
