//! Sensor drivers of a joint, independent of the board.
//!
//! They use the traits of embedded-hal and convert counts to SI units:
//!
//! - [`biss`]: absolute encoder with a BiSS C interface;
//! - [`bme280`]: humidity and pressure of the air in the housing, on the same I2C bus as `ms5837`;
//! - [`bus_recovery`]: releases an I2C bus whose data line is held low;
//! - [`as504x`]: magnetic encoder on SPI, read by the current loop in every period;
//! - [`encoder`]: the motor's encoder, of the kind that a parameter selects;
//! - [`evaluation`]: what the kinds of encoders say of a period;
//! - [`hall`]: three Hall sensors as an encoder;
//! - [`quadrature`]: ABZ encoder with an index, and its start by Hall sensors;
//! - [`enclosure`]: what leak probe, humidity, housing pressure and safe torque off say about the dry side;
//! - [`ms5837`]: water pressure on I2C, in small steps that never block;
//! - [`parameters`]: constants of the sensors, as parameters;
//! - [`quiet`]: when slow conversions do not disturb those of the current loop;
//! - [`shunt`]: phase currents from low-side shunts;
//! - [`stepped_i2c`]: I2C transfers a byte at a time, without waiting;
//! - [`strain_gauge`]: side load on the shaft from a Wheatstone bridge;
//! - [`stuck`]: detects a side-load or pressure sensor whose reading is stuck;
//! - [`thermistor`]: temperature of bridge and motor from a divider.
//!
//! [`LocalReadings`] holds the latest readings with their age. The bus may provide the same quantities; the
//! newer reading is used. A joint without a sensor can thus receive its value from the bus.

pub mod as504x;
pub mod biss;
pub mod bme280;
pub mod bus_recovery;
pub mod comparator;
pub mod enclosure;
pub mod encoder;
pub(crate) mod encoder_kind;
pub mod evaluation;
pub mod hall;
pub mod ms5837;
pub mod parameters;
pub mod quadrature;
pub mod quiet;
pub mod shunt;
pub mod stepped_i2c;
pub mod strain_gauge;
pub mod stuck;
pub mod thermistor;

pub use parameters::SensorParameters;

use crate::control::Covariates;
use compensator_core::compensator::Reading;

#[derive(Clone, Copy, Debug)]
struct TimedValue {
    value: f32,
    at_us: u64,
}

/// Latest readings of the board's own sensors.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalReadings {
    radial_force_n: Option<TimedValue>,
    pressure_diff_mpa: Option<TimedValue>,
    temperature_c: Option<TimedValue>,
}

impl LocalReadings {
    /// Sets the side load on the shaft, N. A value that is not finite is ignored, so the last valid one
    /// ages.
    pub fn set_radial_force(&mut self, value: f32, now_us: u64) {
        store_if_finite(&mut self.radial_force_n, value, now_us);
    }

    /// Sets the outside minus inside pressure, Pa.
    pub fn set_pressure_diff(&mut self, value: f32, now_us: u64) {
        store_if_finite(&mut self.pressure_diff_mpa, value * 1e-6, now_us);
    }

    /// Sets the temperature at the seal, deg C.
    pub fn set_temperature(&mut self, value: f32, now_us: u64) {
        store_if_finite(&mut self.temperature_c, value, now_us);
    }

    /// Replaces covariates that are missing or older than these readings.
    pub fn apply_newer(&self, covariates: &mut Covariates, now_us: u64) {
        for (local, reported) in [
            (self.radial_force_n, &mut covariates.radial_force_n),
            (self.pressure_diff_mpa, &mut covariates.pressure_diff_mpa),
            (self.temperature_c, &mut covariates.temperature_c),
        ] {
            let Some(local) = local else { continue };
            let age_s = now_us.saturating_sub(local.at_us) as f32 * 1e-6;
            let is_missing = reported.age_s.is_nan() || reported.age_s < 0.0;
            if is_missing || age_s < reported.age_s {
                *reported = Reading { value: local.value, age_s };
            }
        }
    }
}

fn store_if_finite(place: &mut Option<TimedValue>, value: f32, at_us: u64) {
    if value.is_finite() {
        *place = Some(TimedValue { value, at_us });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn apply_newer_uses_the_younger_of_bus_and_board() {
        let mut local = LocalReadings::default();
        let mut covariates = Covariates::MISSING;
        local.apply_newer(&mut covariates, 0);
        assert!(covariates.radial_force_n.age_s < 0.0);
        local.set_radial_force(12.0, 1_000_000);
        local.set_radial_force(f32::NAN, 2_000_000);
        local.apply_newer(&mut covariates, 3_000_000);
        assert_eq!((covariates.radial_force_n.value, covariates.radial_force_n.age_s), (12.0, 2.0));
        assert!(covariates.pressure_diff_mpa.age_s < 0.0);
        covariates.radial_force_n = Reading { value: 7.0, age_s: 0.5 };
        local.apply_newer(&mut covariates, 3_000_000);
        assert_eq!(covariates.radial_force_n.value, 7.0);
        local.set_pressure_diff(3e5, 10);
        local.set_temperature(11.0, 10);
        local.apply_newer(&mut covariates, 10);
        assert!((covariates.pressure_diff_mpa.value - 0.3).abs() < 1e-7);
        assert_eq!(covariates.temperature_c.value, 11.0);
    }
}
