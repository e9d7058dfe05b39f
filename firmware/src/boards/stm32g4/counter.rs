//! The counter of an ABZ encoder.
//!
//! A timer counts the edges of both lines (encoder mode 3) and captures its count at a rising edge of the index. Its input
//! filters reject pulses shorter than 8 cycles of its clock, 47 ns.

use super::pins::COUNTER as TIMER;
use embassy_stm32::pac::timer::vals;
use firmware::sensors::quadrature::Quadrature;

/// Starts the counter, whose clock and pins are enabled.
pub fn start() {
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
