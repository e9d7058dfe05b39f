//! Clocks, why there was a reset, and who this board is.

use super::scales;
use embassy_stm32::pac::rcc::regs::Csr;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk,
    mux,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, pac};
use firmware::supervisor::ResetCause;

/// 170 MHz for all.
pub fn clocks() -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hsi = false;
    rcc.hse = Some(Hse { freq: Hertz(scales::CRYSTAL_HZ), mode: HseMode::Oscillator });
    rcc.pll = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV6,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    rcc.sys = Sysclk::PLL1_R;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    rcc.apb1_pre = APBPrescaler::DIV1;
    rcc.apb2_pre = APBPrescaler::DIV1;
    // The core's supply is lifted above 150 MHz.
    rcc.boost = true;
    rcc.mux.fdcansel = mux::Fdcansel::PCLK1;
    rcc.mux.adc12sel = mux::Adcsel::SYS;
    rcc.mux.adc345sel = mux::Adcsel::SYS;
    config
}

/// Why there was a reset; the flags are then cleared for the next.
pub fn reset_cause() -> ResetCause {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    cause(flags)
}

/// Every reset pulls the pin as well, so the pin says something only where nothing else does; loss of power is
/// a brown-out.
fn cause(flags: Csr) -> ResetCause {
    if flags.iwdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.borrstf() {
        ResetCause::PowerOn
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.pinrstf() {
        ResetCause::Pin
    } else {
        ResetCause::Unknown
    }
}

/// Highest brown-out level: the chip is held in reset below 2.8 V (option byte BOR_LEV), where flash and converters
/// are still within their data sheet. As delivered it is the lowest, 1.7 V.
const BROWN_OUT_LEVEL: u8 = 4;

/// Says where the option bytes hold another brown-out level than docs/bring-up.md has set.
pub fn tell_brown_out_level() {
    let level = pac::FLASH.optr().read().bor_lev();
    if level != BROWN_OUT_LEVEL {
        defmt::warn!(
            "brown-out level {=u8}, meant is {=u8}: see docs/bring-up.md",
            level,
            BROWN_OUT_LEVEL
        );
    }
}

/// A number of this very chip: its 96-bit identity, folded by a CRC.
pub fn serial() -> u32 {
    crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC).checksum(&embassy_stm32::uid::uid())
}
