//! The boards the joint driver runs on: wires and registers around the same [`firmware::driver::Driver`].
//!
//! A board reads its clock and its converters, moves frames between its bus and the driver, keeps its
//! flash behind `embedded_storage`, and calls the current loop. It decides nothing: whatever can be
//! decided without a register is in the library, where a PC tests it. How to add one: `docs/porting.md`.
//!
//! The skeleton both boards share:
//! - A cargo feature chooses the board: `board-stm32g474` (default) or `board-qemu`, never both in an image.
//!   Dependencies of a board are optional, behind its feature and `cfg(target_os = "none")`.
//! - `main.rs` only takes this module in. A board's own file defines its entry point (`#[entry]` or an RTIC
//!   app) and its one `defmt` global logger: stm32g474 `defmt-rtt`, qemu `defmt-semihosting`.
//! - A panic or a hard fault leaves its text in RAM that outlives a reset ([`firmware::panic`]) and resets, which
//!   opens the bridge; the next start hands the text to the driver in `Boot::panic` (`panic::take`).
//! - [`firmware::stack_guard`] paints words below the stack; `is_intact` goes into `LoopReport::stack_intact`,
//!   and `take_overflow`, asked before `paint`, into `Boot::stack_overflowed`.
//! - Exceptions that are nobody's (`HardFault`) are taken here; `DefaultHandler` is a board's own.

#[cfg(all(feature = "board-qemu", not(feature = "board-stm32g474")))]
mod qemu;
#[cfg(all(feature = "board-stm32g474", not(feature = "board-qemu")))]
mod stm32g474;

#[cfg(all(feature = "board-qemu", feature = "board-stm32g474"))]
compile_error!("one board an image: build with --no-default-features --features board-qemu,terms");

/// What a hard fault does: the same as a panic, which see.
///
/// # Safety
/// Called by the processor alone; it returns to nothing.
#[allow(unsafe_code)]
#[cortex_m_rt::exception]
unsafe fn HardFault(frame: &cortex_m_rt::ExceptionFrame) -> ! {
    firmware::panic::keep_and_reset(&format_args!("hard fault at {:#010x}", frame.pc()))
}
