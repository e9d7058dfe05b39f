//! The supervisor decides whether the bridge may be on and whether friction may be compensated.
//!
//! A joint starts in [`JointState::Safe`]: bridge off, compensation off. Only an explicit request arms it,
//! and only while no cause of a fault is present. Two kinds of code limit a joint:
//!
//! - A *fault* opens the bridge and takes the joint to [`JointState::Fault`]. It stays latched after its
//!   cause has gone, until a request clears it. A cleared joint is safe, not armed.
//! - A *limit* is active while its cause is present. It does not stop the joint; some limits disable the
//!   compensation.
//!
//! The table in [`codes`] lists every code with its bus number, its delays, and how it is raised and
//! cleared.
//!
//! The supervisor is pure: it reads no clock and no pin. Measurements arrive as an [`Observation`], about
//! once a millisecond, together with the time. Most causes must persist before they count, and must be
//! absent for a while before they count as gone. An interrupt reports what cannot wait for the next
//! observation: [`Supervisor::record_loop_overrun`] disables the compensation within the same period, and
//! [`Supervisor::trip`] opens the bridge. If observations stop, the hardware watchdog acts, because the
//! supervisor does not run then.

mod arming;
pub mod codes;
mod conditions;
pub mod observation;
mod self_test;
pub mod thresholds;

pub use arming::{ArmRefusal, MAX_OBSERVATION_AGE_US};
pub use codes::{CODE_COUNT, Code, CodeDescription, CodeInfo, CodeSet, Effect, Watched};
pub use observation::{CanState, Observation, ParameterSource, ResetCause, SupervisorBoot};
pub use self_test::SelfTest;
pub use thresholds::Thresholds;

use crate::store::StoreHealth;
use compensator_core::parameters::ParameterError;
use compensator_core::parameters::reason::Reason;
use compensator_core::refusal;
use conditions::CauseState;
use heapless::Deque;

/// Maximum number of pending events. If the queue is full, the oldest event is dropped.
pub const MAX_PENDING_EVENTS: usize = 32;

/// Maximum number of overruns of a report that are counted: more would delay the background.
const MAX_OVERRUNS: u32 = 100;

/// State of the joint, by its number in 2002h:2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointState {
    /// Bridge off, waiting to be armed.
    Safe = 0,
    /// Bridge on.
    Armed = 1,
    /// Bridge off, until faults are cleared.
    Fault = 2,
}

/// A code that was raised or cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// The code.
    pub code: Code,
    /// True if the code was raised. A fault is cleared on request, a limit when its cause has gone.
    pub raised: bool,
}

with_defaults! {
    /// The supervisor of one joint.
    #[derive(Clone, Debug)]
    pub struct Supervisor {
        thresholds: Thresholds,
        armed: bool,
        /// A fault ended the armed state, and the bridge stays on for a ramp.
        stopping: bool,
        /// Faults after which the bridge may stay on for a ramp.
        ramp_faults: CodeSet,
        /// Causes that are present, after their delays.
        present: CodeSet,
        /// Latched faults: raised and not yet cleared.
        latched: CodeSet,
        /// Codes whose cause is changing, and since when, us.
        changing: CodeSet,
        since_us: [u64; CODE_COUNT] = [0; CODE_COUNT],
        counts: [u32; CODE_COUNT] = [0; CODE_COUNT],
        events: Deque<Event, MAX_PENDING_EVENTS>,
        events_lost: u32,
        last_us: Option<u64>,
        measured: bool,
        command_us: Option<u64>,
        overruns: u32,
        overruns_in_a_row: u32,
        overrun_since_observed: bool,
        current_share: f32 = 1.0,
        failed_self_test: Option<SelfTest>,
    }
    /// Safe, with default thresholds, before its start.
}

impl Supervisor {
    /// Starts in the safe state: see [`Self::start`].
    pub fn boot(thresholds: &Thresholds, boot: &SupervisorBoot) -> Self {
        let mut supervisor = Self::default();
        supervisor.start(thresholds, boot);
        supervisor
    }

    /// Records how the previous run ended. If `thresholds` are refused, the defaults stay and
    /// [`Code::ParametersRefused`] is raised.
    pub fn start(&mut self, thresholds: &Thresholds, boot: &SupervisorBoot) {
        let is_valid = self.configure(thresholds).is_ok();
        // These causes lie in the past, so only the fault itself is recorded.
        for (happened, code) in [
            (boot.reset == ResetCause::Watchdog, Code::WatchdogReset),
            (boot.panicked, Code::PanicBeforeReset),
            (boot.stack_overflowed, Code::StackOverflow),
        ] {
            if happened {
                self.trip(code);
            }
        }
        self.set_self_test_result(boot.failed_self_test);
        self.set_store_health(boot.store);
        self.set_commissioned(boot.commissioned);
        self.set_parameter_source(if is_valid {
            boot.parameters
        } else {
            ParameterSource::DefaultRefused
        });
    }

