//! The pressure sensor: an MS5837-30BA with the calibration of its data sheet's example.
//!
//! A command starts a conversion or selects a word of the PROM; a read returns it. A read before the end of a conversion
//! returns 0. The counts are the inverse of the data sheet's compensation, here in floating point.

/// Its I2C address.
pub const ADDRESS: u8 = 0x76;

/// Words 0 to 6 of the PROM. The upper four bits of the first are the CRC of all.
const PROM: [u16; 7] = [0x2000, 34982, 36352, 20328, 22354, 26646, 26146];

const RESET: u8 = 0x1E;
const READ: u8 = 0x00;
/// Conversion time with the highest resolution, cycles.
const CONVERSION_CYCLES: u64 = 9_040 * 170;

/// What the sensor is in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Water {
    /// Absolute pressure, Pa.
    pub pressure_pa: f64,
    /// Temperature, deg C, above -15.
    pub temperature_c: f64,
}

impl Default for Water {
    fn default() -> Self {
        Self { pressure_pa: 101_325.0, temperature_c: 20.0 }
    }
}

/// The sensor.
#[derive(Clone, Debug, Default)]
pub struct Ms5837 {
    /// Result of the last conversion, and the time at which it is ready, cycles.
    converted: (u32, u64),
    /// Bytes that the next reads return.
    answer: Vec<u8>,
    reads_conversion: bool,
}

impl Ms5837 {
    /// Takes a byte from the bus.
    pub fn write(&mut self, command: u8, now: u64, water: Water) {
        self.answer.clear();
        self.reads_conversion = command == READ;
        match command {
            RESET => self.converted = (0, 0),
            0x40..=0x4A => self.converted = (counts(water).0, now + CONVERSION_CYCLES),
            0x50..=0x5A => self.converted = (counts(water).1, now + CONVERSION_CYCLES),
            0xA0..=0xAC => {
                let word = PROM[usize::from(command - 0xA0) / 2];
                self.answer.extend(word.to_be_bytes());
            }
            _ => {}
        }
    }

    /// Returns the next byte.
    pub fn read(&mut self, now: u64) -> u8 {
        if std::mem::take(&mut self.reads_conversion) {
            let (counts, ready) = std::mem::take(&mut self.converted);
            let counts = if ready <= now { counts } else { 0 };
            self.answer = counts.to_be_bytes()[1..].to_vec();
        }
        if self.answer.is_empty() { 0 } else { self.answer.remove(0) }
    }
}

/// Returns temperature, 0.01 deg C, and pressure, 0.1 mbar, for conversions of pressure and temperature.
fn compensate(d1: f64, d2: f64) -> (f64, f64) {
    let [c1, c2, c3, c4, c5, c6] = std::array::from_fn(|at| f64::from(PROM[at + 1]));
    let difference = d2 - c5 * 256.0;
    let first = 2000.0 + difference * c6 / 8_388_608.0;
    let offset = c2 * 65_536.0 + c4 * difference / 128.0;
    let slope = c1 * 32_768.0 + c3 * difference / 256.0;
    let square = (first - 2000.0) * (first - 2000.0);
    // Second order, above -15 deg C.
    let (less, less_offset, less_slope) = if first < 2000.0 {
        (3.0 * difference * difference / 8_589_934_592.0, 1.5 * square, 0.625 * square)
    } else {
        (2.0 * difference * difference / 137_438_953_472.0, square / 16.0, 0.0)
    };
    let pressure = (d1 * (slope - less_slope) / 2_097_152.0 - (offset - less_offset)) / 8_192.0;
    (first - less, pressure)
}

/// Returns the conversions of pressure and temperature.
fn counts(water: Water) -> (u32, u32) {
    // Both rise with their quantity.
    let find = |is_below: &dyn Fn(f64) -> bool| {
        let (mut low, mut high) = (0u32, 0xFF_FFFF);
        while low < high {
            let middle = low.midpoint(high);
            if is_below(f64::from(middle)) { low = middle + 1 } else { high = middle }
        }
        low
    };
    let d2 = find(&|d2| compensate(0.0, d2).0 < 100.0 * water.temperature_c);
    let d1 = find(&|d1| compensate(d1, f64::from(d2)).1 < 0.1 * water.pressure_pa);
    (d1, d2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware::sensors::ms5837::Calibration;

    #[test]
    fn counts_are_inverse_of_firmwares_compensation() {
        let calibration = Calibration::parse(&PROM).expect("the CRC is right");
        for (pressure_pa, temperature_c) in [(1e5, 20.0), (4e5, 4.0), (3e6, 35.0)] {
            let (d1, d2) = counts(Water { pressure_pa, temperature_c });
            let found = calibration.measurement(d1, d2);
            assert!((f64::from(found.pressure_pa) - pressure_pa).abs() < 30.0, "{found:?}");
            assert!((f64::from(found.temperature_c) - temperature_c).abs() < 0.02, "{found:?}");
        }
    }
}
