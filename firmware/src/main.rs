//! The joint driver's image: see `boards` for what runs on which board.
//!
//! On a PC this is a stub, so that the workspace builds and tests as a whole.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod boards;

/// Slot of the image, if the board has two: A.
#[cfg(target_os = "none")]
#[allow(dead_code)] // Other boards have one.
const SLOT: usize = 0;

#[cfg(not(target_os = "none"))]
fn main() {
    println!("This is the stub of the joint driver's firmware; `cargo firmware` builds the image.");
}
