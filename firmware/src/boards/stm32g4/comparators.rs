//! Comparators with a level of an internal DAC, and their test before the first PWM.
//!
//! A comparator whose input is not wired to its signal, or whose output does not reach the break, would be found only by the
//! current that it should have stopped. [`Watch::sees_signal`] moves its level over the signal instead.

use embassy_stm32::pac;
use embassy_stm32::pac::comp::{Comp, vals as comp};
use embassy_stm32::pac::dac::{Dac, vals as dac};

/// DAC interface setting for a bus above 160 MHz (RM0440, DAC_MCR HFSEL).
const BUS_ABOVE_160_MHZ: u8 = 0b10;

/// Distance of a level from its signal in the test, counts: 48 mV, five times what a comparator is off.
const TEST_COUNTS: u16 = 60;
/// Time of a level to settle, and of the break filter, cycles: 3 us (data sheet: 1.7 us; 0.75 us).
const TEST_CYCLES: u32 = 3 * (super::clocks::CORE_HZ / 1_000_000);

/// A comparator, with its input and the DAC channel of its level. `S` is what a board tells of its signal.
pub struct Watch<S> {
    pub number: u8,
    pub comparator: Comp,
    pub signal: S,
    /// Selects the second of its two input pins.
    pub is_second_pin: bool,
    pub level: comp::Inm,
    pub converter: Dac,
    pub channel: u8,
    /// It signals below its level: its output is inverted.
    pub is_lower: bool,
}

impl<S> Watch<S> {
    /// Switches the comparator on, and locks it until the next reset. Its level is set before.
    pub fn set_up(&self) {
        self.comparator.csr().write(|w| {
            w.set_inpsel(self.is_second_pin);
            w.set_inmsel(self.level);
            w.set_polarity(if self.is_lower {
                comp::Polarity::INVERTED
            } else {
                comp::Polarity::NOT_INVERTED
            });
            w.set_en(true);
            w.set_lock(true);
        });
    }

    /// Moves the level to both sides of the signal, which has these counts, with an open bridge. Returns true if the comparator
    /// signals on one side only, and reaches the break. The caller restores the level and clears the break.
    pub fn sees_signal(&self, counts: u16) -> bool {
        let signals_at = |level: u16| {
            set_level(self.converter, self.channel, level);
            cortex_m::asm::delay(TEST_CYCLES);
            self.comparator.csr().read().value()
        };
        let is_above = signals_at(counts.saturating_sub(TEST_COUNTS));
        let is_below = signals_at(counts.saturating_add(TEST_COUNTS));
        let breaks = pac::TIM1.sr().read().bif(0);
        let is_good = (is_above, is_below, breaks) == (!self.is_lower, self.is_lower, true);
        if !is_good {
            defmt::error!("comparator {=u8} does not see its shunt: check its pin", self.number);
        }
        is_good
    }
}

/// Sets the output of a DAC channel, which it switches on first.
#[inline(never)]
pub fn set_level(converter: Dac, channel: u8, counts: u16) {
    let channel = usize::from(channel);
    if !converter.cr().read().en(channel) {
        converter.mcr().modify(|w| {
            w.set_hfsel(BUS_ABOVE_160_MHZ);
            w.set_mode(channel, dac::Mode::NORMAL_INT_BUFDIS);
        });
    }
    converter.dhr12r(channel).write(|w| w.set_dhr(counts));
    converter.cr().modify(|w| w.set_en(channel, true));
}
