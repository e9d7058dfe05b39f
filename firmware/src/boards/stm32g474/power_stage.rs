//! The bridge and what is sampled with it.
//!
//! TIM1 counts up and down; a half bridge's high side conducts while the count is below its compare value. At
//! the top all low sides conduct, half-way through a pause of the high sides: there the shunts are sampled,
//! by the timer itself, and there new duties count. So a period of the loop is from top to top; its duties act in
//! the next, whose middle is 1.5 periods after the sample, as the loop's parameters have it.
//!
//! *Off* is the main output enable (MOE) off: all six outputs go to their idle level, low, driven. The break
//! input does the same by hardware within a microsecond; software then finds the break flag and tells. MOE is
//! never set by hardware (no automatic re-enable), and dead time, idle levels and break are locked at the start.
//! Gate driver and overcurrent comparators ([`super::overcurrent`]) share that input. Who it was is told apart by the
//! gate driver's pin: it holds its fault until it has slept.
//!
//! The chip itself breaks too: a crystal that stops (CSS), a processor that locks up, flash or RAM whose check bits do
//! not fit, a supply below 2.8 V (PVD). Those are wired to the timer's break in SYSCFG before the break is locked, and
//! there they stay until the next reset, whatever the firmware does. The gate driver's enable is a second way off.