    /// Replaces all thresholds.
    ///
    /// # Errors
    /// Returns the field that is refused. The previous thresholds then stay in force.
    #[inline(never)]
    pub fn configure(&mut self, thresholds: &Thresholds) -> Result<(), ParameterError> {
        thresholds.validate()?;
        self.thresholds = *thresholds;
        Ok(())
    }

    /// Returns the thresholds in force.
    pub fn thresholds(&self) -> &Thresholds {
        &self.thresholds
    }

    /// Evaluates the measurements since the last observation. Call it about once a millisecond.
    pub fn observe(&mut self, observation: &Observation, now_us: u64) {
        if self.last_us.is_some_and(|last_us| now_us < last_us) {
            // Delays and timeouts are meaningless if the clock runs backwards.
            self.trip(Code::Internal);
            self.changing = CodeSet::EMPTY;
        }
        self.last_us = Some(now_us);
        self.measured =
            observation.bus_voltage_v.is_some() && observation.phase_currents_a.is_some();
        self.current_share = conditions::current_share(&self.thresholds, observation);
        for (index, code) in Code::ALL.iter().copied().enumerate() {
            let cause = conditions::evaluate(self, code, observation, now_us);
            self.update_presence(index, code, cause, now_us);
        }
        self.overrun_since_observed = false;
    }

