//! The wiring of the board and the parts of its bridge: what to change for another board with this chip.
//!
//! One file in `pins/` has all of it: pins, peripherals, and values of the parts. The feature `wiring-second` selects the
//! second one. Its content is the board's identity in packages ([`WIRING`]), so that an image for another wiring is refused.
//! The compiler checks it: embassy knows the functions of every pin, and a peripheral named twice would be
//! moved twice. At the start [`wiring::are_connected`] compares each pin of a peripheral with its function in the table, before the
//! first PWM. Some entries are repeated by number, because a panic or an interrupt does not own the pins.

#[macro_use]
#[path = "../stm32g4/wiring.rs"]
pub mod wiring;

use super::clocks::Crystal;
use embassy_stm32::pac;
use embassy_stm32::rcc::PllPreDiv;

use wiring::{Connection, identity};

/// A signal at the shunts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The amplifier of phase a.
    A,
    /// The amplifier of phase b.
    B,
}

/// Crystal.
pub const CRYSTAL: Crystal = Crystal { hz: 24_000_000, divider: PllPreDiv::DIV6 };
/// Counter of an ABZ encoder.
pub const COUNTER: pac::timer::TimAdv = pac::TIM20;

#[cfg_attr(feature = "wiring-second", path = "pins/second.rs")]
#[cfg_attr(not(feature = "wiring-second"), path = "pins/standard.rs")]
mod table;

pub use table::*;

/// Identity of the wiring: the table as text, and the parts of the bridge.
pub const WIRING: u32 = identity(
    TABLE,
    &[SHUNT[0], SHUNT[1], BUS_DIVIDER[0], BUS_DIVIDER[1], DEAD_TIME as f32, BREAK_CEILING_A],
);
