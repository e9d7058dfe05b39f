//! The supervisor: may the bridge be on, may friction be compensated, and if not, why.
//!
//! A joint starts [`State::Safe`]: bridge off, compensation off. It is armed by an explicit request and by
//! nothing else, and only while no cause to stop is there. A *fault* (stopped because) takes it to
//! [`State::Fault`] and is held after its cause has gone, until somebody asks for it to be cleared;
//! cleared, the joint is safe, not armed. A *limit* (still running, but held back by) comes and goes
//! with its cause, and stops nothing; some limits take the compensation away while they last. All of
//! them, with their numbers on the bus, when they come and how they go, are the one table in [`codes`].
//!
//! The supervisor is pure: it reads no clock and no pin. What was measured comes as an [`Observation`]
//! once a millisecond or so, time with it; most causes have to last before they count and have to be
//! gone for a while before they count as gone. What cannot wait for the next observation is told by the
//! interrupt that saw it, at once: [`Supervisor::loop_overrun`] takes the compensation away within the very
//! period, and [`Supervisor::trip`] the bridge. If observations themselves stop, that is for the
//! hardware watchdog: the supervisor does not run then.

pub mod codes;
mod conditions;
pub mod observation;
pub mod thresholds;

pub use codes::{CODES, Code, CodeSet, Effect, Info, Watched, Words};
pub use observation::{Boot, CanState, InUse, Observation, ResetCause};
pub use thresholds::Thresholds;

use crate::store::Health;
use compensator_core::parameters::ParameterError;
use conditions::Sight;
use core::fmt;
use heapless::Deque;

/// Events that wait to be taken, at most; older ones are dropped first.
pub const EVENTS: usize = 32;

/// Arming needs an observation no older than this, us.
pub const OBSERVATION_MAX_US: u64 = 20_000;

/// What the joint may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Bridge off, waiting to be armed.
    Safe,
    /// Bridge on.
    Armed,
    /// Bridge off, until faults are cleared.
    Fault,
}

/// A code that came or went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// Which.
    pub code: Code,
    /// Whether it came; a fault goes when it is cleared, a limit when its cause is gone.
    pub raised: bool,
}

/// Why a request to arm was refused: everything that stands against it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Faults that were not cleared, and causes of faults that are there.
    pub causes: CodeSet,
    /// There was no observation in the last [`OBSERVATION_MAX_US`].
    pub unobserved: bool,
    /// Bus voltage or phase currents are not measured at all.
    pub unmeasured: bool,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not armed:")?;
        for code in self.causes.iter() {
            write!(f, " {}", code.info().name)?;
        }
        if self.unobserved {
            f.write_str(" unobserved")?;
        }
        if self.unmeasured {
            f.write_str(" unmeasured")?;
        }
        Ok(())
    }
}

impl core::error::Error for Refusal {}

/// The supervisor of one joint.
#[derive(Clone, Debug)]
pub struct Supervisor {
    thresholds: Thresholds,
    armed: bool,
    /// Causes that are there now, after their delays.
    present: CodeSet,
    /// Faults that were not cleared.
    latched: CodeSet,
    /// Codes whose cause is on its way in or out, and since when, us.
    changing: CodeSet,
    since_us: [u64; CODES],
    counts: [u32; CODES],
    events: Deque<Event, EVENTS>,
    events_lost: u32,
    last_us: Option<u64>,
    measured: bool,
    command_us: Option<u64>,
    overruns: u32,
    overruns_in_a_row: u32,
    overrun_since_observed: bool,
    current_share: f32,
}

impl Supervisor {
    /// Starts safe, with what the last life left behind. Thresholds that are refused give way to the
    /// default ones, and [`Code::ParametersRefused`] says so.
    pub fn boot(thresholds: &Thresholds, boot: &Boot) -> Self {
        let sound = thresholds.validate().is_ok();
        let mut supervisor = Self {
            thresholds: if sound { *thresholds } else { Thresholds::default() },
            armed: false,
            present: CodeSet::EMPTY,
            latched: CodeSet::EMPTY,
            changing: CodeSet::EMPTY,
            since_us: [0; CODES],
            counts: [0; CODES],
            events: Deque::new(),
            events_lost: 0,
            last_us: None,
            measured: false,
            command_us: None,
            overruns: 0,
            overruns_in_a_row: 0,
            overrun_since_observed: false,
            current_share: 1.0,
        };
        // These are over: nothing is left of them but that they were.
        for (happened, code) in [
            (boot.reset == ResetCause::Watchdog, Code::WatchdogReset),
            (boot.panicked, Code::PanicBeforeReset),
            (boot.stack_overflowed, Code::StackOverflow),
        ] {
            if happened {
                supervisor.trip(code);
            }
        }
        supervisor.self_test(boot.self_test_passed);
        supervisor.store(boot.store);
        supervisor.commissioned(boot.commissioned);
        supervisor.parameters(if sound { boot.parameters } else { InUse::DefaultRefused });
        supervisor
    }

