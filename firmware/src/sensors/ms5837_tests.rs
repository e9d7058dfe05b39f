//! Tests of the pressure sensor against its data sheet.

use super::*;
use embedded_hal::i2c::{ErrorKind, ErrorType, Operation};

/// Calibration of the data sheet's worked example.
const EXAMPLE: [u16; 6] = [34982, 36352, 20328, 22354, 26646, 26146];
const D1: u32 = 4_958_179;
const D2: u32 = 6_815_414;

fn prom() -> [u16; 7] {
    let [c1, c2, c3, c4, c5, c6] = EXAMPLE;
    let crc = crc4(&[0x0040, c1, c2, c3, c4, c5, c6, 0]);
    [crc << 12 | 0x0040, c1, c2, c3, c4, c5, c6]
}

/// Computes the CRC by long division, bit by bit, independently of the driver. The data sheet divides
/// fifteen bytes and four zeros; the rest of the last word only shifts them through its register.
fn remainder(words: &[u16]) -> u16 {
    let bits = words.iter().flat_map(|word| (0..16).rev().map(move |place| word >> place & 1));
    bits.take(124).fold(0, |rest, bit| {
        let carried = rest & 8 != 0;
        let rest = (rest << 1 | bit) & 0xF;
        if carried { rest ^ 3 } else { rest }
    })
}

#[test]
fn crc_detects_every_flipped_bit() {
    let good = prom();
    assert!(Calibration::parse(&good).is_some());
    for word in 0..7 {
        for bit in 0..16 {
            let mut bad = good;
            bad[word] ^= 1 << bit;
            assert_eq!(Calibration::parse(&bad), None, "word {word}, bit {bit}");
        }
    }
    assert_eq!(Calibration::parse(&[0; 7]), None);
}

#[test]
fn crc_equals_division_by_its_polynomial() {
    let words = [0x0040, 34982, 36352, 20328, 22354, 26646, 26146, 0];
    assert_eq!(crc4(&words), remainder(&words));
    assert_eq!(crc4(&[0, 0, 0, 0, 0, 0, 0, 0]), 0);
}

#[test]
fn example_of_the_data_sheet_is_reproduced() {
    // Data sheet: 19.81 deg C, 3999.8 mbar.
    let found = Calibration(EXAMPLE).measurement(D1, D2);
    assert!((found.temperature_c - 19.81).abs() < 0.005, "{found:?}");
    assert!((found.pressure_pa - 399_980.0).abs() <= 10.0, "{found:?}");
}

#[test]
fn second_order_correction_matches_the_flow_chart() {
    // The flow chart in floating point, for temperatures of about -30, 0 and 40 deg C.
    let [c1, c2, c3, c4, c5, c6] = EXAMPLE.map(f64::from);
    for d2 in [5_200_000, 6_180_000, 7_450_000] {
        let dt = f64::from(d2) - c5 * 256.0;
        let temp = 2000.0 + dt * c6 / 8_388_608.0;
        let (off, sens) = (c2 * 65536.0 + c4 * dt / 128.0, c1 * 32768.0 + c3 * dt / 256.0);
        let (mut ti, mut offi, mut sensi);
        if temp < 2000.0 {
            ti = 3.0 * dt * dt / 2f64.powi(33);
            offi = 3.0 * (temp - 2000.0).powi(2) / 2.0;
            sensi = 5.0 * (temp - 2000.0).powi(2) / 8.0;
            if temp < -1500.0 {
                offi += 7.0 * (temp + 1500.0).powi(2);
                sensi += 4.0 * (temp + 1500.0).powi(2);
            }
        } else {
            ti = 2.0 * dt * dt / 2f64.powi(37);
            offi = (temp - 2000.0).powi(2) / 16.0;
            sensi = 0.0;
        }
        ti = temp - ti;
        offi = off - offi;
        sensi = sens - sensi;
        let pressure = (f64::from(D1) * sensi / 2_097_152.0 - offi) / 8192.0 * 10.0;
        let found = Calibration(EXAMPLE).measurement(D1, d2);
        assert!((f64::from(found.temperature_c) - ti / 100.0).abs() < 0.02, "{temp}: {found:?}");
        assert!((f64::from(found.pressure_pa) - pressure).abs() < 15.0, "{temp}: {found:?}");
    }
}

/// A simulated sensor on its bus.
#[derive(Debug)]
struct Chip {
    broken: bool,
    conversions: Vec<u8>,
    converted: u32,
    transfers: usize,
    /// True while the sensor holds the data line; a recovery releases it.
    held: bool,
    recovered: usize,
}

