//! Reactions to a stop (CiA 402-2, 605Ah to 605Eh and 6007h).
//!
//! | code | reaction |
//! |---|---|
//! | -1 | shorted low sides: the motor brakes itself (manufacturer specific) |
//! | 0 | the bridge opens; the parameter `brake_at_stop` selects whether the low sides are then shorted |
//! | 1 | ramp with the deceleration 6084h, then the bridge opens |
//! | 2 | ramp with the deceleration 6085h, then the bridge opens |
//! | 5, 6 | as 1 and 2, but the drive then holds the joint in the state *quick stop active* |
//!
//! A ramp needs a sound bridge and a known rotor angle. Only the faults in [`RAMP_FAULTS`] leave both. After every
//! other fault the bridge opens at once, and `brake_at_stop` or the code -1 short the low sides if the bridge is sound
//! ([`crate::stop_brake`]).

use crate::drive_settings::DriveSettings;
use crate::supervisor::{Code, CodeSet};

/// Causes of a stop, each with its option code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopCause {
    /// Quick stop command: 605Ah.
    QuickStop,
    /// Shutdown command: 605Bh.
    Shutdown,
    /// Disable operation command: 605Ch.
    DisableOperation,
    /// Halt command: 605Dh.
    Halt,
    /// A fault: 605Eh.
    Fault,
    /// The connection to the master is lost: 6007h.
    ConnectionLost,
}

/// Reaction to a stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReaction {
    /// The bridge opens; `brake_at_stop` applies.
    Open,
    /// The low sides are shorted.
    Short,
    /// A ramp with this deceleration, 1e-6 rad/s^2.
    Ramp(u32),
}

/// Faults after which bridge, shunts, encoder and loop are sound, so that a ramp is possible.
pub const RAMP_FAULTS: CodeSet = CodeSet::of(&[
    Code::CommandTimeout,
    Code::HeartbeatLost,
    Code::CanBusOff,
    Code::ModelNotFinite,
    Code::PositionUnknown,
    Code::FollowingError,
]);

/// Faults of the connection to the master, to which 6007h applies.
pub const CONNECTION_FAULTS: CodeSet =
    CodeSet::of(&[Code::CommandTimeout, Code::HeartbeatLost, Code::CanBusOff]);

impl DriveSettings {
    /// Returns the reaction to a cause.
    pub fn reaction(&self, cause: StopCause) -> StopReaction {
        let code = match cause {
            StopCause::QuickStop => self.quick_stop_option,
            StopCause::Shutdown => self.shutdown_option,
            StopCause::DisableOperation => self.disable_option,
            StopCause::Halt => self.halt_option,
            StopCause::Fault => self.fault_option,
            StopCause::ConnectionLost => match self.abort_connection {
                1 => self.fault_option,
                2 => 0,
                _ => self.quick_stop_option,
            },
        };
        match code {
            -1 => StopReaction::Short,
            1 | 5 => StopReaction::Ramp(self.deceleration),
            2 | 6 => StopReaction::Ramp(self.quick_deceleration),
            _ => StopReaction::Open,
        }
    }

    /// Returns true if the drive holds the joint after the ramp of this cause.
    pub const fn holds_after(&self, cause: StopCause) -> bool {
        match cause {
            StopCause::Halt => true,
            StopCause::QuickStop => self.quick_stop_option >= 5,
            _ => false,
        }
    }

    /// Returns the faults after which the drive stops with a ramp.
    pub fn ramp_faults(&self) -> CodeSet {
        let if_ramp = |cause, codes| match self.reaction(cause) {
            StopReaction::Ramp(_) => codes,
            _ => CodeSet::EMPTY,
        };
        let others = const { RAMP_FAULTS.without(CONNECTION_FAULTS) };
        if_ramp(StopCause::Fault, others)
            .union(if_ramp(StopCause::ConnectionLost, CONNECTION_FAULTS))
    }

    /// Returns true if a stop may short the low sides.
    #[inline(never)]
    pub fn has_short(&self) -> bool {
        [self.quick_stop_option, self.shutdown_option, self.disable_option, self.fault_option]
            .contains(&-1)
    }
}

/// Returns the cause of a stop by these faults.
pub fn fault_cause(faults: CodeSet) -> StopCause {
    if faults.without(CONNECTION_FAULTS).is_empty() {
        StopCause::ConnectionLost
    } else {
        StopCause::Fault
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reaction_of_default_settings_opens_the_bridge_for_every_cause_but_halt() {
        let settings = DriveSettings::default();
        for cause in [
            StopCause::QuickStop,
            StopCause::Shutdown,
            StopCause::DisableOperation,
            StopCause::Fault,
            StopCause::ConnectionLost,
        ] {
            assert_eq!(settings.reaction(cause), StopReaction::Open, "{cause:?}");
        }
        assert_eq!(settings.reaction(StopCause::Halt), StopReaction::Ramp(10_000_000));
        assert!(settings.ramp_faults().is_empty());
    }

    #[test]
    fn lost_connection_follows_6007h() {
        let of = |abort_connection| DriveSettings {
            abort_connection,
            quick_stop_option: 2,
            fault_option: 1,
            ..DriveSettings::default()
        };
        for (option, reaction) in [
            (1, StopReaction::Ramp(10_000_000)),
            (2, StopReaction::Open),
            (3, StopReaction::Ramp(50_000_000)),
        ] {
            assert_eq!(of(option).reaction(StopCause::ConnectionLost), reaction, "{option}");
        }
        assert_eq!(of(1).ramp_faults(), RAMP_FAULTS);
        assert_eq!(of(2).ramp_faults(), RAMP_FAULTS.without(CONNECTION_FAULTS));
    }

    #[test]
    fn ramp_faults_leave_bridge_and_encoder_sound() {
        use crate::supervisor::codes::BRIDGE_FAULT_CODES;
        assert!(!RAMP_FAULTS.intersects(BRIDGE_FAULT_CODES));
        for code in [Code::EncoderLost, Code::EncoderJump, Code::LoopOverrun, Code::Overspeed] {
            assert!(!RAMP_FAULTS.contains(code), "{code:?}");
        }
    }
}
