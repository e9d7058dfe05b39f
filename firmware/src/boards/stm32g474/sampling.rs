//! The conversions at the top of the PWM: phase currents, bus and leak probe.

use super::converters::{self, TOP_TRIGGER, Trigger};
use super::pins;
use embassy_stm32::adc::AdcChannel;
use embassy_stm32::pac::adc::vals::{Exten, SampleTime};
use embassy_stm32::peripherals::{ADC1, ADC2};
use embassy_stm32::{pac, rcc};

/// Converter of the bus voltage, behind a phase.
pub const BUS_CONVERTER: pac::adc::Adc = pac::ADC1;

/// Sets up both converters. At 42.5 MHz a current is sampled for 0.3 us. The slower bus divider follows it.
pub fn start(currents: pins::Currents) {
    rcc::enable_and_reset::<ADC1>();
    rcc::enable_and_reset::<ADC2>();
    converters::start(
        currents.adc_a,
        pac::ADC1,
        pac::ADC12_COMMON,
        [
            (currents.phase_a.degrade_adc(), SampleTime::CYCLES12_5),
            (currents.bus.degrade_adc(), SampleTime::CYCLES24_5),
        ],
        Trigger { signal: TOP_TRIGGER, edge: Exten::RISING_EDGE, interrupt: true },
    );
    converters::start(
        currents.adc_b,
        pac::ADC2,
        pac::ADC12_COMMON,
        // The leak probe is converted beside the bus, so its conversion disturbs no other one.
        [
            (currents.phase_b.degrade_adc(), SampleTime::CYCLES12_5),
            (currents.leak.degrade_adc(), SampleTime::CYCLES24_5),
        ],
        Trigger { signal: TOP_TRIGGER, edge: Exten::RISING_EDGE, interrupt: false },
    );
}

/// Returns the latest counts of the leak probe.
pub fn leak_counts() -> u16 {
    pac::ADC2.jdr(1).read().jdata()
}
