//! Tests of the sensor in the housing against its data sheet.

use super::*;
use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, Operation};
use proptest::prelude::*;

/// Constants of the worked example for temperature and pressure (BMP280 data sheet, 3.12), and those of a sensor for the
/// humidity.
const T: [i64; 3] = [27504, 26435, -1000];
const P: [i64; 9] = [36477, -10685, 3024, 2855, 140, -7, 15500, -14600, 6000];
const H: [i64; 6] = [75, 362, 0, 331, 50, 30];
const RAW_T: u32 = 519_888;
const RAW_P: u32 = 415_148;

fn calibration() -> ([u8; 26], [u8; 7]) {
    let mut first = [0; 26];
    for (place, word) in first.chunks_exact_mut(2).zip(T.iter().chain(&P)) {
        place.copy_from_slice(&(*word as u16).to_le_bytes());
    }
    first[25] = H[0] as u8;
    let [h2_low, h2_high] = (H[1] as i16).to_le_bytes();
    let shared = (H[3] as u8 & 0xF) | (H[4] as u8) << 4;
    (first, [h2_low, h2_high, H[2] as u8, (H[3] >> 4) as u8, shared, (H[4] >> 4) as u8, H[5] as u8])
}

fn raw(humidity: u16) -> [u8; 8] {
    let [_, a, b, c] = (RAW_P << 4).to_be_bytes();
    let [_, d, e, f] = (RAW_T << 4).to_be_bytes();
    let [g, h] = humidity.to_be_bytes();
    [a, b, c, d, e, f, g, h]
}

fn parsed() -> Calibration {
    let (first, second) = calibration();
    Calibration::parse(&first, &second).expect("not blank")
}

#[test]
fn example_of_the_data_sheet_is_reproduced() {
    assert_eq!(parsed(), Calibration { t: T, p: P, h: H });
    // 25.08 deg C and 100653.27 Pa.
    let air = parsed().air(&raw(30_000));
    assert!((air.temperature_c - 25.08).abs() < 0.005, "{air:?}");
    assert!((air.pressure_pa - 100_653.27).abs() < 0.05, "{air:?}");
}

#[test]
fn humidity_equals_the_formula_in_floating_point() {
    // Data sheet, 8.1.
    let [h1, h2, h3, h4, h5, h6] = H.map(|word| word as f64);
    let warm = parsed().fine_temperature(i64::from(RAW_T)) as f64 - 76_800.0;
    for counts in [20_000, 25_000, 30_000, 35_000, 40_000] {
        let value = (f64::from(counts) - (h4 * 64.0 + h5 / 16384.0 * warm))
            * (h2 / 65536.0 * (1.0 + h6 / 67_108_864.0 * warm * (1.0 + h3 / 67_108_864.0 * warm)));
        let expected = (value * (1.0 - h1 * value / 524_288.0)).clamp(0.0, 100.0);
        let found = f64::from(parsed().air(&raw(counts)).humidity_percent);
        assert!((found - expected).abs() < 0.02, "{counts}: {found}, expected {expected}");
    }
    assert_eq!(parsed().air(&raw(0)).humidity_percent, 0.0);
    assert_eq!(parsed().air(&raw(u16::MAX)).humidity_percent, 100.0);
}

proptest! {
    #[test]
    fn any_constants_and_counts_give_a_number(
        first in any::<[u8; 26]>(), second in any::<[u8; 7]>(), raw in any::<[u8; 8]>(),
    ) {
        if let Some(calibration) = Calibration::parse(&first, &second) {
            let air = calibration.air(&raw);
            prop_assert!((0.0..=100.0).contains(&air.humidity_percent));
            prop_assert!(air.pressure_pa.is_finite() && air.temperature_c.is_finite());
        }
    }
}

/// A sensor on a bus, with its registers.
struct Bus {
    registers: [u8; 256],
    measures_humidity: bool,
    measures: usize,
    recoveries: usize,
    is_broken: bool,
}

