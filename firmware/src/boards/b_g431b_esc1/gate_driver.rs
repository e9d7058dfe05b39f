//! The gate drivers: three L6387 without enable and without fault output.
//!
//! Nothing puts them to sleep. While the bridge is off, all six inputs are low, which opens all switches.

use super::pins;
use embassy_stm32::Peri;
use embassy_stm32::gpio::OutputType;
use embassy_stm32::peripherals::TIM1;
use embassy_stm32::timer::complementary_pwm::ComplementaryPwmPin;
use embassy_stm32::timer::simple_pwm::PwmPin;

/// The break input has no pin: only the comparators and the chip open the bridge.
pub const HAS_FAULT_INPUT: bool = false;

/// The gate drivers.
pub struct GateDriver;

impl GateDriver {
    /// Connects the bridge to its timer, which `set_up_timer` sets up first. Returns the timer.
    pub fn connect(
        bridge: pins::Bridge,
        set_up_timer: impl FnOnce(),
    ) -> (Peri<'static, TIM1>, Self) {
        set_up_timer();
        // The timer holds them at their idle level, and they stay connected.
        let kind = OutputType::PushPull;
        core::mem::forget((
            PwmPin::<TIM1, _>::new(bridge.a_high, kind),
            PwmPin::<TIM1, _>::new(bridge.b_high, kind),
            PwmPin::<TIM1, _>::new(bridge.c_high, kind),
            ComplementaryPwmPin::<TIM1, _>::new(bridge.a_low, kind),
            ComplementaryPwmPin::<TIM1, _>::new(bridge.b_low, kind),
            ComplementaryPwmPin::<TIM1, _>::new(bridge.c_low, kind),
        ));
        (bridge.timer, Self)
    }

    /// Returns true if it reports a fault: it cannot.
    #[inline(always)]
    pub const fn is_faulty(&self) -> bool {
        false
    }

    /// Has no effect: the bridge alone opens the switches.
    #[inline(always)]
    pub const fn set_awake(&mut self, _awake: bool) {}
}

/// Has no effect: the bridge alone opens the switches.
pub const fn put_to_sleep() {}
