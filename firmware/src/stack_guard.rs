//! The guard below the stack: a region that the memory protection closes, and words that detect a jump over it.
//!
//! The stack grows down from the end of RAM towards the statics. The memory protection unit refuses every access to a
//! region between the two. A stack that reaches it raises a hard fault, before a static changes; the handler of the board
//! calls [`record_overflow`] and resets. A frame that is larger than the region may skip it. The words below the region
//! therefore hold a known pattern; if it changes while running, that is a fault. Both are detected at the next start if RAM
//! kept its content, which a marker word that survives a reset shows.

#![allow(unsafe_code)] // Words between statics and stack, which no reference covers, and the registers of the protection.

use core::mem::MaybeUninit;
use core::ptr;
use cortex_m::peripheral::{MPU, SCB};

/// Number of guard words: more than the gap in a small frame.
const GUARD_WORDS: usize = 16;
const GUARD_PATTERN: u32 = 0x5AFE_57AC;
const GUARD_WRITTEN: u32 = u32::from_le_bytes(*b"WALL");

/// Length of the closed region, bytes: a power of two, to which it is aligned.
const REGION_BYTES: u32 = 512;
/// Registers of the memory protection unit (ARMv7-M, B3.5): region 0 with an address, its attributes, and its use. A region
/// has `2^(SIZE + 1)` bytes. No access, no execution, shareable normal memory.
const REGION_VALID: u32 = 1 << 4;
const NEVER_EXECUTED: u32 = 1 << 28;
const SHARED_NORMAL: u32 = 0b110 << 16;
const SIZE: u32 = (REGION_BYTES.trailing_zeros() - 1) << 1;
const REGION_ENABLED: u32 = 1;
/// Everything else is accessed as without the unit. It does not act in the handler of the hard fault.
const PROTECTED: u32 = 1 | 1 << 2;
/// Status bits of a data access, and of the access of an exception to the stack, that the unit refused.
const REFUSED_ACCESS: u32 = 0b11_1010;

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

/// Returns true if the stack reached the guard in the previous run. Call it before [`paint`]. After a loss
/// of power the result is false.
pub fn take_overflow() -> bool {
    is_ram_kept() && !is_intact()
}

/// Writes the guard words and closes the region above them.
pub fn paint() {
    fill(GUARD_PATTERN);
    // SAFETY: see `is_ram_kept`.
    unsafe { ptr::write_volatile(mark(), GUARD_WRITTEN) };
    let words_end = (&raw const _stack_end).addr() as u32 + 4 * GUARD_WORDS as u32;
    let region = words_end.next_multiple_of(REGION_BYTES);
    let attributes = NEVER_EXECUTED | SHARED_NORMAL | SIZE | REGION_ENABLED;
    // SAFETY: the region is RAM that nothing uses, this early far below the stack.
    unsafe {
        (*MPU::PTR).rbar.write(region | REGION_VALID);
        (*MPU::PTR).rasr.write(attributes);
        (*MPU::PTR).ctrl.write(PROTECTED);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

fn fill(pattern: u32) {
    for word in words() {
        // SAFETY: RAM behind the statics and below the stack.
        unsafe { ptr::write_volatile(word, pattern) };
    }
}

/// Returns true if the guard words are unchanged.
pub fn is_intact() -> bool {
    // SAFETY: RAM behind the statics, whose content may be anything.
    words().all(|word| unsafe { ptr::read_volatile(word) } == GUARD_PATTERN)
}

/// Returns true, and lets the next start report it, if the fault being handled is an access to the closed region. Call it in
/// the handler of the hard fault, with little use of the stack: what is left of it lies in the region.
pub fn record_overflow() -> bool {
    // SAFETY: a read of a status register.
    let status = unsafe { (*SCB::PTR).cfsr.read() };
    let is_overflow = status & REFUSED_ACCESS != 0;
    if is_overflow {
        fill(0);
    }
    is_overflow
}
