//! The joint driver's image for slot B: see `main.rs`, which is that for slot A.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod boards;

/// Slot of the image: B.
#[cfg(target_os = "none")]
const SLOT: usize = 1;

#[cfg(not(target_os = "none"))]
fn main() {
    println!("This is the stub of the joint driver's firmware; `cargo firmware` builds the image.");
}
