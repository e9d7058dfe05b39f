//! Time: microseconds since the start, and a wake-up every millisecond.
//!
//! The counter of the FPGA's own registers counts microseconds behind its divider, in 32 bits; 71 minutes are
//! made into more by looking at least once in them. SysTick only wakes: what is late is read, not counted.
#![allow(unsafe_code)] // Two registers.

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};

const COUNTER: usize = 0x4002_8018;
const DIVIDER: usize = 0x4002_801C;
/// Both clocks: the core's and the counter's.
const HZ: u32 = 25_000_000;

/// The running clock.
pub struct Clock {
    last: u32,
    now_us: u64,
}

impl Clock {
    /// Starts it, and waking every millisecond.
    pub fn start(mut timer: SYST) -> Self {
        write(DIVIDER, HZ / 1_000_000 - 1);
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(HZ / 1000 - 1);
        timer.clear_current();
        timer.enable_counter();
        // Only to be pending: interrupts are masked for good.
        timer.enable_interrupt();
        Self { last: read(COUNTER), now_us: 0 }
    }

    /// Time since the start, us.
    pub fn now_us(&mut self) -> u64 {
        let counter = read(COUNTER);
        self.now_us += u64::from(counter.wrapping_sub(self.last));
        self.last = counter;
        self.now_us
    }

    /// Sleeps until something is pending: a millisecond at most.
    pub fn sleep(&mut self) {
        cortex_m::asm::wfi();
        SCB::clear_pendst();
    }
}

/// Time for the log, us: before the clock has started, nothing that makes sense.
pub fn stamp_us() -> u32 {
    read(COUNTER)
}

fn read(register: usize) -> u32 {
    // SAFETY: a register of the FPGA's that counts; reading changes nothing.
    unsafe { (register as *const u32).read_volatile() }
}

fn write(register: usize, value: u32) {
    // SAFETY: the counter's divider; this module alone uses it.
    unsafe { (register as *mut u32).write_volatile(value) }
}
