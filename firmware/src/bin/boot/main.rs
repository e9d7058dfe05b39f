//! The boot program of the STM32G474 board: see `program`.
//!
//! On a PC this is a stub, so that the workspace builds and tests as a whole.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod program;

/// Slot of the boot program, which receives into the other one.
#[cfg(target_os = "none")]
const SLOT: usize = 0;

#[cfg(not(target_os = "none"))]
fn main() {
    println!("This is the stub of the boot program; `cargo boot` builds it.");
}
