//! Handlers of the exceptions that stop the driver.

use super::{flash, power_stage};
use embassy_stm32::pac;
use firmware::panic_note::Part;

/// Handles memory errors of flash or RAM and a failure of the crystal. The timer has already opened the
/// bridge.
///
/// # Safety
/// Only the processor calls it.
#[cortex_m_rt::exception]
unsafe fn NonMaskableInt() {
    if flash::ecc_error() {
        power_stage::clear_system_break();
        return;
    }
    let why = if pac::RCC.cifr().read().cssf() {
        "clock: the crystal has stopped"
    } else if pac::SYSCFG.cfgr2().read().spf() {
        "RAM: parity error"
    } else {
        "flash: ECC error in the image"
    };
    crate::boards::stop(&[Part::Text(why)]);
}

/// Stops the driver: an exception without a handler is a firmware error. `number` is that of an interrupt, negative for other
/// exceptions; the note has the number of the vector, which is 16 more.
///
/// # Safety
/// Only the processor calls it.
#[cortex_m_rt::exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    let exception = u32::from((number + 16).unsigned_abs());
    crate::boards::stop(&[Part::Text("unexpected exception "), Part::Decimal(exception)])
}
