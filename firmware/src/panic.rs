//! Handling of a panic. The core cannot panic, so a panic is always a firmware error.
//!
//! On a board the text is stored in RAM that start-up code does not clear ([`crate::panic_note`]) and the
//! processor is reset. The reset opens the bridge in hardware at once, and the next start reports the text
//! on the bus.

#![allow(unsafe_code)] // One static that survives a reset, accessed only through `place`.

use crate::panic_note::{MAX_PANIC_TEXT_BYTES, PanicNote, Part};
use core::mem::MaybeUninit;
use core::panic::Location;
use heapless::String;

/// Survives a reset: start-up code neither clears nor initialises this section.
#[unsafe(link_section = ".uninit.panic_note")]
static mut KEPT: MaybeUninit<PanicNote> = MaybeUninit::uninit();

/// Returns the stored note.
///
/// # Safety
/// No other reference may exist: only [`take`], before interrupts are enabled, and a panic, after they are
/// disabled, may call it.
unsafe fn note_storage() -> &'static mut PanicNote {
    // SAFETY: the caller holds the only reference. A note consists of words, and every bit pattern is
    // valid. After power-up they are random, which the note's check detects.
    unsafe { &mut *(&raw mut KEPT).cast() }
}

/// Stores the text and resets the processor.
pub fn record_and_reset(what: &[Part]) -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: interrupts stay disabled, and `take` has returned or never will.
    let note = unsafe { note_storage() };
    note.write(what);
    cortex_m::asm::dsb();
    cortex_m::peripheral::SCB::sys_reset()
}

/// Stores the place of a panic and resets the processor. The source line identifies the cause. It takes the place alone: with
/// the message, which is not stored, an image is 29 kB larger.
// Not inlined, so that the handler is small, is inlined itself, and the compiler sees that no message is read.
#[inline(never)]
pub fn record_place_and_reset(place: Option<&Location>) -> ! {
    let colon = Part::Text(":");
    match place {
        Some(at) => record_and_reset(&[
            Part::Text("panicked at "),
            Part::Text(at.file()),
            colon,
            Part::Decimal(at.line()),
            colon,
            Part::Decimal(at.column()),
        ]),
        None => record_and_reset(&[Part::Text("panicked")]),
    }
}

/// Returns the panic text of the previous run, if there is one. Call it once, early at the start.
pub fn take() -> Option<String<MAX_PANIC_TEXT_BYTES>> {
    cortex_m::interrupt::free(|_| {
        // SAFETY: interrupts are disabled, and a panic in here does not return.
        let note = unsafe { note_storage() };
        note.take()
    })
}
