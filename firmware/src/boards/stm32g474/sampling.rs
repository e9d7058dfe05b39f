//! The conversions at the top of the PWM: phase currents, bus and leak probe.

use super::{converters, pins};
use embassy_stm32::adc::AdcChannel;
use embassy_stm32::pac;

/// Converter of the bus voltage, behind a phase.
pub const BUS_CONVERTER: pac::adc::Adc = pac::ADC1;

/// Sets up both converters.
pub fn start(currents: pins::Currents) {
    // The leak probe is converted beside the bus, so its conversion disturbs no other one.
    converters::start_at_top(
        (currents.adc_a, [currents.phase_a.degrade_adc(), currents.bus.degrade_adc()]),
        (currents.adc_b, [currents.phase_b.degrade_adc(), currents.leak.degrade_adc()]),
    );
}

/// Returns the latest counts of the leak probe.
pub fn leak_counts() -> u16 {
    pac::ADC2.jdr(1).read().jdata()
}
