//! The slow sensors: temperatures, side load, pressure.
//!
//! The encoder's timer starts their conversions in every period, away from the top of the PWM; see
//! `sensors::quiet` for the reason. Its channel 4 is the trigger: the rising edge, shortly after the top,
//! starts the temperatures, and the falling edge the side load. The background reads the last results and
//! waits for nothing. Pressure sensor and the sensor in the housing share a bus of their own. The leak probe is
//! converted with the phase currents ([`super::sampling`]).

use super::converters::{self, Trigger};
use super::pressure_bus::{PressureBus, PressureController};
use super::{pins, sampling, scales};
use embassy_stm32::adc::AdcChannel;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::pac::adc::vals::{Exten, SampleTime};
use embassy_stm32::peripherals::{ADC3, ADC4};
use embassy_stm32::{pac, rcc};
use firmware::sensors::bme280::Bme280;
use firmware::sensors::enclosure::{self, LastAir};
use firmware::sensors::ms5837::Ms5837;
use firmware::sensors::shunt::CONVERTER_RANGE_COUNTS;
use firmware::sensors::{LocalReadings, SensorParameters};

/// Sampling time, long enough for a divider of 10 k: 6 us.
const SAMPLING_TIME: SampleTime = SampleTime::CYCLES247_5;

/// Number of the encoder's timer among the triggers of converters 3 to 5: TIM3_TRGO.
const SLOW_TRIGGER: u8 = 12;

/// The slow sensors.
pub struct SlowSensors {
    pressure: Ms5837<PressureBus>,
    air: Bme280,
    last_air: LastAir,
    torque_allowed: [Input<'static>; 2],
    /// Constants of the sensors.
    pub constants: SensorParameters,
    /// Latest side load, pressure and temperature.
    last: LocalReadings,
}

impl SlowSensors {
    /// Sets up the converters and the sensor bus. The first conversions start with the timers.
    pub fn new(slow: pins::Slow, pressure: pins::Pressure, torque_off: pins::TorqueOff) -> Self {
        rcc::enable_and_reset::<ADC3>();
        rcc::enable_and_reset::<ADC4>();
        let bridge = slow.bridge_temperature.degrade_adc();
        let motor = slow.motor_temperature.degrade_adc();
        converters::start(
            slow.adc,
            pac::ADC3,
            pac::ADC345_COMMON,
            [(bridge, SAMPLING_TIME), (motor, SAMPLING_TIME)],
            Trigger { signal: SLOW_TRIGGER, edge: Exten::RISING_EDGE, interrupt: false },
        );
        converters::start(
            slow.force_adc,
            pac::ADC4,
            pac::ADC345_COMMON,
            [(slow.force.degrade_adc(), SAMPLING_TIME)],
            Trigger { signal: SLOW_TRIGGER, edge: Exten::FALLING_EDGE, interrupt: false },
        );
        let pressure = Ms5837::new(PressureController::bus(pressure));
        let torque_allowed =
            [Input::new(torque_off.first, Pull::Down), Input::new(torque_off.second, Pull::Down)];
        let (constants, last) = (SensorParameters::default(), LocalReadings::default());
        let (air, last_air) = (Bme280::new(), LastAir::NONE);
        Self { pressure, air, last_air, torque_allowed, constants, last }
    }

    /// Returns the temperatures of bridge and motor, deg C; NaN if a sensor is broken.
    pub fn temperatures_c(&mut self) -> [f32; 2] {
        let [bridge, motor] = converters::read_results(pac::ADC3);
        [
            self.constants.bridge_thermistor().temperature_c(share(bridge)),
            self.constants.motor_thermistor().temperature_c(share(motor)),
        ]
    }

    /// Reads side load and pressure and returns the latest readings.
    pub fn poll(&mut self, now_us: u64) -> LocalReadings {
        let local = &mut self.last;
        if let Some(gauge) = self.constants.strain_gauge() {
            let [counts] = converters::read_results(pac::ADC4);
            if let Some(force_n) = gauge.force_n(share(counts)) {
                local.set_radial_force(force_n, now_us);
            }
        }
        self.pressure.bus().step();
        // If the sensor fails, its last value ages and is reported as stale.
        if let Ok(Some(found)) = self.pressure.poll(now_us) {
            let air = self.last_air.get(now_us);
            let inside_pa = enclosure::inside_pa(&air, &self.constants, scales::INSIDE_PA);
            local.set_pressure_diff(found.pressure_pa - inside_pa, now_us);
            local.set_temperature(found.temperature_c, now_us);
        }
        *local
    }

    /// Reads the sensor in the housing, if one is connected, and returns the latest readings of the dry side.
    pub fn enclosure(&mut self, now_us: u64) -> enclosure::Readings {
        if self.constants.air_connected != 0.0
            && let Ok(Some(air)) = self.air.poll(self.pressure.bus(), now_us)
        {
            self.last_air.set(air, now_us);
        }
        enclosure::Readings {
            leak_share: Some(share(sampling::leak_counts())),
            air: Some(self.last_air.get(now_us)),
            torque_allowed: Some(self.torque_allowed.each_ref().map(Input::is_high)),
        }
    }
}

fn share(counts: u16) -> f32 {
    f32::from(counts) / f32::from(CONVERTER_RANGE_COUNTS)
}
