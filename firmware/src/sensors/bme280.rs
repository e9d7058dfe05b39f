//! Humidity, pressure and temperature of the air in the housing from a BME280 on I2C.
//!
//! Once a second the sensor measures all three on request (forced mode), which takes 9.3 ms, and sleeps otherwise,
//! so that it does not warm the air that it measures. A sensor that lost its power has forgotten that it measures the
//! humidity. So this is set before every measurement, and raw values that were not measured are discarded.
//!
//! The raw values are corrected by 18 calibration constants (data sheet BST-BME280-DS002, 4.2.3; pressure in 64 bits).
//! The constants have no check sum. Words of zeros or ones, as a bus without the sensor gives them, are refused.
//!
//! The published drivers for this sensor wait for it. [`Bme280::poll`] does at most one transfer and waits for nothing,
//! as [`super::ms5837`] does, with which it shares a bus. Call it once a millisecond with the time.

use super::ms5837::{RETRY_DELAY_US, SensorBus};

/// I2C address, with SDO tied high. The other one, 76h, is that of the MS5837.
pub const ADDRESS: u8 = 0x77;

/// Time between two measurements, us.
pub const PERIOD_US: u64 = 1_000_000;

/// Registers.
mod register {
    pub const CALIBRATION: u8 = 0x88;
    pub const IDENTITY: u8 = 0xD0;
    pub const RESET: u8 = 0xE0;
    pub const HUMIDITY_CALIBRATION: u8 = 0xE1;
    pub const HUMIDITY_CONTROL: u8 = 0xF2;
    pub const CONTROL: u8 = 0xF4;
    pub const DATA: u8 = 0xF7;
}

const IDENTITY: u8 = 0x60;
const RESET_WORD: u8 = 0xB6;
/// One sample of the humidity.
const HUMIDITY_ONCE: u8 = 0x01;
/// One sample of temperature and pressure, now.
const MEASURE: u8 = 0x25;
/// Wait after a reset, us; it takes 2 ms.
const RESET_US: u64 = 5_000;
/// Wait for a measurement, us; it takes at most 9.3 ms (data sheet, 9.1).
const MEASUREMENT_US: u64 = 12_000;
/// Time between two polls, us.
const POLL_US: u64 = 1_000;
/// Raw values that were not measured: pressure and temperature, and humidity (data sheet, 5.4.7 to 5.4.9).
const NOT_MEASURED: [u8; 3] = [0x80, 0, 0];
const HUMIDITY_NOT_MEASURED: [u8; 2] = [0x80, 0];

/// State of the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Absolute pressure, Pa.
    pub pressure_pa: f32,
    /// Temperature, deg C.
    pub temperature_c: f32,
    /// Relative humidity, percent.
    pub humidity_percent: f32,
}

impl Air {
    /// No valid measurement: every value is NaN.
    pub const INVALID: Self =
        Self { pressure_pa: f32::NAN, temperature_c: f32::NAN, humidity_percent: f32::NAN };
}

/// Reason why a poll failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AirError<E> {
    /// The I2C transfer failed.
    I2c(E),
    /// Another sensor answers, or the calibration is blank.
    Identity,
}

/// Calibration constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Calibration {
    /// Temperature: T1 to T3.
    t: [i64; 3],
    /// Pressure: P1 to P9.
    p: [i64; 9],
    /// Humidity: H1 to H6.
    h: [i64; 6],
}

