//! The compensator in a user's own loop: no driver, no RTIC, no bus. `drive_on_a_bus.rs` is the second example: a feed-forward for a
//! drive that is not ours.
//!
//! `friction.rs` holds the model; `host-sim export params.toml --to rust --out src` wrote it. A loop builds
//! the compensator once, outside its interrupt, and calls `step` and `sum` in it. Here a `for` loop
//! replaces the timer and a triangle the encoder. On the emulated board the largest current is printed:
//!
//! ```sh
//! cargo run -p bare-loop --profile firmware --target thumbv7em-none-eabihf
//! ```
//!
//! On a PC the same loop runs as a program, so that it can be tested.
#![cfg_attr(target_os = "none", no_std, no_main)]

mod current_loop;
// The second example runs on the PC or the controller of the arm.
#[cfg(not(target_os = "none"))]
mod drive_on_a_bus;
#[rustfmt::skip]
mod friction;

#[cfg(not(target_os = "none"))]
fn main() {
    use compensator_core::Reading;
    println!("largest current {:?}", current_loop::largest_current_a());
    match drive_on_a_bus::FeedForward::build(20.0) {
        Ok(mut drive) => {
            let after_1_s = (0..1000).map(|_| drive.step(1.0, Reading::fresh(1e5))).last();
            println!("data of 60B2h at 1 rad/s and 1 bar {after_1_s:02x?}");
        }
        Err(refusal) => println!("the model is refused: {refusal}"),
    }
}

#[cfg(target_os = "none")]
mod image {
    use cortex_m_semihosting::{debug, hprintln};

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        cortex_m::interrupt::disable();
        loop {
            cortex_m::asm::nop();
        }
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        match super::current_loop::largest_current_a() {
            // As an integer: printing a float takes more flash than the compensator.
            Ok(current_a) => hprintln!("largest current {} mA", (current_a * 1000.0) as i32),
            Err(refusal) => hprintln!("the model is refused: {}", refusal.field),
        }
        debug::exit(debug::EXIT_SUCCESS);
        loop {
            cortex_m::asm::nop();
        }
    }
}
