//! The board of the joint driver: pins, registers and interrupts around the common library.
//!
//! A board implements [`firmware::background::Board`] (frames, time, sensors, watchdog) and, if it has a
//! bridge, [`firmware::control::PowerStage`]. It accesses its flash through `embedded_storage`. A board
//! contains no logic that works without registers: such logic is in the library, where a PC tests it. Boards of one chip
//! family include the same modules (`boards/stm32g4`). Another board is a package of its own; see
//! `docs/src/how-to/porting.md`.
//!
//! All boards share these rules:
//!
//! - Dependencies of the board are optional, behind its feature and `cfg(target_os = "none")`, so that another
//!   board has none of them.
//! - `main.rs` only includes this module. The board's file defines its entry point (`#[entry]` or an RTIC
//!   app) and its `defmt` logger, if it logs.
//! - A panic or a hard fault opens the bridge (`open_bridge` of the board), stores its text in RAM that
//!   survives a reset ([`firmware::panic`]) and resets, which opens the bridge as well. The next start
//!   passes the text to the driver in `Boot::panic` (`panic::take`).
//! - [`firmware::stack_guard`] closes a region below the stack. `is_intact` goes to
//!   `LoopReport::stack_intact`. `take_overflow`, called before `paint`, goes to `Boot::stack_overflowed`. The handler of
//!   the hard fault calls `record_overflow`.
//! - [`firmware::heat_memory`] keeps the heat of the winding: `Board::apply` stores it, and `kept` goes to
//!   `Boot::winding_rise_k`.
//! - `HardFault` is handled here; each board defines its own `DefaultHandler`.

#[cfg(feature = "board-b-g431b-esc1")]
mod b_g431b_esc1;
#[cfg(feature = "board-stm32g474")]
mod stm32g474;

#[cfg(feature = "board-b-g431b-esc1")]
use b_g431b_esc1::open_bridge;
use core::panic::Location;
use firmware::panic_note::Part;
#[cfg(feature = "board-stm32g474")]
use stm32g474::open_bridge;

/// Opens the bridge, stores the text and resets the processor. The bridge comes first, because storing
/// takes time and may itself fail.
pub(crate) fn stop(what: &[Part]) -> ! {
    open_bridge();
    firmware::panic::record_and_reset(what)
}

/// Handles a hard fault like a panic. That of a full stack has no room for a text.
///
/// # Safety
/// Only the processor calls it; it never returns.
#[allow(unsafe_code)]
#[cortex_m_rt::exception]
unsafe fn HardFault(frame: &cortex_m_rt::ExceptionFrame) -> ! {
    open_bridge();
    if firmware::stack_guard::record_overflow() {
        cortex_m::peripheral::SCB::sys_reset();
    }
    stop(&[Part::Text("hard fault at "), Part::Hexadecimal(frame.pc())])
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    stop_at(info.location())
}

// Not inlined, for the same reason as what it calls.
#[inline(never)]
fn stop_at(place: Option<&Location>) -> ! {
    open_bridge();
    firmware::panic::record_place_and_reset(place)
}
