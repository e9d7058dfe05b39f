//! The code of the current loop's interrupt in CCM: copied from flash, and protected from writes. For the
//! code that stays in flash, prefetch and caches.
//!
//! `memory.x` places the code in the section `.fast`. It is copied before RAM is initialised and before any
//! other code runs, because other code may call functions in that section. The copy is written in assembly:
//! compiled code may call `memcpy`, which is one of them.

use embassy_stm32::pac;

// `cortex-m-rt` calls `__pre_init` first. All three addresses are multiples of 4.
core::arch::global_asm!(
    ".section .text.__pre_init, \"ax\"",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, =__sfast",
    "ldr r1, =__efast",
    "ldr r2, =__sifast",
    "0:",
    "cmp r0, r1",
    "bhs 1f",
    "ldm r2!, {{r3}}",
    "stm r0!, {{r3}}",
    "b 0b",
    "1:",
    "dsb",
    "isb",
    "bx lr",
    ".ltorg",
    ".size __pre_init, . - __pre_init",
);

/// Pages of CCM, and their length in bytes.
const CCM_PAGES: usize = 32;
const CCM_PAGE_BYTES: usize = 1024;

unsafe extern "C" {
    /// First byte and end of the section; from `memory.x`.
    static __sfast: u8;
    static __efast: u8;
}

/// Protects the copied code from writes until the next reset, in whole pages (RM0440, SYSCFG_SWPR). A write
/// raises a bus fault, which opens the bridge.
pub fn protect() {
    let bytes = (&raw const __efast).addr() - (&raw const __sfast).addr();
    pac::SYSCFG.swpr().write(|w| {
        (0..CCM_PAGES.min(bytes / CCM_PAGE_BYTES)).for_each(|page| w.set_page_wp(page, true));
    });
}
