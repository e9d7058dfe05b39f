//! Overcurrent opens the bridge by hardware: six comparators on the shunts, at the timer's break.
//!
//! ```text
//! amplifier a -+-> COMP3 above, COMP6 below     levels: converters inside the chip, T to either side of the middle
//! amplifier b -+-> COMP1 above, COMP2 below                                         -> break of TIM1, filtered
//! mean of a, b --> COMP5 above, COMP7 below     half of T: the mean shows half of what flows in phase c
//! ```
//! A processor that hangs leaves the timer its last duties, and the vector stands while the rotor turns. Nothing that runs is
//! needed here: levels and inputs are set once, and locked before the break is. A comparator has one level, and a current is
//! too large in either direction, so each phase takes two; of two phases alone the third would be left with twice the level.
//! A low side's shunt shows its current while that side conducts, once a period: a duty so high that this time is shorter
//! than the amplifier's lag and the break's filter is not seen, and `modulation_max` forbids it.

use super::{pins, scales};
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac::comp::{Comp, vals as comp};
use embassy_stm32::pac::dac::{Dac, vals as dac};
use embassy_stm32::peripherals::{DAC2, DAC3, DAC4};
use embassy_stm32::{pac, rcc};

/// Which of the two pins of a comparator.
const FIRST: bool = false;
const SECOND: bool = true;

/// What the converters' interface needs of a bus above 160 MHz (RM0440, DAC_MCR HFSEL).
const BUS_ABOVE_160_MHZ: u8 = 0b10;

/// Comparators at the break, by their number less one.
pub const AT_BREAK: [usize; 6] = [0, 1, 2, 4, 5, 6];

/// Sets levels and comparators up, and locks the comparators until the next reset.
pub fn set_up(wired: pins::Overcurrent) {
    // Pins of an analog input alone: that is how a reset leaves them, and nobody else has them now.
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
    level(pac::DAC3, 0, scales::BREAK_ABOVE);
    level(pac::DAC3, 1, scales::BREAK_BELOW);
    level(pac::DAC4, 1, scales::BREAK_BELOW);
    level(pac::DAC4, 0, scales::BREAK_MEAN_ABOVE);
    level(pac::DAC2, 0, scales::BREAK_MEAN_BELOW);
    // Below its level a comparator is to say so: its output is turned.
    compare(pac::COMP3, FIRST, comp::Inm::DACA, comp::Polarity::NOT_INVERTED);
    compare(pac::COMP6, FIRST, comp::Inm::DACA, comp::Polarity::INVERTED);
    compare(pac::COMP1, FIRST, comp::Inm::DACA, comp::Polarity::NOT_INVERTED);
    compare(pac::COMP2, SECOND, comp::Inm::DACA, comp::Polarity::INVERTED);
    compare(pac::COMP5, FIRST, comp::Inm::DACA, comp::Polarity::NOT_INVERTED);
    compare(pac::COMP7, FIRST, comp::Inm::DACB, comp::Polarity::INVERTED);
}

fn level(converter: Dac, channel: usize, counts: u16) {
    converter.mcr().modify(|w| {
        w.set_hfsel(BUS_ABOVE_160_MHZ);
        w.set_mode(channel, dac::Mode::NORMAL_INT_BUFDIS);
    });
    converter.dhr12r(channel).write(|w| w.set_dhr(counts));
    converter.cr().modify(|w| w.set_en(channel, true));
}

fn compare(comparator: Comp, pin: bool, level: comp::Inm, polarity: comp::Polarity) {
    comparator.csr().write(|w| {
        w.set_inpsel(pin);
        w.set_inmsel(level);
        w.set_polarity(polarity);
        w.set_en(true);
        w.set_lock(true);
    });
}
