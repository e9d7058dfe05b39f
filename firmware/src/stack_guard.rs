//! Guard words below the stack, which detect an overflow.
//!
//! The stack grows down from the end of RAM towards the statics, and nothing stops it from overwriting
//! them. The last words before the statics therefore hold a known pattern; if it changes, the stack has
//! reached them. A change while running is a fault. A change in the previous run is detected at the next
//! start if RAM kept its content, which a marker word that survives a reset shows.

#![allow(unsafe_code)] // Words between statics and stack, which no reference covers.

use core::mem::MaybeUninit;
use core::ptr;

/// Number of guard words: more than the gap in a small frame, so that a call cannot skip them.
const GUARD_WORDS: usize = 16;
const GUARD_PATTERN: u32 = 0x5AFE_57AC;
const GUARD_WRITTEN: u32 = u32::from_le_bytes(*b"WALL");

/// Marks that the guard was written in this run or, at the start, in the previous one.
#[unsafe(link_section = ".uninit.stack_guard")]
static mut MARK: MaybeUninit<u32> = MaybeUninit::uninit();

unsafe extern "C" {
    /// End of the statics and limit of the stack; from cortex-m-rt's linker script.
    static mut _stack_end: u32;
}

fn mark() -> *mut u32 {
    (&raw mut MARK).cast()
}

fn words() -> impl Iterator<Item = *mut u32> {
    let first = &raw mut _stack_end;
    (0..GUARD_WORDS).map(move |place| first.wrapping_add(place))
}

/// Returns true if RAM kept its contents since the previous run. Call it before [`paint`].
pub fn is_ram_kept() -> bool {
    // SAFETY: a word of RAM that no other code uses; any content is valid.
    unsafe { ptr::read_volatile(mark()) == GUARD_WRITTEN }
}

/// Returns true if the stack overran the guard in the previous run. Call it before [`paint`]. After a loss
/// of power the result is false.
pub fn take_overflow() -> bool {
    is_ram_kept() && !is_intact()
}

/// Writes the guard words.
pub fn paint() {
    for word in words() {
        // SAFETY: RAM behind the statics and, this early, far below the stack.
        unsafe { ptr::write_volatile(word, GUARD_PATTERN) };
    }
    // SAFETY: see above.
    unsafe { ptr::write_volatile(mark(), GUARD_WRITTEN) };
}

/// Returns true if the guard words are unchanged.
pub fn is_intact() -> bool {
    // SAFETY: RAM behind the statics, whose content may be anything.
    words().all(|word| unsafe { ptr::read_volatile(word) } == GUARD_PATTERN)
}
