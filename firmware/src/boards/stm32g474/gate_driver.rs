//! The gate driver, its fault and its enable.

use super::pins::{self, BREAK_FUNCTION};
use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::peripherals::TIM1;
use embassy_stm32::timer::complementary_pwm::ComplementaryPwmPin;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{BkIn1, BreakInputPin, Ch1, Ch2, Ch3};

/// A pin reports its fault to the break input.
pub const HAS_FAULT_INPUT: bool = true;

/// The gate driver.
pub struct GateDriver {
    break_pin: Flex<'static>,
    enable: Output<'static>,
}

impl GateDriver {
    /// Connects the bridge to its timer, which `set_up_timer` sets up while the gate driver sleeps. Returns the timer.
    pub fn connect(
        bridge: pins::Bridge,
        set_up_timer: impl FnOnce(),
    ) -> (Peri<'static, TIM1>, Self) {
        let enable = Output::new(bridge.enable, Level::Low, Speed::Low);
        set_up_timer();
        let mut break_pin = Flex::new(break_input(bridge.fault));
        break_pin.set_as_af_unchecked(BREAK_FUNCTION, AfType::input(Pull::Up));
        // The pins are connected to the timer only now that it holds them at their idle level, and stay
        // connected.
        let kind = OutputType::PushPull;
        core::mem::forget((
            PwmPin::<TIM1, Ch1>::new(bridge.a_high, kind),
            PwmPin::<TIM1, Ch2>::new(bridge.b_high, kind),
            PwmPin::<TIM1, Ch3>::new(bridge.c_high, kind),
            ComplementaryPwmPin::<TIM1, Ch1>::new(bridge.a_low, kind),
            ComplementaryPwmPin::<TIM1, Ch2>::new(bridge.b_low, kind),
            ComplementaryPwmPin::<TIM1, Ch3>::new(bridge.c_low, kind),
        ));
        (bridge.timer, Self { break_pin, enable })
    }

    /// Returns true if it reports a fault.
    #[inline(always)]
    pub fn is_faulty(&self) -> bool {
        self.break_pin.is_low()
    }

    /// Wakes it or puts it to sleep.
    #[inline(always)]
    pub fn set_awake(&mut self, awake: bool) {
        self.enable.set_level(awake.into());
    }
}

/// Returns the pin, which has the break input among its functions.
fn break_input<P: BreakInputPin<TIM1, BkIn1>>(pin: Peri<'static, P>) -> Peri<'static, P> {
    pin
}

/// Puts it to sleep without owning its pin.
pub fn put_to_sleep() {
    let (port, pin) = pins::GATE_ENABLE;
    port.bsrr().write(|w| w.set_br(pin, true));
}
