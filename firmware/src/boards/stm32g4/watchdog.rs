//! The independent watchdog: it is refreshed only while both the current loop and the background run.
//!
//! It has its own oscillator and cannot be stopped. The background refreshes it, but only if the loop has
//! counted periods since the last time. When it expires, the processor is reset, which opens the bridge.

use super::scales;
use core::sync::atomic::{AtomicU32, Ordering};
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::{Peri, pac, peripherals};

/// Number of loop periods.
static LOOP_PERIODS: AtomicU32 = AtomicU32::new(0);
/// Number of loop periods at the last refresh.
static PERIODS_AT_REFRESH: AtomicU32 = AtomicU32::new(0);

/// Counts a period of the loop.
#[inline]
pub fn count_period() {
    // A separate load and store: there is no other writer, and an exclusive access would need a loop.
    LOOP_PERIODS.store(LOOP_PERIODS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}

/// Divider of 16: the watchdog counts every 500 us.
const DIVIDER: u32 = 2;
const COUNTS: u16 = (scales::WATCHDOG_US / 500) as u16;

/// Starts the watchdog. It pauses while a debugger halts the core.
pub fn start(_watchdog: Peri<'static, peripherals::IWDG>) {
    pac::DBGMCU.apb1lfzr().modify(|w| w.set_iwdg(true));
    pac::IWDG.kr().write(|w| w.set_key(Key::START));
    pac::IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    pac::IWDG.pr().write(|w| w.0 = DIVIDER);
    pac::IWDG.rlr().write(|w| w.set_rl(COUNTS - 1));
    while pac::IWDG.sr().read().0 != 0 {}
    pac::IWDG.kr().write(|w| w.set_key(Key::RESET));
}

/// Refreshes the watchdog if the loop has counted a period since the last call, or has not begun: the start may copy a
/// parameter set. The background calls it.
pub fn refresh_if_loop_runs() {
    let periods = LOOP_PERIODS.load(Ordering::Relaxed);
    if periods == 0 || periods != PERIODS_AT_REFRESH.load(Ordering::Relaxed) {
        PERIODS_AT_REFRESH.store(periods, Ordering::Relaxed);
        pac::IWDG.kr().write(|w| w.set_key(pac::iwdg::vals::Key::RESET));
    }
}
