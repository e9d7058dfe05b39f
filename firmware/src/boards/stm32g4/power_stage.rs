//! The bridge and the conversions that are synchronous with it.
//!
//! TIM1 counts up and down; the high side of a half bridge conducts while the count is below its compare
//! value. At the top all low sides conduct, in the middle of their on-time. There the timer triggers the
//! conversions of the shunts, and new duties take effect. A period of the loop is therefore from top to
//! top. Its duties act in the next period, whose middle is 1.5 periods after the sample, as the parameters
//! of the loop assume.
//!
//! *Off* means that the main output enable (MOE) is cleared: all six outputs are driven to their idle
//! level, low. The break input does the same in hardware within a microsecond; software then finds the
//! break flag and reports it. Hardware never sets MOE (no automatic output enable). Dead time, idle levels
//! and break are locked at the start. Gate driver ([`super::gate_driver`]) and overcurrent comparators
//! ([`super::overcurrent`]) share the break input. The pin of the gate driver distinguishes them, because it holds its fault
//! until the driver has slept.
//!
//! The chip itself can also break: on a crystal failure (CSS), a processor lockup, an ECC or parity error,
//! or a supply below 2.9 V (PVD). SYSCFG connects these to the break of the timer before the break is
//! locked, and they stay connected until the next reset. The enable of a gate driver is a second, independent
//! way to switch off.

use super::gate_driver::{self, GateDriver, HAS_FAULT_INPUT};
use super::scales::{DEAD_TIME, PWM_TOP};
use super::{overcurrent, pins, sampling};
use embassy_stm32::pac::timer::vals;
use embassy_stm32::peripherals::TIM1;
use embassy_stm32::{Peri, pac, rcc};
use firmware::control::BridgeFault;

const TIMER: pac::timer::TimAdv = pac::TIM1;

/// Supply level that opens the bridge: 2.84 to 2.96 V (PWR_CR2, PLS; data sheet: V_PVD6 falling), the highest
/// of the chip and 10 % below the regulated 3.3 V. It is at least 0.27 V above the brown-out level that the
/// board requires, so that the driver reports the cause before the reset.
const SUPPLY_BREAK_LEVEL: u8 = 0b110;

/// Raw counts of one period.
#[derive(Clone, Copy)]
pub struct Counts {
    pub phase_a: u16,
    pub phase_b: u16,
    pub bus: u16,
}

/// The bridge. Only [`Stage::drive`] closes it.
pub struct Stage {
    _timer: Peri<'static, TIM1>,
    gate_driver: GateDriver,
}

impl Stage {
    /// Sets up bridge and converters. The bridge is off, the gate driver asleep and the timer stopped.
    pub fn new(
        bridge: pins::Bridge,
        currents: pins::Currents,
        overcurrent: pins::Overcurrent,
    ) -> Self {
        let (timer, gate_driver) = GateDriver::connect(bridge, || {
            rcc::enable_and_reset::<TIM1>();
            overcurrent::set_up(overcurrent);
            set_up_timer();
        });
        sampling::start(currents);
        Self { _timer: timer, gate_driver }
    }

    /// Starts the timer and wakes the gate driver. Returns true if duties take effect at the top, as
    /// required.
    pub fn start(&mut self) -> bool {
        TIMER.cr1().modify(|w| w.set_cen(true));
        let is_aligned = align_updates_to_top();
        self.gate_driver.set_awake(true);
        is_aligned
    }

    /// Waits for a conversion by polling, for the start.
    pub fn wait(&mut self) -> Counts {
        while !self.is_due() {}
        self.counts()
    }

    /// Returns true if a conversion is complete, and clears its flag.
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

    /// Returns the latest counts. Phases a and b are converted simultaneously.
    #[inline(always)]
    pub fn counts(&mut self) -> Counts {
        // Read directly: embassy would also clear the flags, which costs six register accesses.
        Counts {
            phase_a: pac::ADC1.jdr(0).read().jdata(),
            phase_b: pac::ADC2.jdr(0).read().jdata(),
            bus: sampling::BUS_CONVERTER.jdr(1).read().jdata(),
        }
    }

    /// Returns the cycles since the last top, that is since the sample.
    #[inline(always)]
    pub fn since_trigger(&self) -> u32 {
        since_top()
    }

    /// Returns the source that has opened the bridge, or would open it.
    #[inline(always)]
    pub fn bridge_fault(&self) -> Option<BridgeFault> {
        let flags = TIMER.sr().read();
        match (flags.sbif(), flags.bif(0)) {
            (true, _) => Some(BridgeFault::System),
            (_, true) if self.gate_driver.is_faulty() => Some(BridgeFault::GateDriver),
            (_, true) => Some(BridgeFault::Overcurrent),
            _ => None,
        }
    }

    /// Wakes the gate driver or puts it to sleep.
    #[inline(always)]
    pub fn set_awake(&mut self, awake: bool) {
        self.gate_driver.set_awake(awake);
    }

    /// Sets the duties of the next period. Closes the bridge if it is open and no break is active.
    #[inline(always)]
    pub fn drive(&mut self, duty: [f32; 3]) {
        set_duties(duty);
        if self.bridge_fault().is_none() && !TIMER.bdtr().read().moe() {
            TIMER.bdtr().modify(|w| w.set_moe(true));
        }
    }

