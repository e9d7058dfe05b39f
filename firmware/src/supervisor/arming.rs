//! Arming: the conditions under which the bridge may be on.
//!
//! A request is refused with *every* reason against it, so that the caller need not try again for each:
//!
//! - a fault is latched, or a cause of a fault is present. The command timeout is evaluated at the request, because the last
//!   observation may be older than the last command;
//! - the last observation is older than [`MAX_OBSERVATION_AGE_US`];
//! - the board does not measure the bus voltage or the phase currents.
//!
//! Nothing arms by itself. Disarming is accepted in every state.

use super::Supervisor;
use super::codes::{Code, CodeSet, Effect};
use compensator_core::parameters::reason::Reason;
use compensator_core::refusal;

/// Maximum age of the last observation when arming, us.
pub const MAX_OBSERVATION_AGE_US: u64 = 20_000;

/// The reasons a request to arm was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArmRefusal {
    /// Latched faults, and causes of faults that are present.
    pub causes: CodeSet,
    /// No observation arrived in the last [`MAX_OBSERVATION_AGE_US`].
    pub unobserved: bool,
    /// The board does not measure the bus voltage or the phase currents.
    pub unmeasured: bool,
    /// Number of the self-test that failed, if its code is among the causes; otherwise 0.
    pub self_test: u8,
}

impl From<ArmRefusal> for Reason {
    fn from(refusal: ArmRefusal) -> Self {
        let ArmRefusal { causes, unobserved, unmeasured, self_test } = refusal;
        let conditions = u32::from(unobserved) | u32::from(unmeasured) << 1;
        refusal!("not armed:{faults}{conditions}{test}", causes.fault_bits(), conditions, self_test)
    }
}

impl Supervisor {
    /// Arms the joint, which allows the bridge to be on. A joint that is armed stays armed.
    ///
    /// # Errors
    /// Returns every reason against arming. The joint is then not armed.
    pub fn arm(&mut self, now_us: u64) -> Result<(), ArmRefusal> {
        self.arm_ignoring(CodeSet::EMPTY, now_us)
    }

    /// Arms the joint for commissioning. Unlike [`Supervisor::arm`], it ignores [`Code::NotCommissioned`],
    /// because commissioning determines the wiring that this code asks to be confirmed, and
    /// [`Code::PositionUnknown`], because the position has no meaning before.
    ///
    /// # Errors
    /// See [`Supervisor::arm`].
    pub fn arm_to_commission(&mut self, now_us: u64) -> Result<(), ArmRefusal> {
        let mut unconfirmed = CodeSet::EMPTY;
        unconfirmed.insert(Code::NotCommissioned);
        unconfirmed.insert(Code::PositionUnknown);
        self.arm_ignoring(unconfirmed, now_us)
    }

    fn arm_ignoring(&mut self, ignored: CodeSet, now_us: u64) -> Result<(), ArmRefusal> {
        if self.armed {
            return Ok(());
        }
        let stopping = |code: &Code| code.info().effect == Effect::Stops;
        let mut causes = self.latched;
        let present = self.present.without(ignored);
        present.iter().filter(stopping).for_each(|code| causes.insert(code));
        // The command timeout is evaluated now, not as of the last observation.
        if self.command_is_late(now_us) {
            causes.insert(Code::CommandTimeout);
        } else if !self.latched.contains(Code::CommandTimeout) {
            self.set_present(Code::CommandTimeout, false);
            causes.remove(Code::CommandTimeout);
        }
        let fresh = self
            .last_us
            .is_some_and(|last_us| now_us >= last_us && now_us - last_us <= MAX_OBSERVATION_AGE_US);
        let self_test = self.self_test_among(causes);
        let refusal =
            ArmRefusal { causes, unobserved: !fresh, unmeasured: !self.measured, self_test };
        if !causes.is_empty() || refusal.unobserved || refusal.unmeasured {
            return Err(refusal);
        }
        self.armed = true;
        Ok(())
    }

    /// Disarms the joint, which opens the bridge. It is accepted in every state.
    pub fn disarm(&mut self) {
        self.armed = false;
        self.stopping = false;
    }

    pub(super) fn command_is_late(&self, now_us: u64) -> bool {
        let timeout_us = u64::from(self.thresholds.command_timeout_us);
        self.command_us.is_none_or(|command_us| now_us.saturating_sub(command_us) >= timeout_us)
    }
}