impl Bus {
    fn new() -> Self {
        let mut registers = [0; 256];
        let (first, second) = calibration();
        registers[0x88..0x88 + 26].copy_from_slice(&first);
        registers[0xE1..0xE1 + 7].copy_from_slice(&second);
        registers[0xD0] = 0x60;
        Self { registers, measures_humidity: false, measures: 0, recoveries: 0, is_broken: false }
    }
}

impl ErrorType for Bus {
    type Error = ErrorKind;
}

impl I2c for Bus {
    fn transaction(&mut self, address: u8, steps: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        if self.is_broken {
            return Err(ErrorKind::Other);
        }
        assert_eq!(address, 0x77);
        let mut at = 0;
        for step in steps {
            match step {
                Operation::Write([register]) => at = usize::from(*register),
                Operation::Write([0xF4, word]) => {
                    assert_eq!(*word & 3, 1, "forced mode");
                    self.measures += 1;
                    let humidity = if self.measures_humidity { 30_000 } else { 0x8000 };
                    self.registers[0xF7..0xFF].copy_from_slice(&raw(humidity));
                }
                Operation::Write([0xF2, word]) => self.measures_humidity = *word == 1,
                Operation::Write(other) => assert_eq!(other.len(), 2),
                Operation::Read(into) => {
                    into.copy_from_slice(&self.registers[at..at + into.len()]);
                }
            }
        }
        Ok(())
    }
}

impl SensorBus for Bus {
    fn recover(&mut self) {
        self.recoveries += 1;
    }
}

/// Polls once a millisecond; returns the measurements with their times, ms.
fn poll(sensor: &mut Bme280, bus: &mut Bus, range_ms: std::ops::Range<u64>) -> Vec<(u64, Air)> {
    range_ms
        .filter_map(|ms| sensor.poll(bus, 1000 * ms).ok().flatten().map(|air| (ms, air)))
        .collect()
}

#[test]
fn sensor_measures_once_a_second() {
    let (mut sensor, mut bus) = (Bme280::new(), Bus::new());
    let found = poll(&mut sensor, &mut bus, 0..3500);
    assert_eq!((found.len(), bus.measures), (4, 4), "{found:?}");
    assert!(found[0].0 < 30 && found[1].0 - found[0].0 == 1000, "{found:?}");
    assert!((found[0].1.pressure_pa - 100_653.27).abs() < 0.05);
}

#[test]
fn sensor_that_lost_its_power_measures_the_humidity_again() {
    let (mut sensor, mut bus) = (Bme280::new(), Bus::new());
    let expected = poll(&mut sensor, &mut bus, 0..100)[0].1;
    // At rest, and every millisecond around a measurement.
    let mut found = Vec::new();
    for ms in 100..60_000 {
        if ms % 1001 == 500 {
            bus.measures_humidity = false;
            bus.registers[0xF7..0xFF].copy_from_slice(&[0x80, 0, 0, 0x80, 0, 0, 0x80, 0]);
        }
        found.extend(poll(&mut sensor, &mut bus, ms..ms + 1));
    }
    assert!(found.iter().all(|(_, air)| *air == expected), "{found:?}");
    // Only a loss between the settings and the result of a measurement costs it.
    assert!((45..60).contains(&found.len()), "{}", found.len());
}

#[test]
fn lost_sensor_is_started_again_and_another_one_is_refused() {
    let (mut sensor, mut bus) = (Bme280::new(), Bus::new());
    assert_eq!(poll(&mut sensor, &mut bus, 0..100).len(), 1);
    bus.is_broken = true;
    assert!(poll(&mut sensor, &mut bus, 100..3000).is_empty());
    assert!((5..=12).contains(&bus.recoveries), "{}", bus.recoveries);
    bus.is_broken = false;
    assert!(!poll(&mut sensor, &mut bus, 3000..3300).is_empty());
    // A BMP280 has no humidity.
    bus.registers[0xD0] = 0x58;
    let mut other = Bme280::new();
    assert!(poll(&mut other, &mut bus, 0..1000).is_empty());
    // A bus that is held low or open.
    for byte in [0, 0xFF] {
        bus.registers = [byte; 256];
        bus.registers[0xD0] = 0x60;
        assert!(poll(&mut Bme280::new(), &mut bus, 0..1000).is_empty());
    }
}
