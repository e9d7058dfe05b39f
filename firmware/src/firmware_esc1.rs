//! The joint driver's image for the B-G431B-ESC1: see `boards`.
//!
//! On a PC this is a stub, so that the workspace builds and tests as a whole.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod boards;

#[cfg(not(target_os = "none"))]
fn main() {
    println!(
        "This is the stub of the B-G431B-ESC1's firmware; `cargo firmware-esc1` builds the image."
    );
}
