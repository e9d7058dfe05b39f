//! Time: microseconds since the start, and a wake-up every millisecond.
//!
//! A 32-bit counter in the FPGA registers counts microseconds after its divider. Reading it at least once
//! in 71 minutes extends it to 64 bits. SysTick only wakes the core.
#![allow(unsafe_code)] // Accesses two registers.

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};

const COUNTER: usize = 0x4002_8018;
const DIVIDER: usize = 0x4002_801C;
/// Frequency of core and counter, Hz.
const HZ: u32 = 25_000_000;

/// The running clock.
pub struct Clock {
    last: u32,
    now_us: u64,
}

impl Clock {
    /// Starts the clock and a wake-up every millisecond.
    pub fn start(mut timer: SYST) -> Self {
        write(DIVIDER, HZ / 1_000_000 - 1);
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(HZ / 1000 - 1);
        timer.clear_current();
        timer.enable_counter();
        // The interrupt only becomes pending, because interrupts stay masked.
        timer.enable_interrupt();
        Self { last: read(COUNTER), now_us: 0 }
    }

    /// Returns the time since the start, us.
    pub fn now_us(&mut self) -> u64 {
        let counter = read(COUNTER);
        self.now_us += u64::from(counter.wrapping_sub(self.last));
        self.last = counter;
        self.now_us
    }

    /// Sleeps until an interrupt is pending, at most a millisecond.
    pub fn sleep(&mut self) {
        cortex_m::asm::wfi();
        SCB::clear_pendst();
    }
}

/// Returns the time stamp for the log, us; undefined before the clock has started.
pub fn stamp_us() -> u32 {
    read(COUNTER)
}

fn read(register: usize) -> u32 {
    // SAFETY: a counter register of the FPGA; reading has no side effect.
    unsafe { (register as *const u32).read_volatile() }
}

fn write(register: usize, value: u32) {
    // SAFETY: the divider of the counter; only this module uses it.
    unsafe { (register as *mut u32).write_volatile(value) }
}
