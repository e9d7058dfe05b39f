//! The hand-over to an image.

use embassy_stm32::pac;
use embassy_stm32::pac::iwdg::vals::Key;

/// Divider and reload of the watchdog during the start of an image: 256 / 32 kHz x 250 = 2 s. The image sets its own.
const WATCHDOG_DIVIDER: u32 = 6;
const WATCHDOG_RELOAD: u16 = 249;

/// Starts the watchdog, and the image with this vector table.
pub fn image(vectors: u32) -> ! {
    pac::IWDG.kr().write(|w| w.set_key(Key::START));
    pac::IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    pac::IWDG.pr().write(|w| w.0 = WATCHDOG_DIVIDER);
    pac::IWDG.rlr().write(|w| w.set_rl(WATCHDOG_RELOAD));
    while pac::IWDG.sr().read().0 != 0 {}
    pac::IWDG.kr().write(|w| w.set_key(Key::RESET));
    // SAFETY: the boot program has enabled no interrupt and uses no peripheral any more; the vector table was checked.
    unsafe {
        (*cortex_m::peripheral::SCB::PTR).vtor.write(vectors);
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        cortex_m::asm::bootload(vectors as *const u32)
    }
}
