//! The sensor of humidity, pressure and temperature in the housing: a BME280 (data sheet BST-BME280-DS002).
//!
//! A write begins with the register, and pairs of register and word may follow. A read continues from the register and
//! counts up. A measurement in forced mode takes 9.3 ms; before its end, the data are those of the last one. The raw values
//! are the inverse of the data sheet's compensation, here in floating point (its section 8.1).

/// Its I2C address.
pub const ADDRESS: u8 = 0x77;

const IDENTITY: usize = 0xD0;
const RESET: usize = 0xE0;
const HUMIDITY_CONTROL: usize = 0xF2;
const CONTROL: usize = 0xF4;
const DATA: usize = 0xF7;
const RESET_WORD: u8 = 0xB6;
const FORCED: u8 = 1;
/// Data after a reset, and of a quantity that is not sampled: pressure, temperature, humidity.
const NOT_MEASURED: [u8; 8] = [0x80, 0, 0, 0x80, 0, 0, 0x80, 0];
/// Longest measurement with one sample of each, cycles.
const MEASUREMENT_CYCLES: u64 = 9_300 * 170;

/// Calibration constants: T1 to T3, P1 to P9, H1 to H6.
const T: [f64; 3] = [27504.0, 26435.0, -1000.0];
const P: [f64; 9] = [36477.0, -10685.0, 3024.0, 2855.0, 140.0, -7.0, 15500.0, -14600.0, 6000.0];
const H: [f64; 6] = [75.0, 370.0, 0.0, 310.0, 50.0, 30.0];

/// What the sensor is in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HousingAir {
    /// Absolute pressure, Pa.
    pub pressure_pa: f64,
    /// Temperature, deg C.
    pub temperature_c: f64,
    /// Relative humidity, percent.
    pub humidity_percent: f64,
}

impl Default for HousingAir {
    fn default() -> Self {
        Self { pressure_pa: 101_325.0, temperature_c: 20.0, humidity_percent: 20.0 }
    }
}

/// The sensor.
#[derive(Clone, Debug)]
pub struct Bme280 {
    registers: [u8; 256],
    pointer: usize,
    /// The next byte of a write is a register.
    awaits_register: bool,
    /// Data of the measurement that runs, and its end, cycles.
    measured: Option<([u8; 8], u64)>,
}

impl Default for Bme280 {
    fn default() -> Self {
        let mut registers = [0; 256];
        let words = T.iter().chain(&P).flat_map(|word| (*word as i32 as u16).to_le_bytes());
        registers[0x88..0xA0].iter_mut().zip(words).for_each(|(place, byte)| *place = byte);
        let [h1, h2, h3, h4, h5, h6] = H.map(|word| word as u16);
        let shared = (h4 & 0xF) as u8 | ((h5 & 0xF) as u8) << 4;
        registers[0xA1] = h1 as u8;
        let [low, high] = h2.to_le_bytes();
        registers[0xE1..0xE8].copy_from_slice(&[
            low,
            high,
            h3 as u8,
            (h4 >> 4) as u8,
            shared,
            (h5 >> 4) as u8,
            h6 as u8,
        ]);
        let mut sensor = Self { registers, pointer: 0, awaits_register: true, measured: None };
        sensor.reset();
        sensor
    }
}

impl Bme280 {
    fn reset(&mut self) {
        self.measured = None;
        self.registers[IDENTITY] = 0x60;
        self.registers[HUMIDITY_CONTROL..DATA].fill(0);
        self.registers[DATA..DATA + 8].copy_from_slice(&NOT_MEASURED);
    }

    /// Begins a write.
    pub fn begin_write(&mut self) {
        self.awaits_register = true;
    }

    /// Takes a byte from the bus.
    pub fn write(&mut self, byte: u8, now: u64, air: HousingAir) {
        if std::mem::replace(&mut self.awaits_register, false) {
            self.pointer = byte.into();
            return;
        }
        self.awaits_register = true;
        match self.pointer {
            RESET if byte == RESET_WORD => self.reset(),
            HUMIDITY_CONTROL..DATA => self.registers[self.pointer] = byte,
            _ => {}
        }
        if self.pointer == CONTROL && byte & 3 == FORCED {
            let samples = [byte >> 2 & 7, byte >> 5, self.registers[HUMIDITY_CONTROL] & 7];
            self.measured = Some((raw(air, samples), now + MEASUREMENT_CYCLES));
        }
    }

    /// Returns the next byte.
    pub fn read(&mut self, now: u64) -> u8 {
        if let Some((data, end)) = self.measured
            && end <= now
        {
            self.measured = None;
            self.registers[DATA..DATA + 8].copy_from_slice(&data);
            self.registers[CONTROL] &= !FORCED;
        }
        let byte = self.registers[self.pointer & 0xFF];
        self.pointer += 1;
        byte
    }
}