impl Calibration {
    /// Parses the two blocks; `None` if they are blank.
    fn parse(first: &[u8; 26], second: &[u8; 7]) -> Option<Self> {
        let unsigned = |at: usize| {
            let byte = |place: usize| i64::from(first.get(place).copied().unwrap_or(0));
            byte(at) | byte(at + 1) << 8
        };
        let signed = |at: usize| i64::from(unsigned(at) as i16);
        let [h2_low, h2_high, h3, h4, shared, h5, h6] = *second;
        let low = i64::from(shared & 0x0F);
        let high = i64::from(shared >> 4);
        let calibration = Self {
            t: [unsigned(0), signed(2), signed(4)],
            p: core::array::from_fn(
                |place| if place == 0 { unsigned(6) } else { signed(6 + 2 * place) },
            ),
            h: [
                i64::from(first.last().copied().unwrap_or(0)),
                i64::from(i16::from_le_bytes([h2_low, h2_high])),
                i64::from(h3),
                i64::from(h4 as i8) << 4 | low,
                i64::from(h5 as i8) << 4 | high,
                i64::from(h6 as i8),
            ],
        };
        let is_blank = |byte: u8| first.iter().all(|found| *found == byte);
        (!is_blank(0) && !is_blank(0xFF)).then_some(calibration)
    }

    /// Corrects raw values. The formulas are those of the data sheet. Constants of a sound sensor do not overflow 64 bits;
    /// others give a wrong value, but no panic.
    fn air(&self, raw: &[u8; 8]) -> Air {
        let [p_high, p_middle, p_low, t_high, t_middle, t_low, h_high, h_low] = raw.map(i64::from);
        let raw_p = p_high << 12 | p_middle << 4 | p_low >> 4;
        let raw_t = t_high << 12 | t_middle << 4 | t_low >> 4;
        let fine = self.fine_temperature(raw_t);
        Air {
            pressure_pa: self.pressure(raw_p, fine) as f32 / 256.0,
            temperature_c: ((fine * 5 + 128) >> 8) as f32 * 0.01,
            humidity_percent: self.humidity(h_high << 8 | h_low, fine) as f32 / 1024.0,
        }
    }

    /// Returns the temperature, in 1/5120 deg C.
    fn fine_temperature(&self, raw: i64) -> i64 {
        let [t1, t2, t3] = self.t;
        let linear = (((raw >> 3) - (t1 << 1)) * t2) >> 11;
        let distance = (raw >> 4) - t1;
        linear + ((((distance * distance) >> 12) * t3) >> 14)
    }

    /// Returns the pressure, in 1/256 Pa; 0 if the calibration allows none.
    fn pressure(&self, raw: i64, fine: i64) -> i64 {
        let [p1, p2, p3, p4, p5, p6, p7, p8, p9] = self.p;
        let warm = fine - 128_000;
        let offset = warm * warm * p6 + ((warm * p5) << 17) + (p4 << 35);
        let slope = ((warm * warm * p3) >> 8) + ((warm * p2) << 12);
        let slope = ((1 << 47) + slope).wrapping_mul(p1) >> 33;
        let pressure = (((1_048_576 - raw) << 31) - offset).wrapping_mul(3125);
        let pressure = pressure.checked_div(slope).unwrap_or(0);
        let square = p9.wrapping_mul(pressure >> 13).wrapping_mul(pressure >> 13) >> 25;
        let linear = p8.wrapping_mul(pressure) >> 19;
        (pressure.wrapping_add(square).wrapping_add(linear) >> 8) + (p7 << 4)
    }

    /// Returns the humidity, in 1/1024 percent.
    fn humidity(&self, raw: i64, fine: i64) -> i64 {
        let [h1, h2, h3, h4, h5, h6] = self.h;
        let warm = fine - 76_800;
        let base = ((raw << 14) - (h4 << 20) - h5 * warm + 16_384) >> 15;
        let slope = (((warm * h6) >> 10) * (((warm * h3) >> 11) + 32_768)) >> 10;
        let value = base * (((slope + 2_097_152) * h2 + 8_192) >> 14);
        let square = (value >> 15).wrapping_mul(value >> 15) >> 7;
        let value = value.wrapping_sub(square.wrapping_mul(h1) >> 4);
        value.clamp(0, 419_430_400) >> 12
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Reset,
    Identify,
    Calibrate,
    CalibrateHumidity { first: [u8; 26] },
    SetHumidity,
    Measure,
    Read,
}

/// State of one sensor. Its bus is passed in, because another sensor owns it.
#[derive(Clone, Debug)]
pub struct Bme280 {
    step: Step,
    due_us: u64,
    calibration: Option<Calibration>,
    failed: bool,
}

impl Default for Bme280 {
    fn default() -> Self {
        Self::new()
    }
}

impl Bme280 {
    /// Creates the driver; the sensor is reset with the first poll.
    pub const fn new() -> Self {
        Self { step: Step::Reset, due_us: 0, calibration: None, failed: false }
    }

