//! The wiring of the board and the parts of its bridge: what to change for another board with this chip.
//!
//! One file in `pins/` has all of it: pins, peripherals, and values of the parts. A feature `wiring-NAME` selects it, see build.rs.
//! Its content is the board's identity in packages ([`WIRING`]), so that an image for another wiring is refused.
//!
//! The compiler checks it: embassy knows the functions of every pin, and a peripheral named twice would be moved twice. What
//! embassy does not know, the inputs of comparators, is compared below. At the start [`wiring::are_connected`] compares each pin
//! of a peripheral with its function in the table, before the first PWM.

#[macro_use]
#[path = "../stm32g4/wiring.rs"]
pub mod wiring;

use super::clocks::Crystal;
use embassy_stm32::pac;
use embassy_stm32::rcc::PllPreDiv;

use wiring::{Connection, find, identity, is_pin, number_at, pin_of, value_at};

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
#[cfg(not(feature = "without-incremental"))]
pub const COUNTER: pac::timer::TimAdv = pac::TIM20;

// build.rs sets `wiring` to the NAME of the feature.
#[cfg_attr(wiring = "standard", path = "pins/standard.rs")]
#[cfg_attr(wiring = "second", path = "../../../tests/wiring/second.rs")]
mod table;

pub use table::*;

/// Identity of the wiring: the table as text, and the parts of the bridge.
pub const WIRING: u32 = identity(
    TABLE,
    &[
        SHUNT_OHM,
        AMPLIFIER_GAIN,
        BUS_DIVIDER[0],
        BUS_DIVIDER[1],
        DEAD_TIME as f32,
        BREAK_CEILING_A,
        AMPLIFIER_SETTLING_S,
    ],
);

/// Enable pin of the gate driver, because a panic handler does not own the pins.
pub const GATE_ENABLE: (pac::gpio::Gpio, usize) = pin_of(TABLE, "bridge.enable");
/// Alternate function of the break input.
pub const BREAK_FUNCTION: u8 = function_of("bridge.fault");
/// Clock pin of the pressure sensor's bus, for a manual recovery.
pub const PRESSURE_CLOCK: (pac::gpio::Gpio, usize) = pin_of(TABLE, "pressure.clock");
/// Data pin of the pressure sensor's bus.
pub const PRESSURE_DATA: (pac::gpio::Gpio, usize) = pin_of(TABLE, "pressure.data");
/// Port of the three Hall sensors, and the first of their pins.
#[cfg(not(feature = "without-incremental"))]
pub const HALL: (pac::gpio::Gpio, usize) = pin_of(OPTIONAL, "incremental.hall_1");

/// Phase whose amplifier is at PA0 and PB11, the inputs of COMP3 and COMP6.
pub const AT_PA0: Phase = if is_phase_a_at_pa0() { Phase::A } else { Phase::B };
/// Phase whose amplifier is at PA1 and PA3, the inputs of COMP1 and COMP2.
pub const AT_PA1: Phase = if is_phase_a_at_pa0() { Phase::B } else { Phase::A };

const fn is_phase_a_at_pa0() -> bool {
    is_pin(TABLE, "currents.phase_a", "PA0")
}

/// Inputs of the comparators (RM0440, table 194): both phases, and what the comparators share with them.
const _: () = {
    let [at_pa0, at_pa1] = if is_phase_a_at_pa0() {
        [["currents.phase_a", "overcurrent.phase_a"], ["currents.phase_b", "overcurrent.phase_b"]]
    } else {
        [["currents.phase_b", "overcurrent.phase_b"], ["currents.phase_a", "overcurrent.phase_a"]]
    };
    assert!(
        is_pin(TABLE, at_pa0[0], "PA0") && is_pin(TABLE, at_pa1[0], "PA1"),
        "the amplifiers of phases a and b must be at PA0 and PA1"
    );
    assert!(
        is_pin(TABLE, at_pa0[1], "PB11") && is_pin(TABLE, at_pa1[1], "PA3"),
        "overcurrent: the phase at PA0 must also be at PB11, that at PA1 at PA3"
    );
    assert!(
        is_pin(TABLE, "overcurrent.mean_high", "PB13")
            && is_pin(TABLE, "overcurrent.mean_low", "PB14"),
        "overcurrent: the mean must be at PB13 and PB14"
    );
    assert!(DEAD_TIME <= 127, "DEAD_TIME: above 127 a count is longer than a cycle");
};

/// What a board leaves open is said twice: in its table, and by its feature in Cargo.toml.
const _: () = {
    let has_incremental = find(OPTIONAL, "incremental.a").is_some();
    assert!(
        has_incremental != cfg!(feature = "without-incremental"),
        "either the table has the group incremental, or the wiring's feature enables without-incremental"
    );
    let has_joint_encoder = find(OPTIONAL, "joint_encoder.clock").is_some();
    assert!(
        has_joint_encoder != cfg!(feature = "without-joint-encoder"),
        "either the table has the group joint_encoder, or the wiring's feature enables without-joint-encoder"
    );
    let has_touch = find(OPTIONAL, "touch.input").is_some();
    assert!(
        has_touch != cfg!(feature = "without-touch"),
        "either the table has the group touch, or the wiring's feature enables without-touch"
    );
};

/// Inputs of the Hall sensors, which are read together.
#[cfg(not(feature = "without-incremental"))]
const _: () = {
    let hall_2 = pin_of(OPTIONAL, "incremental.hall_2");
    let hall_3 = pin_of(OPTIONAL, "incremental.hall_3");
    assert!(
        hall_2.1 == HALL.1 + 1 && hall_3.1 == HALL.1 + 2,
        "the Hall sensors must be at three pins of a port that follow each other"
    );
};

/// Returns the alternate function of the pin at this entry of the table.
const fn function_of(name: &str) -> u8 {
    let table = TABLE.as_bytes();
    let (_, end) = number_at(table, value_at(TABLE, name) + 2);
    assert!(table[end] == b'[', "the pin has no alternate function in the table");
    number_at(table, end + 1).0 as u8
}
