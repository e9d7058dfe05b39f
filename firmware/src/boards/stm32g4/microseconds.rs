//! The time since the start, in microseconds: a 32-bit timer, which every reading extends to 64 bits.
//!
//! No interrupt counts the overflows, so none delays the current loop. The timer takes 71 minutes to wrap; the background reads
//! it every millisecond. Its upper half is compared with a count of halves, as a driver of embassy's time does.

use super::scales::{CORE_HZ, TIME_COUNTER as TIMER, TimePeripheral};
use core::sync::atomic::{AtomicU32, Ordering};
use embassy_stm32::rcc;

/// Halves of the timer's range that have passed, 2^31 us each.
static HALVES: AtomicU32 = AtomicU32::new(0);

/// Starts the timer at 0.
pub fn start() {
    rcc::enable_and_reset::<TimePeripheral>();
    TIMER.psc().write_value((CORE_HZ / 1_000_000 - 1) as u16);
    // The prescaler takes effect with an update.
    TIMER.egr().write(|w| w.set_ug(true));
    TIMER.cr1().write(|w| w.set_cen(true));
}

/// Returns the time since the start, us; 0 before it. An interrupt may call it, as it stores what the interrupted call stores.
// Not inlined: it takes 50 bytes.
#[inline(never)]
pub fn now_us() -> u64 {
    let halves = HALVES.load(Ordering::Relaxed);
    let count = TIMER.cnt().read();
    // The lowest bit of the halves is the highest of the count, until a half has passed.
    let halves = halves.wrapping_add((count >> 31) ^ (halves & 1));
    HALVES.store(halves, Ordering::Relaxed);
    u64::from(halves) << 31 | u64::from(count & (u32::MAX >> 1))
}
