//! The end of the previous run, the crystal, and the brown-out level.

use embassy_stm32::pac;
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::pac::rcc::regs::Csr;
use firmware::driver::Boot;
use firmware::panic_note::MAX_PANIC_TEXT_BYTES;
use firmware::supervisor::{ResetCause, SelfTest};
use firmware::{heat_memory, home_memory, panic, stack_guard};
use heapless::String;

/// How the previous run ended.
pub struct PreviousRun {
    cause: ResetCause,
    panic: Option<String<MAX_PANIC_TEXT_BYTES>>,
    stack_overflowed: bool,
}

impl PreviousRun {
    /// Returns what a node is told of the start, without the places of images.
    #[inline(always)]
    pub fn boot(&self, failed_self_test: Option<SelfTest>) -> Boot<'_> {
        Boot {
            cause: self.cause,
            panic: self.panic.as_deref(),
            stack_overflowed: self.stack_overflowed,
            failed_self_test,
            winding_rise_k: heat_memory::kept(),
            home: home_memory::kept(),
            program: None,
        }
    }
}

/// Reads how the previous run ended, and closes the region below the stack. Call it first.
#[inline(always)]
pub fn previous_run() -> PreviousRun {
    let is_ram_kept = stack_guard::is_ram_kept();
    let stack_overflowed = stack_guard::take_overflow();
    stack_guard::paint();
    let panic = panic::take();
    PreviousRun { cause: reset_cause(is_ram_kept), panic, stack_overflowed }
}

/// Processor clock after a reset, Hz.
const RESET_HZ: u32 = 16_000_000;

/// Waits until the crystal runs, on the internal oscillator. Without a crystal the board does nothing but log that, twice a
/// second: a reset would look like a start that fails. Call it before the clocks are set up.
#[inline(always)]
pub fn wait_for_crystal() {
    pac::RCC.cr().modify(|w| w.set_hseon(true));
    let mut polls = 0u32;
    while !pac::RCC.cr().read().hserdy() {
        cortex_m::asm::delay(RESET_HZ / 1000);
        polls += 1;
        if polls.is_multiple_of(500) {
            defmt::error!("no crystal: the board waits for it, and its CAN is off");
        }
        // Of the boot program, which has started it.
        pac::IWDG.kr().write(|w| w.set_key(Key::RESET));
    }
}

/// Returns the reset cause and clears its flags. `is_ram_kept`: RAM holds the contents of the previous run.
fn reset_cause(is_ram_kept: bool) -> ResetCause {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    let cause = cause(flags, is_ram_kept);
    if cause == ResetCause::BrownOut {
        defmt::warn!("brown-out: the supply fell below 2.5 V");
    }
    cause
}

/// Every reset also sets the pin flag, so the pin counts only if no other flag is set. Power-on sets the
/// brown-out flag, too, but RAM keeps its contents in a brown-out only.
fn cause(flags: Csr, is_ram_kept: bool) -> ResetCause {
    if flags.iwdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.borrstf() {
        if is_ram_kept { ResetCause::BrownOut } else { ResetCause::PowerOn }
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.pinrstf() {
        ResetCause::Pin
    } else {
        ResetCause::Unknown
    }
}

/// Required brown-out level: it holds the chip in reset below 2.47 to 2.57 V (option byte BOR_LEV, data sheet:
/// V_BOR3 falling). The supply monitor opens the bridge at 2.84 V at the latest
/// ([`super::power_stage`]), so a falling supply is reported before the reset. The highest level, 2.76 to
/// 2.86 V, overlaps the monitor's. The factory setting is the lowest, 1.7 V.
const BROWN_OUT_LEVEL: u8 = 3;

/// Logs a warning if the option bytes hold another brown-out level than docs/src/how-to/bring-up.md requires.
pub fn check_brown_out_level() {
    let level = pac::FLASH.optr().read().bor_lev();
    if level != BROWN_OUT_LEVEL {
        defmt::warn!(
            "brown-out level {=u8}, expected {=u8}: see docs/src/how-to/bring-up.md",
            level,
            BROWN_OUT_LEVEL
        );
    }
}
