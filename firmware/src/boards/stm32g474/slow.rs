//! The slow sensors: temperatures, side load, pressure.
//!
//! Each is converted twice, away from the top of the PWM; see `sensors::quiet` for the reason.

use super::power_stage::since_top;
use super::pressure_bus::PressureBus;
use super::{pins, scales};
use embassy_stm32::Peri;
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_stm32::peripherals::{ADC3, ADC4, PB0, PB1, PB12};
use firmware::sensors::ms5837::Ms5837;
use firmware::sensors::quiet::convert_twice;
use firmware::sensors::shunt::CONVERTER_RANGE_COUNTS;
use firmware::sensors::{LocalReadings, SensorParameters};

/// Sampling time, long enough for a divider of 10 k: 6 us.
const SAMPLING_TIME: SampleTime = SampleTime::CYCLES247_5;

/// The slow sensors.
pub struct SlowSensors {
    temperatures: Adc<'static, ADC3>,
    bridge: Peri<'static, PB0>,
    motor: Peri<'static, PB1>,
    forces: Adc<'static, ADC4>,
    force: Peri<'static, PB12>,
    pressure: Ms5837<PressureBus>,
    /// Constants of the sensors.
    pub constants: SensorParameters,
    /// Latest side load, pressure and temperature.
    last: LocalReadings,
}

impl SlowSensors {
    /// Sets up the converters and the sensor bus.
    pub fn new(slow: pins::Slow, pressure: pins::Pressure) -> Self {
        Self {
            temperatures: Adc::new(slow.adc, Default::default()),
            bridge: slow.bridge_temperature,
            motor: slow.motor_temperature,
            forces: Adc::new(slow.force_adc, Default::default()),
            force: slow.force,
            pressure: Ms5837::new(PressureBus::new(pressure)),
            constants: SensorParameters::default(),
            last: LocalReadings::default(),
        }
    }

    /// Returns the temperatures of bridge and motor, deg C; NaN if a sensor is broken.
    pub fn temperatures_c(&mut self) -> [f32; 2] {
        let bridge = share(convert_twice(wait_for_quiet, || {
            self.temperatures.blocking_read(&mut self.bridge, SAMPLING_TIME)
        }));
        let motor = share(convert_twice(wait_for_quiet, || {
            self.temperatures.blocking_read(&mut self.motor, SAMPLING_TIME)
        }));
        [
            self.constants.bridge_thermistor().temperature_c(bridge),
            self.constants.motor_thermistor().temperature_c(motor),
        ]
    }

    /// Reads side load and pressure and returns the latest readings.
    pub fn poll(&mut self, now_us: u64) -> LocalReadings {
        let local = &mut self.last;
        if let Some(gauge) = self.constants.strain_gauge() {
            let at = share(convert_twice(wait_for_quiet, || {
                self.forces.blocking_read(&mut self.force, SAMPLING_TIME)
            }));
            if let Some(force_n) = gauge.force_n(at) {
                local.set_radial_force(force_n, now_us);
            }
        }
        // If the sensor fails, its last value ages and is reported as stale.
        if let Ok(Some(found)) = self.pressure.poll(now_us) {
            local.set_pressure_diff(found.pressure_pa - scales::INSIDE_PA, now_us);
            local.set_temperature(found.temperature_c, now_us);
        }
        *local
    }
}

/// Waits for the quiet part of the period. It takes less than one period, because the timer keeps running.
fn wait_for_quiet() {
    while !scales::QUIET.contains(since_top()) {}
}

fn share(counts: u16) -> f32 {
    f32::from(counts) / f32::from(CONVERTER_RANGE_COUNTS)
}
