//! What a panic does: nothing in the core can, so it is always a mistake of the firmware's own.

use core::panic::PanicInfo;

/// In the emulator: says where, and ends it with exit code 1, so that a test fails.
#[cfg(feature = "board-qemu")]
#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    use cortex_m_semihosting::{debug, hprintln};
    hprintln!("{}", info);
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}

/// On the joint driver: stays here with interrupts off. No bridge is switched on by this image.
#[cfg(not(feature = "board-qemu"))]
#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    loop {
        cortex_m::asm::nop();
    }
}
