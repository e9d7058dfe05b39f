//! The inputs of an ABZ encoder and of Hall sensors.
//!
//! TIM20 counts ([`super::counter`]). The Hall sensors are read from their port. All inputs
//! are pulled up, so that a missing plug reads as high: an illegal level of Hall sensors, and lines that do not change.
//!
//! The pins are not connected before the parameters select an encoder that needs them.

use super::{counter, pins};
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::peripherals::TIM20;
use embassy_stm32::rcc;
use embassy_stm32::timer::input_capture::CapturePin;
use embassy_stm32::timer::{Ch1, Ch2, Ch3};
use firmware::sensors::encoder::EncoderKind;
use firmware::sensors::quadrature::Quadrature;

/// Connects the inputs that this kind of encoder needs.
pub fn connect(kind: EncoderKind, wired: pins::Incremental) {
    // An ABZ encoder alone has them during commissioning.
    if matches!(kind, EncoderKind::Abz | EncoderKind::AbzHall | EncoderKind::Hall) {
        // They stay connected.
        core::mem::forget((
            Input::new(wired.hall_1, Pull::Up),
            Input::new(wired.hall_2, Pull::Up),
            Input::new(wired.hall_3, Pull::Up),
        ));
    }
    if matches!(kind, EncoderKind::Abz | EncoderKind::AbzHall) {
        core::mem::forget((
            CapturePin::<TIM20, Ch1>::new(wired.a, Pull::Up),
            CapturePin::<TIM20, Ch2>::new(wired.b, Pull::Up),
            CapturePin::<TIM20, Ch3>::new(wired.index, Pull::Up),
        ));
        rcc::enable_and_reset::<TIM20>();
        counter::start();
    }
}

/// Returns what was counted and captured since the last call.
#[inline(always)]
pub fn counts() -> Quadrature {
    counter::read()
}

/// Returns the levels of the Hall sensors.
#[inline(always)]
pub fn hall_levels() -> u8 {
    let (port, first) = pins::HALL;
    (port.idr().read().0 >> first) as u8 & 7
}
