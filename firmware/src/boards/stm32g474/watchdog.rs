//! The independent watchdog: fed only while both the current loop and the background are alive.
//!
//! It runs on an oscillator of its own and cannot be stopped. The background feeds it, which shows that
//! the background lives; and only where the loop has counted periods since, which shows that one. A reset
//! opens the bridge.

use super::scales;
use core::sync::atomic::{AtomicU32, Ordering};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, pac, peripherals};

/// Periods of the loop.
static BEATS: AtomicU32 = AtomicU32::new(0);
/// Periods at the last feed.
static SEEN: AtomicU32 = AtomicU32::new(0);

/// The loop lives.
#[inline]
pub fn beat() {
    // A load and a store: nobody else writes it, and it must not cost a loop of exclusives.
    BEATS.store(BEATS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}

/// Starts it. In a debugger's halt it stands still.
pub fn start(watchdog: Peri<'static, peripherals::IWDG>) {
    pac::DBGMCU.apb1lfzr().modify(|w| w.set_iwdg(true));
    IndependentWatchdog::new(watchdog, scales::WATCHDOG_US).unleash();
}

/// The background lives; feeds where the loop does, too.
pub fn feed() {
    let beats = BEATS.load(Ordering::Relaxed);
    if beats != SEEN.load(Ordering::Relaxed) {
        SEEN.store(beats, Ordering::Relaxed);
        pac::IWDG.kr().write(|w| w.set_key(pac::iwdg::vals::Key::RESET));
    }
}
