//! The joint driver's image: see `boards` for what runs on which board.
//!
//! On a PC this is a stub, so that the workspace builds and tests as a whole.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod boards;

#[cfg(target_os = "none")]
#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    // Print the location only, not the message: the source line identifies the cause. Without the messages the
    // image is 7,224 bytes smaller (STM32G474).
    match info.location() {
        Some(place) => boards::stop(&format_args!("panicked at {place}")),
        None => boards::stop(&"panicked"),
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("This is the stub of the joint driver's firmware; `cargo firmware` builds the image.");
}
