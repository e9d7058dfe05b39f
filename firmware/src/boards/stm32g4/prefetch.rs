//! Prefetch and caches of the flash, for the code that stays there.

use embassy_stm32::pac;

/// Switches on prefetch and both caches of the flash. The caches are on after a reset, the prefetch is not (RM0440, FLASH_ACR).
/// Call it once the wait states are set.
pub fn enable() {
    pac::FLASH.acr().modify(|w| {
        w.set_prften(true);
        w.set_icen(true);
        w.set_dcen(true);
    });
}
