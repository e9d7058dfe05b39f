//! The amplifiers of the shunts, and the conversions at the top of the PWM: two phase currents, bus and temperature.
//!
//! The current of the third phase is that of the two others, with the opposite sign.

use super::{converters, pins};
use embassy_stm32::adc::AdcChannel;
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac;
use embassy_stm32::pac::opamp::{Opamp, vals};
use firmware::sensors::shunt::CONVERTER_RANGE_COUNTS;

/// Converter of the bus voltage, behind a phase.
pub const BUS_CONVERTER: pac::adc::Adc = pac::ADC2;

/// Gain 16 with the inverting pin as bias, in the field of the gain (RM0440, OPAMP_CSR PGA_GAIN).
const GAIN_16_WITH_BIAS: u8 = 0b01011;

/// Sets up amplifiers and converters.
pub fn start(currents: pins::Currents) {
    // Analog inputs: the state after a reset, which must stay, so the pins are never released.
    for mut pin in [
        Flex::new(currents.shunt_a),
        Flex::new(currents.return_a),
        Flex::new(currents.shunt_b),
        Flex::new(currents.return_b),
    ] {
        pin.set_as_analog();
        core::mem::forget(pin);
    }
    start_amplifier(pac::OPAMP1);
    start_amplifier(pac::OPAMP2);
    converters::start_at_top(
        (currents.adc_a, [currents.phase_a.degrade_adc(), currents.temperature.degrade_adc()]),
        (currents.adc_b, [currents.phase_b.degrade_adc(), currents.bus.degrade_adc()]),
    );
}

fn start_amplifier(amplifier: Opamp) {
    amplifier.csr().write(|w| {
        w.set_vp_sel(vals::VpSel::VINP0);
        w.set_vm_sel(vals::VmSel::PGA);
        w.set_pga_gain(vals::PgaGain::from_bits(GAIN_16_WITH_BIAS));
        w.set_opahsm(true);
    });
    amplifier.csr().modify(|w| w.set_opampen(true));
}

/// Returns the voltage of the bridge's thermistor as a share of the converter's range. The thermistor is above its resistor.
pub fn thermistor_share() -> f32 {
    let [_, counts] = converters::read_results(pac::ADC1);
    1.0 - f32::from(counts) / f32::from(CONVERTER_RANGE_COUNTS)
}