    /// Swaps the thresholds, whole.
    ///
    /// # Errors
    /// Names the field that is refused; the thresholds in force stay.
    pub fn configure(&mut self, thresholds: &Thresholds) -> Result<(), ParameterError> {
        thresholds.validate()?;
        self.thresholds = *thresholds;
        Ok(())
    }

    /// The thresholds in force.
    pub fn thresholds(&self) -> &Thresholds {
        &self.thresholds
    }

    /// Takes in what was measured since the last observation. Call it once a millisecond or so.
    pub fn observe(&mut self, observation: &Observation, now_us: u64) {
        if self.last_us.is_some_and(|last_us| now_us < last_us) {
            // Delays and timeouts mean nothing on a clock that runs backwards.
            self.trip(Code::Internal);
            self.changing = CodeSet::EMPTY;
        }
        self.last_us = Some(now_us);
        self.measured =
            observation.bus_voltage_v.is_some() && observation.phase_currents_a.is_some();
        self.current_share = conditions::current_share(&self.thresholds, observation);
        for (index, code) in Code::ALL.iter().copied().enumerate() {
            let sight = conditions::look(self, code, observation, now_us);
            self.weigh(index, code, sight, now_us);
        }
        self.overrun_since_observed = false;
    }

    /// Lets a cause count when it has lasted, and go when it has been gone for long enough.
    fn weigh(&mut self, index: usize, code: Code, sight: Sight, now_us: u64) {
        let present = self.present.contains(code);
        let turned = match sight {
            Sight::Reported => return,
            Sight::Bad => !present,
            Sight::Good => present,
            Sight::Between => false,
        };
        if !turned {
            self.changing.remove(code);
            return;
        }
        let Some(since_us) = self.since_us.get_mut(index) else { return };
        if !self.changing.contains(code) {
            self.changing.insert(code);
            *since_us = now_us;
        }
        let info = code.info();
        let delay_us = if present { info.clear_after_us } else { info.raise_after_us };
        if now_us.saturating_sub(*since_us) >= u64::from(delay_us) {
            self.set_present(code, !present);
        }
    }

    fn set_present(&mut self, code: Code, present: bool) {
        self.changing.remove(code);
        if present == self.present.contains(code) {
            return;
        }
        let info = code.info();
        if present {
            self.present.insert(code);
        } else {
            self.present.remove(code);
        }
        if info.effect == Effect::Stops {
            if present && (self.armed || info.watched == Watched::Always) {
                self.latch(code);
            }
        } else {
            if present {
                self.count(code);
            }
            self.publish(code, present);
        }
    }

    fn latch(&mut self, code: Code) {
        self.armed = false;
        if !self.latched.contains(code) {
            self.latched.insert(code);
            self.count(code);
            self.publish(code, true);
        }
    }

    fn count(&mut self, code: Code) {
        if let Some(count) = self.counts.get_mut(code.index()) {
            *count = count.saturating_add(1);
        }
    }

    fn publish(&mut self, code: Code, raised: bool) {
        if self.events.is_full() {
            let _ = self.events.pop_front();
            self.events_lost = self.events_lost.saturating_add(1);
        }
        let _ = self.events.push_back(Event { code, raised });
    }

    /// A set-point came.
    pub fn command_received(&mut self, now_us: u64) {
        self.command_us = Some(now_us);
    }

    /// Switches the bridge on. Armed already, it stays so.
    ///
    /// # Errors
    /// Names everything that stands against it; nothing has changed then.
    pub fn arm(&mut self, now_us: u64) -> Result<(), Refusal> {
        self.arm_in_spite_of(CodeSet::EMPTY, now_us)
    }

    /// As [`Supervisor::arm`], for the driver to find out how it is wired: that nobody has confirmed it yet does not stand
    /// against it.
    ///
    /// # Errors
    /// As there.
    pub fn arm_to_commission(&mut self, now_us: u64) -> Result<(), Refusal> {
        let mut unconfirmed = CodeSet::EMPTY;
        unconfirmed.insert(Code::NotCommissioned);
        self.arm_in_spite_of(unconfirmed, now_us)
    }

    fn arm_in_spite_of(&mut self, passed_over: CodeSet, now_us: u64) -> Result<(), Refusal> {
        if self.armed {
            return Ok(());
        }
        let stopping = |code: &Code| code.info().effect == Effect::Stops;
        let mut causes = self.latched;
        let present = self.present.without(passed_over);
        present.iter().filter(stopping).for_each(|code| causes.insert(code));
        // Not what the last observation saw: now.
        if self.command_is_late(now_us) {
            causes.insert(Code::CommandTimeout);
        } else if !self.latched.contains(Code::CommandTimeout) {
            self.set_present(Code::CommandTimeout, false);
            causes.remove(Code::CommandTimeout);
        }
        let fresh = self
            .last_us
            .is_some_and(|last_us| now_us >= last_us && now_us - last_us <= OBSERVATION_MAX_US);
        let refusal = Refusal { causes, unobserved: !fresh, unmeasured: !self.measured };
        if !causes.is_empty() || refusal.unobserved || refusal.unmeasured {
            return Err(refusal);
        }
        self.armed = true;
        Ok(())
    }

