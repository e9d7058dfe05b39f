//! Overcurrent opens the bridge in hardware: a comparator at each shunt acts on the break input of the timer.
//!
//! The comparators see the voltage before the amplifiers, where an ampere is 1.7 mV. Their own offset and the resistors are
//! off by 6 A together. Each has one level, for a current out of the motor. The three currents add up to zero, so that a
//! current into the motor leaves through the two other phases, and opens the bridge at twice the level at the latest.
//!
//! [`self_test`] moves each level over the signal before the first PWM ([`super::comparators`]).
//!
//! The levels are at the board's ceiling until the parameters are read, and are set once more then. A set that is committed
//! later applies after a restart.

use super::comparators::{Watch, set_level};
use super::{pins, scales};
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac::comp::{Comp, vals as comp};
use embassy_stm32::peripherals::DAC3;
use embassy_stm32::{pac, rcc};
use firmware::sensors::comparator::break_current_a;
use firmware::supervisor::SelfTest;

/// Comparators connected to the break, by their number minus one.
pub const BREAK_COMPARATORS: [usize; 3] = [0, 1, 3];

const fn watch(number: u8, comparator: Comp, channel: u8) -> Watch<u16> {
    Watch {
        number,
        comparator,
        // A voltage without a current.
        signal: scales::comparator_level(0.0),
        is_second_pin: false,
        level: comp::Inm::DACA,
        converter: pac::DAC3,
        channel,
        is_lower: false,
    }
}

/// All of them (RM0440, tables 194 and 196): two share a level.
const WATCHES: [Watch<u16>; 3] =
    [watch(1, pac::COMP1, 0), watch(2, pac::COMP2, 1), watch(4, pac::COMP4, 1)];

/// Sets up levels and comparators, and locks the comparators until the next reset.
pub fn set_up(wired: pins::Overcurrent) {
    let mut pin = Flex::new(wired.shunt_c);
    pin.set_as_analog();
    core::mem::forget(pin);
    rcc::enable_and_reset::<DAC3>();
    set_levels(scales::BREAK_CEILING_A);
    WATCHES.iter().for_each(Watch::set_up);
}

/// Moves the level of each comparator to both sides of its shunt's voltage without a current, with an open bridge. Returns
/// the first one that does not signal on one side only, or does not reach the break, whose flags the argument clears.
#[inline(never)]
pub fn self_test(clear_breaks: fn()) -> Option<SelfTest> {
    let mut failed = None;
    for watch in &WATCHES {
        if !watch.sees_signal(watch.signal) {
            failed = failed.or(Some(SelfTest::Comparator(watch.number)));
        }
        set_levels(scales::BREAK_CEILING_A);
        clear_breaks();
    }
    failed
}

/// Sets the levels for a joint whose current loop trips at `overcurrent_a`.
pub fn follow(overcurrent_a: f32) {
    set_levels(break_current_a(overcurrent_a, scales::BREAK_CEILING_A));
}

fn set_levels(current_a: f32) {
    let counts = scales::comparator_level(current_a);
    set_level(pac::DAC3, 0, counts);
    set_level(pac::DAC3, 1, counts);
}
