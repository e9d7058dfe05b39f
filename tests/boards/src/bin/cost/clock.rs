//! Counts the instructions of one function call exactly, with a clock that ticks every 40 instructions.
//!
//! QEMU with `-icount shift=0` advances one nanosecond per instruction, and the SysTick of mps2-an386 runs
//! at 25 MHz: one tick is 40 instructions. A call of `n` instructions that begins `p` instructions after a
//! tick sees `floor((p + n) / 40)` ticks. Summed over 40 starts one instruction apart, this is `n`
//! *exactly* (Hermite's identity), whatever the first start was. A call is therefore repeated from the same
//! state with 40 delays, each 3 instructions longer than the previous one: 3 and 40 share no divisor, so
//! all forty starts occur.
//!
//! Writing the counter restarts its tick, which makes the starts repeatable. Everything between the two
//! readings is in one assembly block, so only the function is counted: from its first instruction to its
//! return, including the return but not the `blx` that calls it. [`Clock::start`] checks this with
//! functions of known length and panics on a mismatch.
//!
//! Instructions are not cycles: a `vdiv.f32` counts 1 here and takes 14 cycles on the chip. Instruction
//! counts are what an emulator can provide; they are the same on every machine and in every run.
#![allow(unsafe_code)] // The block that times a call, and the reference functions, are assembly.

use core::arch::global_asm;
use cortex_m::peripheral::{SYST, syst::SystClkSource};

/// Instructions per tick.
const INSTRUCTIONS_PER_TICK: u32 = 40;

/// Register values for the call: three words or pointers, and one `f32`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Arguments {
    pub words: [usize; 3],
    pub float: f32,
}

/// A running SysTick.
pub struct Clock {
    counter: *mut u32,
    /// Instructions between the readings that do not belong to the function.
    overhead: u32,
}

impl Clock {
    /// Starts the counter and checks it against functions of known length.
    pub fn start(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(0x00FF_FFFF);
        timer.clear_current();
        timer.enable_counter();
        let mut clock =
            Self { counter: core::ptr::from_ref(&timer.cvr).cast_mut().cast(), overhead: 0 };
        let no_arguments = Arguments { words: [0; 3], float: 0.0 };
        clock.overhead = clock.count(yardstick_1 as *const (), || no_arguments) - 1;
        let yardsticks = [(yardstick_8 as *const (), 8), (yardstick_100 as *const (), 100)];
        for (function, length) in yardsticks {
            let counted = clock.count(function, || no_arguments);
            assert!(counted == length, "a function of {length} instructions counts {counted}");
        }
        clock
    }

    /// Returns the instructions of one call of `function`. It is called 40 times; `prepare` restores its
    /// state before each call.
    pub fn count(&mut self, function: *const (), mut prepare: impl FnMut() -> Arguments) -> u32 {
        let ticks = |delay| {
            // SAFETY: `counter` is the current-value register of SysTick, owned by the clock; `function`
            // belongs to this binary and has these arguments.
            unsafe { timed_call(&prepare(), self.counter, function, delay) }
        };
        (1..=INSTRUCTIONS_PER_TICK).map(ticks).sum::<u32>() - self.overhead
    }
}

// `timed_call` restarts the tick, waits 3 instructions per unit of delay, and returns the ticks between the
// readings before and after the call. Reference functions of 1, 8 and 100 instructions follow.
global_asm!(
    ".fpu fpv4-sp-d16",
    ".thumb_func",
    "timed_call:",
    "push {{r4-r6, lr}}",
    "mov r4, r1",
    "mov r5, r3",
    "mov r6, r2",
    "vldr s0, [r0, #12]",
    "ldr r2, [r0, #8]",
    "ldr r1, [r0, #4]",
    "ldr r0, [r0]",
    "str r5, [r4]",
    "1: nop",
    "subs r5, r5, #1",
    "bne 1b",
    "ldr r5, [r4]",
    "blx r6",
    "ldr r0, [r4]",
    "subs r0, r5, r0",
    "ubfx r0, r0, #0, #24",
    "pop {{r4-r6, pc}}",
    ".thumb_func",
    "yardstick_1: bx lr",
    ".thumb_func",
    "yardstick_8: .rept 7",
    "nop",
    ".endr",
    "bx lr",
    ".thumb_func",
    "yardstick_100: .rept 99",
    "nop",
    ".endr",
    "bx lr",
);

unsafe extern "C" {
    fn timed_call(
        arguments: *const Arguments,
        counter: *mut u32,
        function: *const (),
        delay: u32,
    ) -> u32;
    fn yardstick_1();
    fn yardstick_8();
    fn yardstick_100();
}