/// Returns the data registers for this air; `samples` of pressure, temperature and humidity, 0 for none.
fn raw(air: HousingAir, samples: [u8; 3]) -> [u8; 8] {
    let temperature = find(20, |raw| fine(raw) / 5120.0 < air.temperature_c);
    let warm = fine(f64::from(temperature));
    // The pressure falls with its counts.
    let pressure = find(20, |raw| pressure_pa(raw, warm) > air.pressure_pa);
    let humidity = find(16, |raw| humidity_percent(raw, warm) < air.humidity_percent);
    let bytes = |word: u32| [(word >> 12) as u8, (word >> 4) as u8, (word << 4) as u8];
    let ([a, b, c], [d, e, f]) = (bytes(pressure), bytes(temperature));
    let mut data = [a, b, c, d, e, f, (humidity >> 8) as u8, humidity as u8];
    for (range, count) in [0..3, 3..6, 6..8].into_iter().zip(samples) {
        if count == 0 {
            data[range.clone()].copy_from_slice(&NOT_MEASURED[range]);
        }
    }
    data
}

/// Returns the first word of so many bits that is not before what is sought.
fn find(bits: u32, is_before: impl Fn(f64) -> bool) -> u32 {
    let (mut low, mut high) = (0, (1 << bits) - 1);
    while low < high {
        let middle = u32::midpoint(low, high);
        if is_before(f64::from(middle)) { low = middle + 1 } else { high = middle }
    }
    low
}

/// Returns the temperature, in 1/5120 deg C.
fn fine(raw: f64) -> f64 {
    let linear = (raw / 16384.0 - T[0] / 1024.0) * T[1];
    linear + (raw / 131_072.0 - T[0] / 8192.0).powi(2) * T[2]
}

fn pressure_pa(raw: f64, fine: f64) -> f64 {
    let warm = fine / 2.0 - 64_000.0;
    let offset = (warm * warm * P[5] / 32768.0 + warm * P[4] * 2.0) / 4.0 + P[3] * 65536.0;
    let slope = (P[2] * warm * warm / 524_288.0 + P[1] * warm) / 524_288.0;
    let slope = (1.0 + slope / 32768.0) * P[0];
    let pressure = (1_048_576.0 - raw - offset / 4096.0) * 6250.0 / slope;
    let square = P[8] * pressure * pressure / 2_147_483_648.0;
    pressure + (square + pressure * P[7] / 32768.0 + P[6]) / 16.0
}

fn humidity_percent(raw: f64, fine: f64) -> f64 {
    let warm = fine - 76_800.0;
    let base = raw - (H[3] * 64.0 + H[4] / 16384.0 * warm);
    let slope = 1.0 + H[5] / 67_108_864.0 * warm * (1.0 + H[2] / 67_108_864.0 * warm);
    let humidity = base * (H[1] / 65536.0 * slope);
    (humidity * (1.0 - H[0] * humidity / 524_288.0)).clamp(0.0, 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, Operation};
    use firmware::sensors::bme280::Bme280 as Driver;
    use firmware::sensors::ms5837::SensorBus;

    /// A bus with the sensor, at a time, us.
    struct Bus(Bme280, HousingAir, u64);

    impl ErrorType for Bus {
        type Error = ErrorKind;
    }

    impl I2c for Bus {
        fn transaction(&mut self, _: u8, steps: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
            let Self(sensor, air, now_us) = self;
            for step in steps {
                match step {
                    Operation::Write(bytes) => {
                        sensor.begin_write();
                        bytes.iter().for_each(|byte| sensor.write(*byte, 170 * *now_us, *air));
                    }
                    Operation::Read(bytes) => {
                        bytes.iter_mut().for_each(|byte| *byte = sensor.read(170 * *now_us));
                    }
                }
            }
            Ok(())
        }
    }

    impl SensorBus for Bus {
        fn recover(&mut self) {}
    }

    #[test]
    fn data_are_inverse_of_firmwares_compensation() {
        for (pressure_pa, temperature_c, humidity_percent) in
            [(9.5e4, 15.0, 10.0), (1.5e5, 4.0, 70.0), (1.01e5, 40.0, 95.0)]
        {
            let air = HousingAir { pressure_pa, temperature_c, humidity_percent };
            let mut bus = Bus(Bme280::default(), air, 0);
            let mut driver = Driver::new();
            let found = (0..100).find_map(|millisecond| {
                bus.2 = 1000 * millisecond;
                driver.poll(&mut bus, 1000 * millisecond).expect("the sensor answers")
            });
            let found = found.expect("a measurement");
            assert!((f64::from(found.pressure_pa) - pressure_pa).abs() < 10.0, "{found:?}");
            assert!((f64::from(found.temperature_c) - temperature_c).abs() < 0.02, "{found:?}");
            assert!(
                (f64::from(found.humidity_percent) - humidity_percent).abs() < 0.1,
                "{found:?}"
            );
        }
    }
}
