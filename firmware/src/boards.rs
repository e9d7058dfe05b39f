//! The boards the joint driver runs on: pins, registers and interrupts around the same library.
//!
//! A board implements [`firmware::background::Board`] (frames, time, sensors, watchdog) and, where it has a
//! bridge, [`firmware::control::PowerStage`]; it keeps its flash behind `embedded_storage`. It decides
//! nothing: whatever can be decided without a register is in the library, where a PC tests it. Adding one
//! is a folder here with its `memory.x`, a line below and a feature; see `docs/porting.md`.
//!
//! The skeleton all boards share:
//! - A cargo feature `board-NAME` chooses the board, one in an image, which `build.rs` sees to.
//!   Dependencies of a board are optional, behind its feature and `cfg(target_os = "none")`.
//! - `main.rs` only takes this module in. A board's own file defines its entry point (`#[entry]` or an RTIC
//!   app) and its one `defmt` global logger: stm32g474 `defmt-rtt`, qemu `defmt-semihosting`; stm32f405
//!   logs nothing.
//! - A panic or a hard fault opens the bridge (`open_bridge` of the board) and leaves its text in RAM that outlives a reset ([`firmware::panic`]) and resets, which
//!   opens the bridge; the next start hands the text to the driver in `Boot::panic` (`panic::take`).
//! - [`firmware::stack_guard`] paints words below the stack; `is_intact` goes into `LoopReport::stack_intact`,
//!   and `take_overflow`, asked before `paint`, into `Boot::stack_overflowed`.
//! - Exceptions that are nobody's (`HardFault`) are taken here; `DefaultHandler` is a board's own.

#[cfg(feature = "board-qemu")]
mod qemu;
#[cfg(any(feature = "board-qemu", feature = "board-stm32f405"))]
mod serial_bus;
#[cfg(feature = "board-stm32f405")]
mod stm32f405;
#[cfg(feature = "board-stm32g474")]
mod stm32g474;

#[cfg(feature = "board-qemu")]
use qemu::open_bridge;
#[cfg(feature = "board-stm32f405")]
use stm32f405::open_bridge;
#[cfg(feature = "board-stm32g474")]
use stm32g474::open_bridge;

/// Ends this life: the bridge is opened *first*, for writing a note takes its time and may itself fail; then the note,
/// then a reset.
pub(crate) fn stop(what: &dyn core::fmt::Display) -> ! {
    open_bridge();
    firmware::panic::keep_and_reset(what)
}

/// What a hard fault does: the same as a panic, which see.
///
/// # Safety
/// Called by the processor alone; it returns to nothing.
#[allow(unsafe_code)]
#[cortex_m_rt::exception]
unsafe fn HardFault(frame: &cortex_m_rt::ExceptionFrame) -> ! {
    open_bridge();
    stop(&format_args!("hard fault at {:#010x}", frame.pc()))
}
