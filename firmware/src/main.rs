//! The joint driver's image: see `boards`.
//!
//! On a PC this is a stub, so that the workspace builds and tests as a whole.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod boards;

/// Slot of the image: A.
#[cfg(target_os = "none")]
const SLOT: usize = 0;

#[cfg(not(target_os = "none"))]
fn main() {
    println!("This is the stub of the joint driver's firmware; `cargo firmware` builds the image.");
}