    /// Closes all low sides and opens all high sides from the next period on: the motor brakes through its own
    /// resistance. As [`Stage::drive`], it closes the bridge only if no break is active.
    ///
    /// The shunts carry the braking current, so the comparators stay in effect.
    #[inline(always)]
    pub fn brake(&mut self) {
        self.drive([0.0; 3]);
    }

    /// Opens all switches at once. When they close again, the voltage is zero.
    #[inline(always)]
    pub fn off(&mut self) {
        TIMER.bdtr().modify(|w| w.set_moe(false));
        set_duties([0.5; 3]);
        clear_breaks();
    }
}

/// Clears the flags of the break, each of which stays set while its input is active.
#[inline(always)]
pub fn clear_breaks() {
    TIMER.sr().write(|w| {
        w.0 = u32::MAX;
        w.set_bif(0, false);
        w.set_sbif(false);
    });
}

/// Opens all switches in every way, with register accesses only: for panics and faults.
pub fn open_bridge() {
    TIMER.bdtr().modify(|w| w.set_moe(false));
    gate_driver::put_to_sleep();
}

/// Clears a system break caused by a read of the parameter store, which does not concern the bridge.
pub fn clear_system_break() {
    TIMER.sr().write(|w| {
        w.0 = u32::MAX;
        w.set_sbif(false);
    });
}

/// Returns the cycles since the last top of the PWM, that is since the currents were sampled.
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
    let set = |channel: usize, duty: f32| {
        // The cast saturates and converts NaN to 0.
        let compare = (duty * f32::from(PWM_TOP)) as u16;
        TIMER.ccr(channel).write(|w| w.set_ccr(compare.min(PWM_TOP)));
    };
    // Written out, because a loop costs the interrupt 40 cycles more.
    let [a, b, c] = duty;
    set(0, a);
    set(1, b);
    set(2, c);
}

/// Connects faults of the chip to the break. Only a reset clears these bits.
fn wire_chip_faults_to_break() {
    pac::PWR.cr2().write(|w| {
        w.set_pls(SUPPLY_BREAK_LEVEL);
        w.set_pvde(true);
    });
    // If the crystal stops, the timer breaks, the core continues with its internal oscillator, and the NMI
    // reports it.
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
    // A debugger halt opens the bridge; otherwise the last duties would persist.
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
    // Channel 4 has no pin: it rises one count before the top and starts the conversions.
    TIMER.ccr(3).write(|w| w.set_ccr(PWM_TOP - 1));
    TIMER.cr2().write(|w| {
        w.set_mms2(vals::Mms2::COMPARE_OC4);
        // The encoder's timer starts with this one.
        w.set_mms(vals::Mms::ENABLE);
    });
    TIMER.ccer().write(|w| {
        for channel in 0..3 {
            w.set_cce(channel, true);
            w.set_ccne(channel, true);
        }
        w.set_cce(3, true);
    });
    // One active-high input with several sources; the pin of the gate driver is inverted.
    TIMER.af1().write(|w| {
        w.set_bkine(HAS_FAULT_INPUT);
        w.set_bkinp(vals::Bkinp::INVERTED);
        overcurrent::BREAK_COMPARATORS
            .into_iter()
            .for_each(|comparator| w.set_bkcmpe(comparator, true));
    });
    TIMER.bdtr().write(|w| {
        w.set_dtg(DEAD_TIME);
        // The outputs are driven low when off, not left floating.
        w.set_ossi(vals::Ossi::IDLE_LEVEL);
        w.set_ossr(vals::Ossr::IDLE_LEVEL);
        w.set_bke(0, true);
        w.set_bkp(0, vals::Bkp::ACTIVE_HIGH);
        // 8 samples at 1/16 of the timer clock, 0.75 us: switching rings for some tenths of a microsecond.
        w.set_bkf(0, vals::FilterValue::FDTS_DIV16_N8);
        w.set_aoe(false);
        w.set_moe(false);
        w.set_lock(vals::Lock::LEVEL1);
    });
    TIMER.egr().write(|w| w.set_ug(true));
}

/// Makes the duties take effect at the top. They are updated at every second turning point; which of the
/// two depends on the moment at which the repetition counter is written. It is therefore written until the
/// updates occur at the top.
fn align_updates_to_top() -> bool {
    for _ in 0..8 {
        TIMER.rcr().write(|w| w.set_rep(1));
        // The current repetition still uses the old value.
        for _ in 0..2 {
            TIMER.sr().modify(|w| {
                w.0 = u32::MAX;
                w.set_uif(false);
            });
            while !TIMER.sr().read().uif() {}
        }
        // By the count, which is half a period away from the other turning point. The direction changes at this very point.
        if TIMER.cnt().read().cnt() > PWM_TOP / 2 {
            return true;
        }
        // One repetition with the other count shifts the update by one turning point.
        TIMER.rcr().write(|w| w.set_rep(0));
        TIMER.sr().modify(|w| {
            w.0 = u32::MAX;
            w.set_uif(false);
        });
        while !TIMER.sr().read().uif() {}
    }
    false
}
