//! The watchdog. It runs from the first instruction: a boot program or a recovery that hangs is reset.

use embassy_stm32::pac;
use embassy_stm32::pac::iwdg::vals::Key;

/// Divider of 256: the watchdog counts 125 times a second.
const DIVIDER: u32 = 6;
/// Time of the choice of an image, 8 s: three times that of a signature on the internal oscillator. Recovery refreshes it.
pub const CHOICE: u16 = 1000;
/// Time of the start of an image, 2 s. The image sets its own.
pub const IMAGE_START: u16 = 250;

/// Starts the watchdog, or restarts it with another time, in counts.
pub fn start(counts: u16) {
    // It pauses while a debugger halts the core.
    pac::DBGMCU.apb1lfzr().modify(|w| w.set_iwdg(true));
    pac::IWDG.kr().write(|w| w.set_key(Key::START));
    pac::IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    pac::IWDG.pr().write(|w| w.0 = DIVIDER);
    pac::IWDG.rlr().write(|w| w.set_rl(counts - 1));
    while pac::IWDG.sr().read().0 != 0 {}
    refresh();
}

/// Refreshes the watchdog.
pub fn refresh() {
    pac::IWDG.kr().write(|w| w.set_key(Key::RESET));
}

/// Refreshes the watchdog between two pages of the flash, as the driver of the flash requires.
pub fn refresh_if_loop_runs() {
    refresh();
}
