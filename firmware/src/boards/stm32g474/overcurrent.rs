//! Overcurrent opens the bridge in hardware: six comparators on the shunts act on the break input of the
//! timer.
//!
//! ```text
//! amplifier a -+-> COMP3 above, COMP6 below     levels: internal DACs, T on either side of the middle
//! amplifier b -+-> COMP1 above, COMP2 below                                         -> break of TIM1, filtered
//! mean of a, b --> COMP5 above, COMP7 below     half of T: the mean shows half of the current in phase c
//! ```
//! If the processor hangs, the timer keeps its last duties, and the voltage vector stands still while the
//! rotor turns. The comparators need no software: they are set once and locked before the break is.
//!
//! The levels follow the parameter `overcurrent_a`. They are at the board's ceiling until the parameters are
//! read, and are set once more then. A set that is committed later applies after a restart, because a change
//! of the levels belongs to no moment at which the bridge is known to be open. The chip cannot lock them.
//!
//! A comparator has one level and a current may be too large in either direction, so each phase needs two.
//! With two phases only, the third would have twice the level. A low-side shunt shows its current only
//! while that switch conducts, once a period. At a very high duty this time is shorter than the amplifier's
//! lag and the break filter, and the current is not seen; `modulation_max` excludes such duties.
//!
//! [`self_test`] moves each level over the signal before the first PWM ([`super::comparators`]).

use super::comparators::{Watch, set_level};
use super::pins::{self, AT_PA0, AT_PA1, Phase};
use super::scales;
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac::comp::{Comp, vals as comp};
use embassy_stm32::pac::dac::Dac;
use embassy_stm32::peripherals::{DAC2, DAC3, DAC4};
use embassy_stm32::{pac, rcc};
use firmware::sensors::comparator::{ComparatorLevels, break_current_a};
use firmware::supervisor::SelfTest;

/// Comparators connected to the break, by their number minus one.
pub const BREAK_COMPARATORS: [usize; 6] = [0, 1, 2, 4, 5, 6];

/// What a comparator watches.
#[derive(Clone, Copy)]
enum Signal {
    Shunt(Phase),
    Mean,
}

const fn watch(
    number: u8,
    comparator: Comp,
    signal: Signal,
    converter: Dac,
    channel: u8,
) -> Watch<Signal> {
    let (level, is_second_pin, is_lower) = (comp::Inm::DACA, false, false);
    Watch { number, comparator, signal, is_second_pin, level, converter, channel, is_lower }
}

/// All of them (RM0440, tables 194 and 196). The pins are those of pins.rs.
const WATCHES: [Watch<Signal>; 6] = [
    watch(3, pac::COMP3, Signal::Shunt(AT_PA0), pac::DAC3, 0),
    Watch { is_lower: true, ..watch(6, pac::COMP6, Signal::Shunt(AT_PA0), pac::DAC4, 1) },
    watch(1, pac::COMP1, Signal::Shunt(AT_PA1), pac::DAC3, 0),
    Watch {
        is_lower: true,
        is_second_pin: true,
        ..watch(2, pac::COMP2, Signal::Shunt(AT_PA1), pac::DAC3, 1)
    },
    watch(5, pac::COMP5, Signal::Mean, pac::DAC4, 0),
    Watch {
        is_lower: true,
        level: comp::Inm::DACB,
        ..watch(7, pac::COMP7, Signal::Mean, pac::DAC2, 0)
    },
];

/// Sets up levels and comparators, and locks the comparators until the next reset.
pub fn set_up(wired: pins::Overcurrent) {
    // Analog inputs: the state after a reset, which must stay, so the pins are never released.
    for mut pin in [
        Flex::new(wired.phase_a),
        Flex::new(wired.phase_b),
        Flex::new(wired.mean_high),
        Flex::new(wired.mean_low),
    ] {
        pin.set_as_analog();
        core::mem::forget(pin);
    }
    rcc::enable_and_reset::<DAC2>();
    rcc::enable_and_reset::<DAC3>();
    rcc::enable_and_reset::<DAC4>();
    set_levels(scales::CEILING_LEVELS);
    WATCHES.iter().for_each(Watch::set_up);
}

/// Moves the level of each comparator to both sides of its signal, with an open bridge. Returns the first one that does not
/// signal on one side only, or does not reach the break, whose flags the second argument clears. The first has the
/// present counts of both amplifiers.
#[inline(never)]
pub fn self_test([phase_a, phase_b]: [u16; 2], clear_breaks: fn()) -> Option<SelfTest> {
    let mut failed = None;
    for watch in &WATCHES {
        let counts = match watch.signal {
            Signal::Shunt(Phase::A) => phase_a,
            Signal::Shunt(Phase::B) => phase_b,
            Signal::Mean => phase_a.midpoint(phase_b),
        };
        if !watch.sees_signal(counts) {
            failed = failed.or(Some(SelfTest::Comparator(watch.number)));
        }
        set_levels(scales::CEILING_LEVELS);
        clear_breaks();
    }
    failed
}

/// Sets the levels for a joint whose current loop trips at `overcurrent_a`.
pub fn follow(overcurrent_a: f32) {
    let break_a = break_current_a(overcurrent_a, scales::BREAK_CEILING_A);
    set_levels(ComparatorLevels::for_current(break_a, scales::AMPERES_PER_COUNT));
}

fn set_levels(levels: ComparatorLevels) {
    let ([above, below], [mean_above, mean_below]) = (levels.phase, levels.mean);
    set_level(pac::DAC3, 0, above);
    set_level(pac::DAC3, 1, below);
    set_level(pac::DAC4, 1, below);
    set_level(pac::DAC4, 0, mean_above);
    set_level(pac::DAC2, 0, mean_below);
}
