//! What a panic does: nothing in the core can, so it is always a mistake of the firmware's own.
//!
//! On a board: its text is kept in RAM that no start clears ([`crate::panic_note`]) and the processor is
//! reset. A reset opens the bridge by hardware at once, and the next start reports the text on the bus. In
//! the emulator's measurement it is printed, and the emulator ends with exit code 1, so that a test fails.
//! Which of these is said by each binary's `#[panic_handler]`.

#![allow(unsafe_code)] // One static that outlives a reset, confined to `place`.

use crate::panic_note::{Note, PANIC_TEXT};
use core::fmt::Display;
use core::mem::MaybeUninit;
use heapless::String;

/// Kept over a reset: start-up code neither clears nor fills this section.
#[unsafe(link_section = ".uninit.panic_note")]
static mut KEPT: MaybeUninit<Note> = MaybeUninit::uninit();

/// The place the note is kept in.
///
/// # Safety
/// Nobody else may hold it: only [`take`], before interrupts are on, and a panic, after they are off.
unsafe fn place() -> &'static mut Note {
    // SAFETY: the caller is alone. A note is words alone, and every pattern of them is legal; after power
    // came they are chance, which the note's own check finds.
    unsafe { &mut *(&raw mut KEPT).cast() }
}

/// Keeps the text and resets the processor.
pub fn keep_and_reset(what: &dyn Display) -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: interrupts are off for good, and `take` has returned or never will.
    let note = unsafe { place() };
    note.write(what);
    cortex_m::asm::dsb();
    cortex_m::peripheral::SCB::sys_reset()
}

/// The text the last life ended with, if it ended so; asked once, early at the start.
pub fn take() -> Option<String<PANIC_TEXT>> {
    cortex_m::interrupt::free(|_| {
        // SAFETY: interrupts are off, and a panic in here does not come back.
        let note = unsafe { place() };
        note.take()
    })
}

/// Prints the text in the emulator and ends it with exit code 1.
#[cfg(feature = "board-qemu")]
pub fn print_and_exit(what: &dyn Display) -> ! {
    use cortex_m_semihosting::{debug, hprintln};
    hprintln!("{}", what);
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
