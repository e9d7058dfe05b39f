//! Refusals of a request or a write: the abort code of the transfer, and the reason that 2028h keeps.

use super::base::JointBase;
use crate::node::sdo::Abort;
use crate::setting_error::SettingError;
use crate::supervisor::{ArmRefusal, CodeSet};
use compensator_core::parameters::Text;
use compensator_core::parameters::reason::Reason;
use compensator_core::refusal;
use compensator_core::text;

/// Reason against a write while the bridge is in use.
pub(crate) const ARMED: Text =
    text!("the joint is armed, and nothing is written then: disarm first");

impl JointBase {
    /// Keeps the reason of a refusal, and returns its abort code.
    pub(crate) fn refuse(&mut self, abort: Abort, why: impl Into<Reason>) -> Abort {
        self.staging.refuse(abort, why)
    }

    /// Refuses a write because the bridge is in use.
    #[inline(never)]
    pub(crate) fn refuse_armed(&mut self) -> Abort {
        self.refuse(Abort::State, ARMED)
    }

    /// Refuses a setting that is out of range.
    #[inline(never)]
    pub(crate) fn refuse_setting(&mut self, name: Text, legal: Text) -> Abort {
        self.refuse(Abort::Value, SettingError { name, legal })
    }

    /// Refuses a request to the state machine that does not exist.
    pub(crate) fn refuse_request(&mut self, request: u8) -> Abort {
        let why =
            refusal!("request = {u32}: must be 0 (disarm), 1 (arm) or 2 (clear faults)", request);
        self.refuse(Abort::Value, why)
    }

    /// Refuses a request because of these faults and limits, and keeps the faults as those that block it (2002h:5).
    #[inline(never)]
    pub(crate) fn refuse_blocked(&mut self, codes: CodeSet) -> Abort {
        self.blocking = codes.fault_bits();
        self.refuse(Abort::State, self.supervisor.remaining(codes))
    }

    /// Refuses to arm, and keeps the faults that block it.
    pub(crate) fn refuse_arming(&mut self, refusal: ArmRefusal) -> Abort {
        self.blocking = refusal.causes.fault_bits();
        self.refuse(Abort::State, refusal)
    }
}
