//! The hand-over to an image.

use super::watchdog;

/// Starts the image with this vector table.
pub fn image(vectors: u32) -> ! {
    watchdog::start(watchdog::IMAGE_START);
    // SAFETY: the boot program has enabled no interrupt and uses no peripheral any more; the vector table was checked.
    unsafe {
        (*cortex_m::peripheral::SCB::PTR).vtor.write(vectors);
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        cortex_m::asm::bootload(vectors as *const u32)
    }
}
