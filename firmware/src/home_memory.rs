//! The home of the joint, kept in RAM across a reset.
//!
//! Without power RAM loses its content, which the check shows; the joint is then homed again.

#![allow(unsafe_code)] // One static that survives a reset, accessed only here.

use crate::driver::KeptHome;
use core::mem::MaybeUninit;
use core::ptr;

/// Words of a home, and their check.
const WORDS: usize = 5;
/// Start of the check, so that cleared RAM holds no home.
const CHECK: u32 = u32::from_le_bytes(*b"HOME");

/// Survives a reset: start-up code neither clears nor initialises this section.
#[unsafe(link_section = ".uninit.home_memory")]
static mut KEPT: MaybeUninit<[u32; WORDS]> = MaybeUninit::uninit();

/// Keeps the home, or that none is known. Only the background calls it.
pub fn keep(home: Option<KeptHome>) {
    let [a, b, c, d] = home.map_or([0; 4], KeptHome::to_words);
    let check = if home.is_some() { checked(&[a, b, c, d]) } else { 0 };
    // SAFETY: no reference to the static exists, and the start has read it.
    unsafe { ptr::write_volatile((&raw mut KEPT).cast(), [a, b, c, d, check]) };
}

/// Returns the home that the previous run kept; `None` if there is none. Call it at the start.
pub fn kept() -> Option<KeptHome> {
    // SAFETY: no reference to the static exists; any content is valid.
    let [a, b, c, d, check]: [u32; WORDS] = unsafe { ptr::read_volatile((&raw const KEPT).cast()) };
    let words = [a, b, c, d];
    (check == checked(&words)).then(|| KeptHome::from_words(words))
}

/// Returns the check of a home: a sum that depends on the order of the words.
fn checked(words: &[u32; 4]) -> u32 {
    words.iter().fold(CHECK, |sum, word| sum.rotate_left(5).wrapping_add(*word))
}
