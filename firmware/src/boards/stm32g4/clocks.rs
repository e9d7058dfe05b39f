//! Clocks and serial number, as the driver and the boot program use them.

use embassy_stm32::Config;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk,
    mux,
};
use embassy_stm32::time::Hertz;

/// Crystal of a board. CAN at 1 Mbit/s requires one; the internal oscillator is not accurate enough.
pub struct Crystal {
    /// Frequency, Hz.
    pub hz: u32,
    /// Divider to 4 MHz.
    pub divider: PllPreDiv,
}

/// Processor, timers and converter clock source, Hz: 4 MHz x 85 / 2.
pub const CORE_HZ: u32 = 170_000_000;

/// Returns the clock configuration: 170 MHz for core and buses.
pub fn clocks(crystal: Crystal) -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hsi = false;
    rcc.hse = Some(Hse { freq: Hertz(crystal.hz), mode: HseMode::Oscillator });
    rcc.pll = Some(Pll {
        source: PllSource::HSE,
        prediv: crystal.divider,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    rcc.sys = Sysclk::PLL1_R;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    rcc.apb1_pre = APBPrescaler::DIV1;
    rcc.apb2_pre = APBPrescaler::DIV1;
    // The core voltage must be boosted above 150 MHz.
    rcc.boost = true;
    rcc.mux.fdcansel = mux::Fdcansel::PCLK1;
    rcc.mux.adc12sel = mux::Adcsel::SYS;
    config
}

/// Returns a serial number: the CRC of the chip's 96-bit unique ID.
pub fn serial() -> u32 {
    compensator_core::crc32::crc32(&embassy_stm32::uid::uid())
}