    /// Does the next transfer if one is due. Returns the state of the air when it is measured.
    ///
    /// # Errors
    /// Returns what failed. Keep calling: the driver starts again after a pause.
    pub fn poll<B: SensorBus>(
        &mut self,
        bus: &mut B,
        now_us: u64,
    ) -> Result<Option<Air>, AirError<B::Error>> {
        if now_us < self.due_us {
            return Ok(None);
        }
        if core::mem::take(&mut self.failed) {
            bus.recover();
        }
        let result = self.advance(bus, now_us);
        if matches!(&result, Err(AirError::I2c(error)) if B::is_pending(error)) {
            return Ok(None);
        }
        if result.is_err() {
            *self = Self { due_us: now_us + RETRY_DELAY_US, failed: true, ..Self::new() };
        }
        result
    }

    fn advance<B: SensorBus>(
        &mut self,
        bus: &mut B,
        now_us: u64,
    ) -> Result<Option<Air>, AirError<B::Error>> {
        let (next, wait_us) = match self.step {
            Step::Reset => {
                send(bus, register::RESET, RESET_WORD)?;
                (Step::Identify, RESET_US)
            }
            Step::Identify => {
                if receive::<B, 1>(bus, register::IDENTITY)? != [IDENTITY] {
                    return Err(AirError::Identity);
                }
                (Step::Calibrate, 0)
            }
            Step::Calibrate => {
                (Step::CalibrateHumidity { first: receive(bus, register::CALIBRATION)? }, 0)
            }
            Step::CalibrateHumidity { first } => {
                let second = receive(bus, register::HUMIDITY_CALIBRATION)?;
                let found = Calibration::parse(&first, &second);
                self.calibration = Some(found.ok_or(AirError::Identity)?);
                (Step::SetHumidity, 0)
            }
            Step::SetHumidity => {
                send(bus, register::HUMIDITY_CONTROL, HUMIDITY_ONCE)?;
                (Step::Measure, 0)
            }
            Step::Measure => {
                send(bus, register::CONTROL, MEASURE)?;
                (Step::Read, MEASUREMENT_US)
            }
            Step::Read => {
                let raw = receive(bus, register::DATA)?;
                self.step = Step::SetHumidity;
                self.due_us = now_us + PERIOD_US - MEASUREMENT_US - POLL_US;
                let calibration = self.calibration.filter(|_| is_measured(&raw));
                return Ok(calibration.map(|calibration| calibration.air(&raw)));
            }
        };
        self.step = next;
        self.due_us = now_us + wait_us;
        Ok(None)
    }
}

/// Returns true if the sensor has measured all three quantities.
fn is_measured(raw: &[u8; 8]) -> bool {
    let [a, b, c, d, e, f, g, h] = *raw;
    [a, b, c] != NOT_MEASURED && [d, e, f] != NOT_MEASURED && [g, h] != HUMIDITY_NOT_MEASURED
}

#[inline(never)]
fn send<B: SensorBus>(bus: &mut B, register: u8, word: u8) -> Result<(), AirError<B::Error>> {
    bus.write(ADDRESS, &[register, word]).map_err(AirError::I2c)
}

fn receive<B: SensorBus, const N: usize>(
    bus: &mut B,
    register: u8,
) -> Result<[u8; N], AirError<B::Error>> {
    let mut bytes = [0; N];
    bus.write_read(ADDRESS, &[register], &mut bytes).map_err(AirError::I2c)?;
    Ok(bytes)
}

#[cfg(test)]
#[path = "bme280_tests.rs"]
mod tests;