use super::scales::{DEAD_TIME, PWM_TOP};
use super::{overcurrent, pins};
use embassy_stm32::adc::{Adc, AdcChannel, Exten, InjectedAdc, SampleTime};
use embassy_stm32::gpio::{AfType, Flex, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::pac::timer::vals;
use embassy_stm32::peripherals::{ADC1, ADC2, TIM1};
use embassy_stm32::timer::complementary_pwm::ComplementaryPwmPin;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::triggers::TIM1_TRGO2;
use embassy_stm32::{Peri, pac, rcc};
use firmware::control::Broke;

/// Alternate function of the break input.
const BREAK_FUNCTION: u8 = 12;
const TIMER: pac::timer::TimAdv = pac::TIM1;

/// Level of the supply that opens the bridge: 2.8 V (PWR_CR2, PLS), 0.1 V above the highest brown-out level and 15 %
/// below the nominal 3.3 V, to which a regulator holds it.
const SUPPLY_LEVEL: u8 = 0b101;

/// Raw counts of a period.
#[derive(Clone, Copy)]
pub struct Counts {
    pub phase_a: u16,
    pub phase_b: u16,
    pub bus: u16,
}

/// The bridge, closed by nobody but [`Stage::drive`].
pub struct Stage {
    adc_a: InjectedAdc<'static, ADC1, 2>,
    adc_b: InjectedAdc<'static, ADC2, 1>,
    _timer: Peri<'static, TIM1>,
    break_pin: Flex<'static>,
    enable: Output<'static>,
}

impl Stage {
    /// Sets everything up; the bridge is off, the gate driver asleep, the timer not started.
    pub fn new(
        bridge: pins::Bridge,
        currents: pins::Currents,
        overcurrent: pins::Overcurrent,
    ) -> Self {
        let enable = Output::new(bridge.enable, Level::Low, Speed::Low);
        rcc::enable_and_reset::<TIM1>();
        overcurrent::set_up(overcurrent);
        set_up_timer();
        let mut break_pin = Flex::new(bridge.fault);
        break_pin.set_as_af_unchecked(BREAK_FUNCTION, AfType::input(Pull::Up));
        // The pins become the timer's only now that it holds them at their idle level. They stay so for good.
        let kind = OutputType::PushPull;
        core::mem::forget((
            PwmPin::<TIM1, _>::new(bridge.a_high, kind),
            PwmPin::<TIM1, _>::new(bridge.b_high, kind),
            PwmPin::<TIM1, _>::new(bridge.c_high, kind),
            ComplementaryPwmPin::<TIM1, _>::new(bridge.a_low, kind),
            ComplementaryPwmPin::<TIM1, _>::new(bridge.b_low, kind),
            ComplementaryPwmPin::<TIM1, _>::new(bridge.c_low, kind),
        ));
        // 42.5 MHz: a current is held for 0.3 us, and the slower bus divider comes after it.
        let adc_a = Adc::new(currents.adc_a, Default::default()).setup_injected_conversions(
            [
                (currents.phase_a.degrade_adc(), SampleTime::CYCLES12_5),
                (currents.bus.degrade_adc(), SampleTime::CYCLES24_5),
            ],
            TIM1_TRGO2,
            Exten::RISING_EDGE,
            true,
        );
        let adc_b = Adc::new(currents.adc_b, Default::default()).setup_injected_conversions(
            [(currents.phase_b.degrade_adc(), SampleTime::CYCLES12_5)],
            TIM1_TRGO2,
            Exten::RISING_EDGE,
            false,
        );
        Self { adc_a, adc_b, _timer: bridge.timer, break_pin, enable }
    }

    /// Starts the timer and wakes the gate driver. Says whether duties count from the top on, as they should.
    pub fn start(&mut self) -> bool {
        TIMER.cr1().modify(|w| w.set_cen(true));
        let at_top = count_duties_from_the_top();
        self.enable.set_high();
        at_top
    }

    /// Waits for a conversion, without the interrupt: for the start.
    pub fn wait(&mut self) -> Counts {
        while !self.is_due() {}
        self.counts()
    }

    /// Whether a conversion is there; asks once.
    #[inline(always)]
    pub fn is_due(&mut self) -> bool {
        let due = pac::ADC1.isr().read().jeos();
        if due {
            pac::ADC1.isr().write(|w| {
                w.set_jeos(true);
                w.set_jeoc(true);
            });
        }
        due
    }

    /// The counts converted last. Phase b is converted in the time of phase a.
    #[inline(always)]
    pub fn counts(&mut self) -> Counts {
        let [phase_a, bus] = self.adc_a.read_injected_samples();
        let [phase_b] = self.adc_b.read_injected_samples();
        Counts { phase_a, phase_b, bus }
    }

    /// Cycles since the last top: since the sample.
    #[inline(always)]
    pub fn since_trigger(&self) -> u32 {
        since_top()
    }

    /// Whether the gate driver, a comparator or the chip has opened the bridge, or would.
    #[inline(always)]
    pub fn broke(&self) -> Option<Broke> {
        let flags = TIMER.sr().read();
        match (flags.sbif(), flags.bif(0)) {
            (true, _) => Some(Broke::System),
            (_, true) if self.break_pin.is_low() => Some(Broke::GateDriver),
            (_, true) => Some(Broke::Overcurrent),
            _ => None,
        }
    }

    /// Wakes the gate driver, or puts it to sleep.
    #[inline(always)]
    pub fn wake(&mut self, awake: bool) {
        self.enable.set_level(awake.into());
    }

    /// Sets the duties of the next period; closes the bridge where it is open and nothing broke it.
    #[inline(always)]
    pub fn drive(&mut self, duty: [f32; 3]) {
        set_duties(duty);
        if self.broke().is_none() && !TIMER.bdtr().read().moe() {
            TIMER.bdtr().modify(|w| w.set_moe(true));
        }
    }

    /// Opens all switches at once. When they close again, it is with no voltage.
    #[inline(always)]
    pub fn off(&mut self) {
        TIMER.bdtr().modify(|w| w.set_moe(false));
        set_duties([0.5; 3]);
        // Stays up while the input is still active.
        TIMER.sr().write(|w| {
            w.0 = u32::MAX;
            w.set_bif(0, false);
            w.set_sbif(false);
        });
    }
}

/// Opens all switches both ways at once: for whoever is about to end this life, and has nothing but registers.
pub fn open_bridge() {
    TIMER.bdtr().modify(|w| w.set_moe(false));
    let (port, pin) = pins::GATE_ENABLE;
    port.bsrr().write(|w| w.set_br(pin, true));
}

/// A break that was the store's own, a read of a double word torn by a loss of power, is none of the bridge's.
pub fn forget_system_break() {
    TIMER.sr().write(|w| {
        w.0 = u32::MAX;
        w.set_sbif(false);
    });
}

/// Cycles since the last top of the PWM: since the currents were sampled.
#[inline(always)]
pub fn since_top() -> u32 {
    let (top, count) = (u32::from(PWM_TOP), u32::from(TIMER.cnt().read().cnt()));
    if TIMER.cr1().read().dir() == vals::Dir::DOWN {
        top.saturating_sub(count)
    } else {
        top + count
    }
}

#[inline(always)]
fn set_duties(duty: [f32; 3]) {
    for (channel, duty) in duty.into_iter().enumerate() {
        // A cast holds to the range, and takes NaN for 0.
        let compare = (duty * f32::from(PWM_TOP)) as u16;
        TIMER.ccr(channel).write(|w| w.set_ccr(compare.min(PWM_TOP)));
    }
}

/// What of the chip itself opens the bridge. Each of these bits can be set once and cleared by a reset alone.
fn wire_chip_faults_to_break() {
    pac::PWR.cr2().write(|w| {
        w.set_pls(SUPPLY_LEVEL);
        w.set_pvde(true);
    });
    // A crystal that stops: the timer breaks, the core goes on with its own oscillator, NMI tells.
    pac::RCC.cr().modify(|w| w.set_csson(true));
    pac::SYSCFG.cfgr2().modify(|w| {
        w.set_cll(true);
        w.set_spl(true);
        w.set_pvdl(true);
        w.set_eccl(true);
    });
}

fn set_up_timer() {
    wire_chip_faults_to_break();
    // A halt in the debugger opens the bridge, or the last duties would stand.
    pac::DBGMCU.apb2fzr().modify(|w| w.set_tim1(true));
    TIMER.cr1().write(|w| {
        w.set_cms(vals::Cms::CENTER_ALIGNED1);
        w.set_arpe(true);
    });
    TIMER.psc().write_value(0);
    TIMER.arr().write(|w| w.set_arr(PWM_TOP));
    for channel in 0..4 {
        TIMER.ccmr_output(channel / 2).modify(|w| {
            let high_when_above = channel == 3;
            let mode = if high_when_above { vals::Ocm::PWM_MODE2 } else { vals::Ocm::PWM_MODE1 };
            w.set_ocm(channel % 2, mode);
            w.set_ocpe(channel % 2, true);
        });
    }
    set_duties([0.5; 3]);
    // Channel 4 has no pin: it rises a count before the top, and starts the conversions.
    TIMER.ccr(3).write(|w| w.set_ccr(PWM_TOP - 1));
    TIMER.cr2().write(|w| w.set_mms2(vals::Mms2::COMPARE_OC4));
    TIMER.ccer().write(|w| {
        for channel in 0..3 {
            w.set_cce(channel, true);
            w.set_ccne(channel, true);
        }
        w.set_cce(3, true);
    });
    // One input of several sources, high when one of them is: the gate driver's pin is turned.
    TIMER.af1().write(|w| {
        w.set_bkine(true);
        w.set_bkinp(vals::Bkinp::INVERTED);
        overcurrent::AT_BREAK.into_iter().for_each(|comparator| w.set_bkcmpe(comparator, true));
    });
    TIMER.bdtr().write(|w| {
        w.set_dtg(DEAD_TIME);
        // Off is driven low, and not left floating.
        w.set_ossi(vals::Ossi::IDLE_LEVEL);
        w.set_ossr(vals::Ossr::IDLE_LEVEL);
        w.set_bke(0, true);
        w.set_bkp(0, vals::Bkp::ACTIVE_HIGH);
        // 8 samples at a sixteenth of the timer's clock, 0.75 us: switching rings for some tenths.
        w.set_bkf(0, vals::FilterValue::FDTS_DIV16_N8);
        w.set_aoe(false);
        w.set_moe(false);
        w.set_lock(vals::Lock::LEVEL1);
    });
    TIMER.egr().write(|w| w.set_ug(true));
}

/// Duties count from every second turning point on; which of the two is settled by when the counter of
/// turning points was written. So it is written until they count from the top.
fn count_duties_from_the_top() -> bool {
    for _ in 0..8 {
        TIMER.rcr().write(|w| w.set_rep(1));
        // The one under way was counted with the old value.
        for _ in 0..2 {
            TIMER.sr().modify(|w| {
                w.0 = u32::MAX;
                w.set_uif(false);
            });
            while !TIMER.sr().read().uif() {}
        }
        if TIMER.cr1().read().dir() == vals::Dir::DOWN {
            return true;
        }
        // One turning point with the other count moves the next by one.
        TIMER.rcr().write(|w| w.set_rep(0));
        TIMER.sr().modify(|w| {
            w.0 = u32::MAX;
            w.set_uif(false);
        });
        while !TIMER.sr().read().uif() {}
    }
    false
}
