//! Overcurrent opens the bridge in hardware: a comparator at each shunt acts on the break input of the timer.
//!
//! The comparators see the voltage before the amplifiers, where an ampere is 1.7 mV. Their own offset and the resistors are
//! off by 6 A together. Each has one level, for a current out of the motor. The three currents add up to zero, so that a
//! current into the motor leaves through the two other phases, and opens the bridge at twice the level at the latest.
//!
//! The levels are at the board's ceiling until the parameters are read, and are set once more then. A set that is committed
//! later applies after a restart.

use super::{pins, scales};
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac::comp::{Comp, vals as comp};
use embassy_stm32::pac::dac::vals as dac;
use embassy_stm32::peripherals::DAC3;
use embassy_stm32::{pac, rcc};
use firmware::sensors::comparator::break_current_a;

/// DAC interface setting for a bus above 160 MHz (RM0440, DAC_MCR HFSEL).
const BUS_ABOVE_160_MHZ: u8 = 0b10;

/// Comparators connected to the break, by their number minus one.
pub const BREAK_COMPARATORS: [usize; 3] = [0, 1, 3];

/// Sets up levels and comparators, and locks the comparators until the next reset.
pub fn set_up(wired: pins::Overcurrent) {
    let mut pin = Flex::new(wired.shunt_c);
    pin.set_as_analog();
    core::mem::forget(pin);
    rcc::enable_and_reset::<DAC3>();
    set_level(scales::BREAK_CEILING_A);
    // DAC3 channel 1 is the level of COMP1, channel 2 that of COMP2 and COMP4.
    for comparator in [pac::COMP1, pac::COMP2, pac::COMP4] {
        set_up_comparator(comparator);
    }
}

/// Sets the levels for a joint whose current loop trips at `overcurrent_a`.
pub fn follow(overcurrent_a: f32) {
    set_level(break_current_a(overcurrent_a, scales::BREAK_CEILING_A));
}

fn set_level(current_a: f32) {
    let counts = scales::comparator_level(current_a);
    for channel in 0..2 {
        if !pac::DAC3.cr().read().en(channel) {
            pac::DAC3.mcr().modify(|w| {
                w.set_hfsel(BUS_ABOVE_160_MHZ);
                w.set_mode(channel, dac::Mode::NORMAL_INT_BUFDIS);
            });
        }
        pac::DAC3.dhr12r(channel).write(|w| w.set_dhr(counts));
        pac::DAC3.cr().modify(|w| w.set_en(channel, true));
    }
}

fn set_up_comparator(comparator: Comp) {
    comparator.csr().write(|w| {
        w.set_inpsel(false);
        w.set_inmsel(comp::Inm::DACA);
        w.set_polarity(comp::Polarity::NOT_INVERTED);
        w.set_en(true);
        w.set_lock(true);
    });
}
