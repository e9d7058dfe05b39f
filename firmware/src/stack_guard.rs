//! Words painted below the stack, to see that it never came so far.
//!
//! The stack grows down from the end of RAM towards the statics. Nothing stops it there by itself: it
//! would write over them. So the last words before them are painted, and whoever finds the paint gone
//! knows that the stack was there. What is seen while it runs is a fault; that paint from the last life is gone
//! is seen at the next start, if RAM kept its content: a word among those that outlive a reset says so.

#![allow(unsafe_code)] // Words between statics and stack, which no reference covers.

use core::mem::MaybeUninit;
use core::ptr;

/// Painted words: more than a small frame's gap, so that a call does not step over them unseen.
const WORDS: usize = 16;
const PAINT: u32 = 0x5AFE_57AC;
const PAINTED: u32 = u32::from_le_bytes(*b"WALL");

/// Whether the guard was painted in this life or, at the start, in the last.
#[unsafe(link_section = ".uninit.stack_guard")]
static mut MARK: MaybeUninit<u32> = MaybeUninit::uninit();

unsafe extern "C" {
    /// End of the statics, start of what the stack may use; from cortex-m-rt's linker script.
    static mut _stack_end: u32;
}

fn mark() -> *mut u32 {
    (&raw mut MARK).cast()
}

fn words() -> impl Iterator<Item = *mut u32> {
    let first = &raw mut _stack_end;
    (0..WORDS).map(move |place| first.wrapping_add(place))
}

/// Whether the stack of the last life overran its guard. Ask before [`paint`]; after a loss of power
/// the answer is no.
pub fn take_overflow() -> bool {
    // SAFETY: a word of RAM nobody else uses; chance is a legal content.
    let painted = unsafe { ptr::read_volatile(mark()) } == PAINTED;
    painted && !is_intact()
}

/// Paints the guard.
pub fn paint() {
    for word in words() {
        // SAFETY: RAM behind the statics and, so early, far below the stack.
        unsafe { ptr::write_volatile(word, PAINT) };
    }
    // SAFETY: as above.
    unsafe { ptr::write_volatile(mark(), PAINTED) };
}

/// Whether the paint is whole.
pub fn is_intact() -> bool {
    // SAFETY: RAM behind the statics; whatever is there may be read.
    words().all(|word| unsafe { ptr::read_volatile(word) } == PAINT)
}
