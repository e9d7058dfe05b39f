//! The joint driver's firmware on a second chip, which runs in an emulator: see `board`.
//!
//! On a PC this is a stub, so that the workspace builds and tests as a whole.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board;

#[cfg(not(target_os = "none"))]
fn main() {}