    /// Updates one cause: it counts once it has lasted, and it ends once it has been gone for long enough.
    fn update_presence(&mut self, index: usize, code: Code, cause: CauseState, now_us: u64) {
        let present = self.present.contains(code);
        let is_changing = match cause {
            CauseState::Reported => return,
            CauseState::Present => !present,
            CauseState::Absent => present,
            CauseState::Unchanged => false,
        };
        if !is_changing {
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
            if present && (self.is_driving() || info.watched == Watched::Always) {
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
        self.stopping = self.is_driving() && self.ramp_faults.contains(code);
        self.armed = false;
        if !self.latched.contains(code) {
            self.latched.insert(code);
            self.count(code);
            self.publish(code, true);
        }
    }

    #[inline(never)]
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

    /// Records that a set-point was received.
    pub fn record_command(&mut self, now_us: u64) {
        self.command_us = Some(now_us);
    }

    /// Sets the faults after which the bridge stays on for a ramp. The driver then stops the joint and calls
    /// [`Supervisor::disarm`]. A fault that is not in the set opens the bridge at once, also during a ramp.
    pub fn set_ramp_faults(&mut self, codes: CodeSet) {
        self.ramp_faults = codes;
    }

    /// Clears the faults whose cause has gone. The joint is then safe, not armed.
    ///
    /// # Errors
    /// Returns the faults that stay latched because their cause is still present.
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
        // Nothing is left to stop for.
        self.stopping &= !self.latched.is_empty();
        if left.is_empty() { Ok(()) } else { Err(left) }
    }

    /// Records that the current loop did not end within its period. The loop's interrupt calls it.
    ///
    /// The compensation is off from here on, so within the same period. It is allowed again when
    /// [`Code::LoopLate`] clears. [`Thresholds::overruns_in_a_row`] overruns in a row are a fault.
    pub fn record_loop_overrun(&mut self) {
        self.overruns = self.overruns.saturating_add(1);
        self.overruns_in_a_row = self.overruns_in_a_row.saturating_add(1);
        self.overrun_since_observed = true;
        self.set_present(Code::LoopLate, true);
        if self.overruns_in_a_row >= self.thresholds.overruns_in_a_row {
            self.set_present(Code::LoopOverrun, true);
        }
    }

    /// Records that the current loop ended within its period. The loop's interrupt calls it.
    pub fn record_loop_on_time(&mut self) {
        self.overruns_in_a_row = 0;
    }

    /// Records these overruns in a row, and then a period on time.
    pub fn record_overruns(&mut self, overruns: u32) {
        for _ in 0..overruns.min(MAX_OVERRUNS) {
            self.record_loop_overrun();
        }
        self.record_loop_on_time();
    }

    /// Latches a fault that cannot wait for the next observation. The bridge must be off from here on, unless
    /// [`Supervisor::is_stopping`].
    ///
    /// The fault may be cleared as soon as an observation does not show its cause. A code that is not a
    /// fault is ignored.
    pub fn trip(&mut self, code: Code) {
        if code.info().effect == Effect::Stops {
            self.latch(code);
        }
    }

    /// Sets the health of the parameter store, at start and after each save.
    #[inline(never)]
    pub fn set_store_health(&mut self, health: StoreHealth) {
        self.set_present(Code::StoreDamaged, health == StoreHealth::Damaged);
        self.set_present(Code::StoreReduced, health == StoreHealth::Reduced);
    }

    /// Sets where the parameters in use come from.
    #[inline(never)]
    pub fn set_parameter_source(&mut self, source: ParameterSource) {
        self.set_present(Code::ParametersDefault, source == ParameterSource::Default);
        self.set_present(Code::ParametersRefused, source == ParameterSource::DefaultRefused);
    }

    /// Sets whether the wiring of the joint is confirmed.
    pub fn set_commissioned(&mut self, confirmed: bool) {
        self.set_present(Code::NotCommissioned, !confirmed);
    }

    /// Sets the first test that failed, at start or when the tests are repeated.
    pub fn set_self_test_result(&mut self, failed: Option<SelfTest>) {
        self.failed_self_test = failed;
        self.set_present(Code::SelfTestFailed, failed.is_some());
    }

    /// Returns the number of the first test that failed; 0 if all passed.
    pub fn failed_self_test(&self) -> u8 {
        self.failed_self_test.map_or(0, SelfTest::number)
    }

    /// Returns the number of the failed test if these codes have its code, otherwise 0.
    fn self_test_among(&self, codes: CodeSet) -> u8 {
        if codes.contains(Code::SelfTestFailed) { self.failed_self_test() } else { 0 }
    }

    /// Returns the reason of faults that are still present.
    pub fn remaining(&self, codes: CodeSet) -> Reason {
        refusal!("still present:{faults}{test}", codes.fault_bits(), self.self_test_among(codes))
    }

    /// State of the joint.
    pub fn state(&self) -> JointState {
        match (self.latched.is_empty(), self.armed) {
            (false, _) => JointState::Fault,
            (true, true) => JointState::Armed,
            (true, false) => JointState::Safe,
        }
    }

    /// Returns true if the joint is armed.
    pub fn is_armed(&self) -> bool {
        self.state() == JointState::Armed
    }

    /// Returns true while the bridge stays on after a fault, for a ramp.
    #[inline]
    pub fn is_stopping(&self) -> bool {
        self.stopping
    }

    /// Returns true if the joint is armed or stops with a ramp.
    #[inline]
    pub(crate) fn is_driving(&self) -> bool {
        self.armed || self.stopping
    }

    /// Returns true if the low sides may be shorted when the bridge stops: bridge, shunts and their supply have no
    /// fault, latched or present.
    pub fn is_braking_allowed(&self) -> bool {
        !self.latched.intersects(codes::BRIDGE_FAULT_CODES)
            && !self.present.intersects(codes::BRIDGE_FAULT_CODES)
    }

    /// Returns true if the bridge may be on. The current loop reads it in every period.
    #[inline(never)]
    pub fn is_bridge_allowed(&self) -> bool {
        self.stopping || self.armed && self.latched.is_empty()
    }

    /// Returns true if friction may be compensated. The current loop reads it in every period.
    #[inline]
    pub fn is_compensation_allowed(&self) -> bool {
        self.is_bridge_allowed()
            && !self.present.intersects(codes::COMPENSATION_DROPPING_CODES)
            && !self.latched.contains(Code::ModelNotFinite)
    }

    /// Returns the share of the current limit that the temperatures allow, from 0 to 1.
    pub fn current_share(&self) -> f32 {
        self.current_share
    }

    /// Latched faults: raised and not yet cleared.
    pub fn faults(&self) -> CodeSet {
        self.latched
    }

    /// Returns the active limits.
    pub fn limits(&self) -> CodeSet {
        self.present.without(codes::FAULT_CODES)
    }

    /// Returns the causes of faults and limits that are present, whether or not the fault is cleared.
    pub fn causes(&self) -> CodeSet {
        self.present
    }

    /// Returns how often a code was raised since the start; it saturates. A latched fault counts once until
    /// it is cleared.
    pub fn count_of(&self, code: Code) -> u32 {
        self.counts.get(code.index()).copied().unwrap_or(0)
    }

    /// Returns the counts of all codes, in the order of [`Code::ALL`].
    pub fn counts(&self) -> &[u32; CODE_COUNT] {
        &self.counts
    }

    /// Returns the number of loop overruns since the start.
    pub fn overruns(&self) -> u32 {
        self.overruns
    }

    /// Removes and returns the oldest pending event. Each one becomes an emergency frame.
    pub fn take_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Returns the number of events that were dropped because the queue was full.
    pub fn events_lost(&self) -> u32 {
        self.events_lost
    }
}
