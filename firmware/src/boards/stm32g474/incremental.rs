//! The inputs of an ABZ encoder and of Hall sensors.
//!
//! TIM20 counts the edges of both lines (encoder mode 3) and captures its count at a rising edge of the index. Its input
//! filters reject pulses shorter than 8 cycles of its clock, 47 ns. The Hall sensors are read from their port. All inputs
//! are pulled up, so that a missing plug reads as high: an illegal level of Hall sensors, and lines that do not change.
//!
//! The pins are not connected before the parameters select an encoder that needs them.

use super::pins;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::pac::timer::vals;
use embassy_stm32::peripherals::TIM20;
use embassy_stm32::timer::input_capture::CapturePin;
use embassy_stm32::{pac, rcc};
use firmware::sensors::encoder::EncoderKind;
use firmware::sensors::quadrature::Quadrature;

const TIMER: pac::timer::TimAdv = pac::TIM20;

/// Connects the inputs that this kind of encoder needs.
pub fn connect(kind: EncoderKind, wired: pins::Incremental) {
    if matches!(kind, EncoderKind::AbzHall | EncoderKind::Hall) {
        // They stay connected.
        core::mem::forget((
            Input::new(wired.hall_1, Pull::Up),
            Input::new(wired.hall_2, Pull::Up),
            Input::new(wired.hall_3, Pull::Up),
        ));
    }
    if matches!(kind, EncoderKind::Abz | EncoderKind::AbzHall) {
        core::mem::forget((
            CapturePin::<TIM20, _>::new(wired.a, Pull::Up),
            CapturePin::<TIM20, _>::new(wired.b, Pull::Up),
            CapturePin::<TIM20, _>::new(wired.index, Pull::Up),
        ));
        rcc::enable_and_reset::<TIM20>();
        start_timer();
    }
}

fn start_timer() {
    for (pair, channels) in [(0, [0, 1].as_slice()), (1, &[0])] {
        TIMER.ccmr_input(pair).write(|w| {
            for channel in channels {
                w.set_ccs(*channel, vals::CcmrInputCcs::TI4);
                w.set_icf(*channel, vals::FilterValue::FCK_INT_N8);
            }
        });
    }
    TIMER.smcr().write(|w| w.set_sms(vals::Sms::ENCODER_MODE_3));
    TIMER.ccer().write(|w| w.set_cce(2, true));
    TIMER.arr().write(|w| w.set_arr(u16::MAX));
    TIMER.cr1().write(|w| w.set_cen(true));
}

/// Returns what was counted and captured since the last call.
#[inline(always)]
pub fn read() -> Quadrature {
    let flags = TIMER.sr().read();
    // Before the count, so that an index in between is not ahead of it. Reading it clears its flag.
    let index = flags.ccif(2).then(|| TIMER.ccr(2).read().ccr());
    let count = TIMER.cnt().read().cnt();
    let has_double_edge = flags.terrif();
    if has_double_edge {
        // A flag is cleared by 0; 1 leaves it.
        TIMER.sr().write(|w| {
            w.0 = u32::MAX;
            w.set_terrif(false);
        });
    }
    Quadrature { count, index, has_double_edge }
}

/// Returns the levels of the Hall sensors.
#[inline(always)]
pub fn hall_levels() -> u8 {
    let (port, first) = pins::HALL;
    (port.idr().read().0 >> first) as u8 & 7
}