    /// Switches the bridge off. Always heard.
    pub fn disarm(&mut self) {
        self.armed = false;
    }

    /// Clears the faults whose cause is gone. The joint is then safe, not armed.
    ///
    /// # Errors
    /// The faults that stay, because their cause is still there.
    pub fn clear_faults(&mut self) -> Result<(), CodeSet> {
        let mut left = CodeSet::EMPTY;
        for code in self.latched.iter() {
            if self.present.contains(code) {
                left.insert(code);
            } else {
                self.latched.remove(code);
                self.publish(code, false);
            }
        }
        if left.is_empty() { Ok(()) } else { Err(left) }
    }

    /// The current loop did not end within its period. For its interrupt: from here on, so within the
    /// same period, there is no compensation; it comes back when [`Code::LoopLate`] goes. So many in a
    /// row as the thresholds say are a fault.
    pub fn loop_overrun(&mut self) {
        self.overruns = self.overruns.saturating_add(1);
        self.overruns_in_a_row = self.overruns_in_a_row.saturating_add(1);
        self.overrun_since_observed = true;
        self.set_present(Code::LoopLate, true);
        if self.overruns_in_a_row >= self.thresholds.overruns_in_a_row {
            self.set_present(Code::LoopOverrun, true);
        }
    }

    /// The current loop ended within its period. For its interrupt.
    pub fn loop_on_time(&mut self) {
        self.overruns_in_a_row = 0;
    }

    /// A fault that cannot wait for the next observation: the bridge is off from here on. It may be
    /// cleared as soon as an observation does not show it. A code that is no fault does nothing.
    pub fn trip(&mut self, code: Code) {
        if code.info().effect == Effect::Stops {
            self.latch(code);
        }
    }

    /// What the parameter store was found like, or is like after a save.
    pub fn store(&mut self, health: Health) {
        self.set_present(Code::StoreDamaged, health == Health::Damaged);
        self.set_present(Code::StoreReduced, health == Health::Reduced);
    }

    /// Which parameters are in use from now on.
    pub fn parameters(&mut self, in_use: InUse) {
        self.set_present(Code::ParametersDefault, in_use == InUse::Default);
        self.set_present(Code::ParametersRefused, in_use == InUse::DefaultRefused);
    }

    /// Whether somebody confirmed that the joint is wired as its parameters say.
    pub fn commissioned(&mut self, confirmed: bool) {
        self.set_present(Code::NotCommissioned, !confirmed);
    }

    /// How the self-test ended, at start or repeated.
    pub fn self_test(&mut self, passed: bool) {
        self.set_present(Code::SelfTestFailed, !passed);
    }

    /// What the joint may do.
    pub fn state(&self) -> State {
        match (self.latched.is_empty(), self.armed) {
            (false, _) => State::Fault,
            (true, true) => State::Armed,
            (true, false) => State::Safe,
        }
    }

    /// Whether the joint is armed.
    pub fn is_armed(&self) -> bool {
        self.state() == State::Armed
    }

    /// Whether the bridge may be on. The current loop asks in every period.
    #[inline]
    pub fn bridge_allowed(&self) -> bool {
        self.armed && self.latched.is_empty()
    }

    /// Whether friction may be compensated. The current loop asks in every period.
    #[inline]
    pub fn compensation_allowed(&self) -> bool {
        self.bridge_allowed() && !self.present.intersects(codes::DROPS_COMPENSATION)
    }

    /// Share of the current limit that temperature leaves, 0..=1.
    pub fn current_share(&self) -> f32 {
        self.current_share
    }

    /// Faults that were not cleared.
    pub fn faults(&self) -> CodeSet {
        self.latched
    }

    /// Limits that act now.
    pub fn limits(&self) -> CodeSet {
        self.present.without(codes::STOPPING)
    }

    /// Causes that are there now, of faults and limits, cleared or not.
    pub fn causes(&self) -> CodeSet {
        self.present
    }

    /// How often a code came since the start, a fault not again before it was cleared. Stays at the
    /// largest number it can hold.
    pub fn count_of(&self, code: Code) -> u32 {
        self.counts.get(code.index()).copied().unwrap_or(0)
    }

    /// The same of every code, in the order of [`Code::ALL`].
    pub fn counts(&self) -> &[u32; CODES] {
        &self.counts
    }

    /// Periods the current loop did not end in, since the start.
    pub fn overruns(&self) -> u32 {
        self.overruns
    }

    /// The oldest event not taken yet: one emergency frame each.
    pub fn take_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Events dropped because nobody took them.
    pub fn events_lost(&self) -> u32 {
        self.events_lost
    }

    fn command_is_late(&self, now_us: u64) -> bool {
        let timeout_us = u64::from(self.thresholds.command_timeout_us);
        self.command_us.is_none_or(|command_us| now_us.saturating_sub(command_us) >= timeout_us)
    }
}
