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

use super::{pins, scales};
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac::comp::{Comp, vals as comp};
use embassy_stm32::pac::dac::{Dac, vals as dac};
use embassy_stm32::peripherals::{DAC2, DAC3, DAC4};
use embassy_stm32::{pac, rcc};
use firmware::sensors::comparator::{ComparatorLevels, break_current_a};

/// Selects one of the two input pins of a comparator.
const FIRST_PIN: bool = false;
const SECOND_PIN: bool = true;

/// DAC interface setting for a bus above 160 MHz (RM0440, DAC_MCR HFSEL).
const BUS_ABOVE_160_MHZ: u8 = 0b10;

/// Comparators connected to the break, by their number minus one.
pub const BREAK_COMPARATORS: [usize; 6] = [0, 1, 2, 4, 5, 6];

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
    // A comparator below its level must signal, so its output is inverted.
    set_up_comparator(pac::COMP3, FIRST_PIN, comp::Inm::DACA, comp::Polarity::NOT_INVERTED);
    set_up_comparator(pac::COMP6, FIRST_PIN, comp::Inm::DACA, comp::Polarity::INVERTED);
    set_up_comparator(pac::COMP1, FIRST_PIN, comp::Inm::DACA, comp::Polarity::NOT_INVERTED);
    set_up_comparator(pac::COMP2, SECOND_PIN, comp::Inm::DACA, comp::Polarity::INVERTED);
    set_up_comparator(pac::COMP5, FIRST_PIN, comp::Inm::DACA, comp::Polarity::NOT_INVERTED);
    set_up_comparator(pac::COMP7, FIRST_PIN, comp::Inm::DACB, comp::Polarity::INVERTED);
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

#[inline(never)]
fn set_level(converter: Dac, channel: usize, counts: u16) {
    if !converter.cr().read().en(channel) {
        converter.mcr().modify(|w| {
            w.set_hfsel(BUS_ABOVE_160_MHZ);
            w.set_mode(channel, dac::Mode::NORMAL_INT_BUFDIS);
        });
    }
    converter.dhr12r(channel).write(|w| w.set_dhr(counts));
    converter.cr().modify(|w| w.set_en(channel, true));
}

fn set_up_comparator(comparator: Comp, pin: bool, level: comp::Inm, polarity: comp::Polarity) {
    comparator.csr().write(|w| {
        w.set_inpsel(pin);
        w.set_inmsel(level);
        w.set_polarity(polarity);
        w.set_en(true);
        w.set_lock(true);
    });
}
