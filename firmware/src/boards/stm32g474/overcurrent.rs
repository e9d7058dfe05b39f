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
//! [`self_test`] moves each level over the signal before the first PWM: a comparator whose input is not wired to its
//! amplifier, or whose output does not reach the break, would be found only by the current that it should have stopped.

use super::pins::{self, AT_PA0, AT_PA1, Phase};
use super::scales;
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

/// What a comparator watches.
#[derive(Clone, Copy)]
enum Signal {
    Shunt(Phase),
    Mean,
}

/// A comparator, with its input, and the DAC channel of its level.
struct Watch {
    number: u8,
    comparator: Comp,
    pin: bool,
    signal: Signal,
    level: comp::Inm,
    converter: Dac,
    channel: usize,
    /// It signals below its level: its output is inverted.
    is_lower: bool,
}

const fn watch(
    number: u8,
    comparator: Comp,
    signal: Signal,
    converter: Dac,
    channel: usize,
) -> Watch {
    let level = comp::Inm::DACA;
    Watch { number, comparator, pin: FIRST_PIN, signal, level, converter, channel, is_lower: false }
}

/// All of them (RM0440, tables 194 and 196). The pins are those of pins.rs.
const WATCHES: [Watch; 6] = [
    watch(3, pac::COMP3, Signal::Shunt(AT_PA0), pac::DAC3, 0),
    Watch { is_lower: true, ..watch(6, pac::COMP6, Signal::Shunt(AT_PA0), pac::DAC4, 1) },
    watch(1, pac::COMP1, Signal::Shunt(AT_PA1), pac::DAC3, 0),
    Watch {
        is_lower: true,
        pin: SECOND_PIN,
        ..watch(2, pac::COMP2, Signal::Shunt(AT_PA1), pac::DAC3, 1)
    },
    watch(5, pac::COMP5, Signal::Mean, pac::DAC4, 0),
    Watch {
        is_lower: true,
        level: comp::Inm::DACB,
        ..watch(7, pac::COMP7, Signal::Mean, pac::DAC2, 0)
    },
];

/// Distance of a level from its signal in the self-test, counts: 48 mV, five times what a comparator is off.
const TEST_COUNTS: u16 = 60;
/// Time of a level to settle, and of the break filter, cycles: 3 us (data sheet: 1.7 us; 0.75 us).
const TEST_CYCLES: u32 = 3 * (super::clocks::CORE_HZ / 1_000_000);

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
    for watch in &WATCHES {
        watch.comparator.csr().write(|w| {
            w.set_inpsel(watch.pin);
            w.set_inmsel(watch.level);
            w.set_polarity(if watch.is_lower {
                comp::Polarity::INVERTED
            } else {
                comp::Polarity::NOT_INVERTED
            });
            w.set_en(true);
            w.set_lock(true);
        });
    }
}

/// Moves the level of each comparator to both sides of its signal, with an open bridge. Returns true if each one signals
/// on one side only, and reaches the break, whose flags the second argument clears. The first has the present counts of
/// both amplifiers.
#[inline(never)]
pub fn self_test([phase_a, phase_b]: [u16; 2], clear_breaks: fn()) -> bool {
    let mut are_good = true;
    for watch in &WATCHES {
        let counts = match watch.signal {
            Signal::Shunt(Phase::A) => phase_a,
            Signal::Shunt(Phase::B) => phase_b,
            Signal::Mean => phase_a.midpoint(phase_b),
        };
        let signals_at = |level: u16| {
            set_level(watch.converter, watch.channel, level);
            cortex_m::asm::delay(TEST_CYCLES);
            watch.comparator.csr().read().value()
        };
        let is_above = signals_at(counts.saturating_sub(TEST_COUNTS));
        let is_below = signals_at(counts.saturating_add(TEST_COUNTS));
        let breaks = pac::TIM1.sr().read().bif(0);
        set_levels(scales::CEILING_LEVELS);
        clear_breaks();
        if (is_above, is_below, breaks) != (!watch.is_lower, watch.is_lower, true) {
            defmt::error!("comparator {=u8} does not see its shunt: check its pin", watch.number);
            are_good = false;
        }
    }
    are_good
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
