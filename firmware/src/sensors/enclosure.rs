//! The dry side of a sealed joint: leak probe, humidity, housing pressure, and the safe-torque-off input.
//!
//! A seal announces its end before it fails: the humidity in the housing rises, its pressure leaves the range in
//! which it was closed, and at last water reaches a probe at the lowest point. The board measures ([`Readings`]),
//! the parameters give the levels ([`super::SensorParameters`]), and [`assess`] says what is wrong. The supervisor
//! reports it. A leak stops the joint only if `leak_stops` is 1: a vehicle may need the joint to come home.
//!
//! The probe is two electrodes with a resistor across them, below a resistor to the converter's reference. Water
//! lowers the voltage. Without the probe the voltage is that of the reference, so a broken wire is found.
//!
//! Safe torque off (IEC 61800-5-2) removes the supply of the gate driver by two channels outside this firmware.
//! The firmware watches both, so that it reports the cause and does not arm. It is not part of the safety function.

use super::SensorParameters;
use super::bme280::Air;

/// Time after which the last humidity and pressure are too old, us: five measurements.
pub const AIR_TIMEOUT_US: u64 = 5_000_000;

/// Measurements of the dry side. `None` marks what this board cannot measure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readings {
    /// Voltage of the leak probe as a share of the converter's range.
    pub leak_share: Option<f32>,
    /// Air in the housing; NaN if the last measurement is too old.
    pub air: Option<Air>,
    /// Channels of safe torque off that allow torque.
    pub torque_allowed: Option<[bool; 2]>,
}

/// What is wrong with the dry side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// Water is at the probe, and the joint must stop.
    pub leak_stops: bool,
    /// Water is at the probe, and the joint may continue.
    pub leak_is_reported: bool,
    /// The humidity is above its limit.
    pub is_humid: bool,
    /// The housing pressure is outside its range.
    pub is_pressure_outside: bool,
    /// A connected sensor gives no valid value.
    pub is_sensor_invalid: bool,
    /// A channel of safe torque off does not allow torque.
    pub is_torque_off: bool,
    /// The two channels of safe torque off differ.
    pub do_channels_differ: bool,
}

/// Assesses the readings of all sensors that the parameters call connected.
pub fn assess(readings: &Readings, parameters: &SensorParameters) -> Findings {
    let mut found = Findings::default();
    if parameters.leak_connected != 0.0 {
        let share = readings.leak_share.unwrap_or(f32::NAN);
        let is_wet = share < parameters.leak_wet_share;
        found.is_sensor_invalid |= share.is_nan() || share >= parameters.leak_open_share;
        found.leak_stops = is_wet && parameters.leak_stops != 0.0;
        found.leak_is_reported = is_wet && parameters.leak_stops == 0.0;
    }
    if parameters.air_connected != 0.0 {
        let air = readings.air.unwrap_or(Air::INVALID);
        let range = parameters.housing_pressure_min_pa..=parameters.housing_pressure_max_pa;
        found.is_sensor_invalid |=
            !(air.humidity_percent.is_finite() && air.pressure_pa.is_finite());
        found.is_humid = air.humidity_percent >= parameters.humidity_max_percent;
        found.is_pressure_outside =
            air.pressure_pa.is_finite() && !range.contains(&air.pressure_pa);
    }
    if parameters.sto_connected != 0.0 {
        // A board without these inputs cannot be told to watch them and stay silent.
        let [first, second] = readings.torque_allowed.unwrap_or([false; 2]);
        found.is_torque_off = !(first && second);
        found.do_channels_differ = first != second;
    }
    found
}

/// Returns the pressure in the housing, Pa, from which the pressure difference at the seal counts: the measured one, or
/// `closed_pa` if none is measured or it is outside the range of the parameters. A sensor that is wrong must not move the
/// compensation.
#[inline(never)]
pub fn inside_pa(air: &Air, parameters: &SensorParameters, closed_pa: f32) -> f32 {
    let range = parameters.housing_pressure_min_pa..=parameters.housing_pressure_max_pa;
    let is_sound = parameters.air_connected != 0.0 && range.contains(&air.pressure_pa);
    if is_sound { air.pressure_pa } else { closed_pa }
}

/// Last measurement of the air, with its age.
#[derive(Clone, Copy, Debug)]
pub struct LastAir {
    air: Air,
    at_us: u64,
}