impl SensorBus for Chip {
    fn recover(&mut self) {
        self.held = false;
        self.recovered += 1;
    }
}

impl ErrorType for Chip {
    type Error = ErrorKind;
}

impl I2c for Chip {
    fn transaction(&mut self, address: u8, steps: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        self.transfers += 1;
        if self.broken || self.held || address != ADDRESS {
            return Err(ErrorKind::Bus);
        }
        let mut command = 0;
        for step in steps {
            match step {
                Operation::Write(bytes) => {
                    command = bytes[0];
                    match command {
                        CONVERT_PRESSURE => self.converted = D1,
                        CONVERT_TEMPERATURE => self.converted = D2,
                        _ => continue,
                    }
                    self.conversions.push(command);
                }
                Operation::Read(into) if command == READ => {
                    into.copy_from_slice(&self.converted.to_be_bytes()[1..]);
                    self.converted = 0;
                }
                Operation::Read(into) => {
                    let word = prom()[usize::from(command - PROM) / 2];
                    into.copy_from_slice(&word.to_be_bytes());
                }
            }
        }
        Ok(())
    }
}

fn sensor() -> Ms5837<Chip> {
    Ms5837::new(Chip {
        broken: false,
        conversions: Vec::new(),
        converted: 0,
        transfers: 0,
        held: false,
        recovered: 0,
    })
}

/// Polls once a millisecond until a measurement or an error arrives.
fn poll_until_result(
    sensor: &mut Ms5837<Chip>,
    now_us: &mut u64,
) -> Result<Measurement, PressureError<ErrorKind>> {
    for _ in 0..1000 {
        let before = sensor.bus.transfers;
        let polled = sensor.poll(*now_us);
        assert!(sensor.bus.transfers <= before + 1, "one transfer a poll");
        *now_us += 1000;
        if let Some(found) = polled? {
            return Ok(found);
        }
    }
    panic!("no result within a second");
}

#[test]
fn poll_measures_repeatedly() {
    let (mut sensor, mut now_us) = (sensor(), 0);
    let first = poll_until_result(&mut sensor, &mut now_us).unwrap();
    assert_eq!(first, Calibration(EXAMPLE).measurement(D1, D2));
    let before_us = now_us;
    assert_eq!(poll_until_result(&mut sensor, &mut now_us), Ok(first));
    assert!(now_us - before_us < 25_000, "40 a second");
    assert_eq!(
        sensor.bus.conversions,
        [CONVERT_TEMPERATURE, CONVERT_PRESSURE, CONVERT_TEMPERATURE, CONVERT_PRESSURE]
    );
}

#[test]
fn failed_transfer_is_reported_and_retried_after_a_pause() {
    let (mut sensor, mut now_us) = (sensor(), 0);
    poll_until_result(&mut sensor, &mut now_us).unwrap();
    sensor.bus.broken = true;
    assert_eq!(
        poll_until_result(&mut sensor, &mut now_us),
        Err(PressureError::I2c(ErrorKind::Bus))
    );
    let transfers = sensor.bus.transfers;
    for _ in 0..150 {
        assert_eq!(sensor.poll(now_us), Ok(None));
        now_us += 1000;
    }
    assert_eq!(sensor.bus.transfers, transfers);
    sensor.bus.broken = false;
    assert!(poll_until_result(&mut sensor, &mut now_us).is_ok());
}

#[test]
fn a_bus_that_is_held_is_freed_once_a_pause_and_a_sound_one_never() {
    let (mut sensor, mut now_us) = (sensor(), 0);
    poll_until_result(&mut sensor, &mut now_us).unwrap();
    poll_until_result(&mut sensor, &mut now_us).unwrap();
    assert_eq!(sensor.bus.recovered, 0);
    sensor.bus.held = true;
    assert!(poll_until_result(&mut sensor, &mut now_us).is_err());
    assert_eq!(sensor.bus.recovered, 0, "not before the pause");
    assert!(poll_until_result(&mut sensor, &mut now_us).is_ok());
    assert_eq!(sensor.bus.recovered, 1);
    sensor.bus.broken = true;
    for _ in 0..1000 {
        let _ = sensor.poll(now_us);
        now_us += 1000;
    }
    assert!((5..=6).contains(&sensor.bus.recovered), "{} in a second", sensor.bus.recovered);
}
