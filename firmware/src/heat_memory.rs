//! The heat of the winding, kept in RAM across a reset.
//!
//! A reset takes milliseconds, and a winding cools in half a minute. Without power RAM loses its content, which the check
//! shows; the driver then assumes a hot winding ([`crate::driver::Boot::winding_rise_k`]).

#![allow(unsafe_code)] // One static that survives a reset, accessed only here.

use core::mem::MaybeUninit;
use core::ptr;

/// The second word is the first one with these bits flipped.
const CHECK: u32 = u32::from_le_bytes(*b"HEAT");

/// Survives a reset: start-up code neither clears nor initialises this section.
#[unsafe(link_section = ".uninit.heat_memory")]
static mut KEPT: MaybeUninit<[u32; 2]> = MaybeUninit::uninit();

/// Keeps the rise of the winding above the stator, K. Only the background calls it.
pub fn keep(rise_k: f32) {
    let word = rise_k.to_bits();
    // SAFETY: no reference to the static exists, and the start has read it.
    unsafe { ptr::write_volatile((&raw mut KEPT).cast(), [word, word ^ CHECK]) };
}

/// Returns the rise that the previous run kept, K; `None` if there is none. Call it at the start.
pub fn kept() -> Option<f32> {
    // SAFETY: no reference to the static exists; any content is valid.
    let [word, check]: [u32; 2] = unsafe { ptr::read_volatile((&raw const KEPT).cast()) };
    (word ^ check == CHECK).then_some(f32::from_bits(word))
}