impl LastAir {
    /// Before the first measurement.
    pub const NONE: Self = Self { air: Air::INVALID, at_us: 0 };

    /// Stores a measurement.
    pub const fn set(&mut self, air: Air, now_us: u64) {
        *self = Self { air, at_us: now_us };
    }

    /// Returns the last measurement, or an invalid one if it is too old.
    pub const fn get(&self, now_us: u64) -> Air {
        if now_us.saturating_sub(self.at_us) > AIR_TIMEOUT_US { Air::INVALID } else { self.air }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRY: Air = Air { pressure_pa: 9.5e4, temperature_c: 20.0, humidity_percent: 12.0 };

    fn all_connected() -> SensorParameters {
        SensorParameters {
            leak_connected: 1.0,
            air_connected: 1.0,
            sto_connected: 1.0,
            ..SensorParameters::default()
        }
    }

    fn sound() -> Readings {
        Readings { leak_share: Some(0.9), air: Some(DRY), torque_allowed: Some([true; 2]) }
    }

    #[test]
    fn sensors_that_are_not_connected_are_not_assessed() {
        let wet = Readings { leak_share: Some(0.0), air: None, torque_allowed: Some([false; 2]) };
        assert_eq!(assess(&wet, &SensorParameters::default()), Findings::default());
        assert_eq!(assess(&sound(), &all_connected()), Findings::default());
    }

    #[test]
    fn every_fault_of_the_dry_side_has_its_finding() {
        let none = Findings::default();
        let air =
            |humidity_percent, pressure_pa| Some(Air { humidity_percent, pressure_pa, ..DRY });
        for (readings, expected) in [
            (Readings { leak_share: Some(0.3), ..sound() }, Findings { leak_stops: true, ..none }),
            (
                Readings { leak_share: Some(1.0), ..sound() },
                Findings { is_sensor_invalid: true, ..none },
            ),
            (
                Readings { leak_share: None, ..sound() },
                Findings { is_sensor_invalid: true, ..none },
            ),
            (Readings { air: air(61.0, 9.5e4), ..sound() }, Findings { is_humid: true, ..none }),
            (
                Readings { air: air(12.0, 3e5), ..sound() },
                Findings { is_pressure_outside: true, ..none },
            ),
            (
                Readings { air: Some(Air::INVALID), ..sound() },
                Findings { is_sensor_invalid: true, ..none },
            ),
            (
                Readings { torque_allowed: Some([false; 2]), ..sound() },
                Findings { is_torque_off: true, ..none },
            ),
            (
                Readings { torque_allowed: Some([true, false]), ..sound() },
                Findings { is_torque_off: true, do_channels_differ: true, ..none },
            ),
            (
                Readings { torque_allowed: None, ..sound() },
                Findings { is_torque_off: true, ..none },
            ),
        ] {
            assert_eq!(assess(&readings, &all_connected()), expected, "{readings:?}");
        }
        let continues = SensorParameters { leak_stops: 0.0, ..all_connected() };
        let wet = Readings { leak_share: Some(0.3), ..sound() };
        assert_eq!(assess(&wet, &continues), Findings { leak_is_reported: true, ..none });
    }

    #[test]
    fn inside_pressure_that_is_implausible_is_not_used() {
        let inside = |pressure_pa, parameters: &SensorParameters| {
            inside_pa(&Air { pressure_pa, ..DRY }, parameters, 101_325.0)
        };
        assert_eq!(inside(9.5e4, &all_connected()), 9.5e4);
        assert_eq!(inside(9.5e4, &SensorParameters::default()), 101_325.0);
        for wrong in [0.0, 5e5, f32::NAN] {
            assert_eq!(inside(wrong, &all_connected()), 101_325.0, "{wrong} Pa");
        }
    }

    #[test]
    fn air_is_invalid_before_the_first_measurement_and_five_seconds_after_the_last() {
        let mut last = LastAir::NONE;
        assert!(last.get(0).humidity_percent.is_nan());
        last.set(DRY, 1_000_000);
        assert_eq!(last.get(1_000_000 + AIR_TIMEOUT_US), DRY);
        assert!(last.get(1_000_001 + AIR_TIMEOUT_US).humidity_percent.is_nan());
    }
}
