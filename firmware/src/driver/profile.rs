//! The joint driver as a CiA 402 drive: state machine, cyclic synchronous torque (CST), velocity (CSV) and position
//! (CSP), profile position (PP), velocity (PV) and torque (TQ), homing.
//!
//! This profile is for masters that know drives but no friction (ros2_canopen, CODESYS). A mode in 6060h
//! activates it, and the joint's own Command frame is then ignored. The controlword requests, and the supervisor
//! decides: *operation enabled* means armed, *fault* is the supervisor's fault state, and a rising bit 7 clears
//! faults that can be cleared. "Disable voltage" opens the bridge at once. [`stop`] has the reactions to the other
//! stops. Bit 8 (halt) stops the joint with a ramp and holds it, while the drive stays enabled.
//!
//! Such a master repeats a constant value. The age of the set-point counts from the last target: receive PDO 1,
//! or a write of 6040h, 6071h or 60FFh. If no target arrives for the deadline of the PDO (1400h:5) or for
//! `command_timeout_us`, whichever is shorter, the fault `command-timeout` stops the joint (6007h). A SYNC does not count,
//! because its producer may outlive the controller. A master that sends only changes sets 1400h:5 to 0; then the
//! awaited heartbeat (1016h) confirms the last target.
//!
//! Homing (mode 6) sets the present position as home (methods 37 and 35), or moves to a stop (-1 and -2) until the
//! joint stands against the torque 2031h:1. A joint has no switches. Home is at -607Ch, because the zero lies 607Ch beyond
//! home. After homing at a stop the joint moves to position 0. With the methods 37 and 35 the drive gives no torque.
//!
//! Units: torque in thousandths of the rated torque (6076h), which the current limit gives at the joint.
//! Position and velocity in 1e-6 rad and 1e-6 rad/s. An unknown position counts from an arbitrary zero, and bit 8
//! of the statusword is 0; the parameter `position_required` refuses to enable such a drive, except for homing. The
//! maximum motor speed (6080h) is in motor turns per minute, as in the profile.

mod set_point;
pub mod stop;

use crate::node::dictionary::HOMING_METHODS;
use crate::supervisor::JointState;
pub use set_point::{SetPoint, SetPointOffer};
use stop::StopCause;

/// 1000h: servo drive (2), profile 402.
pub const DEVICE_TYPE: u32 = 0x0002_0192;
/// Mode of operation: cyclic synchronous torque.
pub const CST: i8 = 10;
/// Mode of operation: cyclic synchronous velocity.
pub const CSV: i8 = 9;
/// Mode of operation: cyclic synchronous position.
pub const CSP: i8 = 8;
/// Mode of operation: profile position.
pub const PP: i8 = 1;
/// Mode of operation: profile velocity.
pub const PV: i8 = 3;
/// Mode of operation: profile torque.
pub const TQ: i8 = 4;
/// Mode of operation: homing.
pub const HOMING: i8 = 6;
/// 6502h: supported modes, bit `mode - 1`.
pub const SUPPORTED_MODES: u32 = 1 << (CST - 1)
    | 1 << (CSV - 1)
    | 1 << (CSP - 1)
    | 1 << (HOMING - 1)
    | 1 << (TQ - 1)
    | 1 << (PV - 1)
    | 1 << (PP - 1);

/// Returns true if the drive has a mode.
pub const fn is_supported(mode: i8) -> bool {
    matches!(mode, PP | PV | TQ | HOMING | CSP | CSV | CST)
}

/// Maximum speed at which a joint counts as standing, rad/s. In the millisecond between two reports, home is
/// then missed by less than 0.1 mrad; the joint's encoder has steps of 8 urad.
pub const STANDSTILL_RAD_S: f32 = 0.1;
/// Maximum of 6072h, thousandths of the rated torque: the current limit.
pub const TORQUE_MAX_PERMILLE: u16 = 1000;

/// Bits of the controlword.
mod control {
    pub const ENABLE_VOLTAGE: u16 = 1 << 1;
    pub const QUICK_STOP: u16 = 1 << 2;
    pub const START_HOMING: u16 = 1 << 4;
    pub const NEW_SET_POINT: u16 = 1 << 4;
    pub const CHANGE_AT_ONCE: u16 = 1 << 5;
    pub const RELATIVE: u16 = 1 << 6;
    pub const FAULT_RESET: u16 = 1 << 7;
    pub const HALT: u16 = 1 << 8;
}

/// Bits of the statusword besides the state.
pub mod status {
    /// The bus voltage is present.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// A limit is active.
    pub const WARNING: u16 = 1 << 7;
    /// Manufacturer: the position is known; otherwise it counts from an arbitrary zero.
    pub const POSITION_KNOWN: u16 = 1 << 8;
    /// The network is operational.
    pub const REMOTE: u16 = 1 << 9;
    /// Homing: it is not running, or has ended. Halt: the joint stands.
    pub const TARGET_REACHED: u16 = 1 << 10;
    /// The current limit is active.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// The drive follows its target.
    pub const FOLLOWS_TARGET: u16 = 1 << 12;
    /// Mode 3: the joint stands.
    pub const STANDS: u16 = FOLLOWS_TARGET;
    /// Homing: the home position is set.
    pub const HOMED: u16 = FOLLOWS_TARGET;
    /// Mode 1: the set-point was taken.
    pub const SET_POINT_TAKEN: u16 = FOLLOWS_TARGET;
    /// Modes 1 and 8: the following error exceeds its window.
    pub const FOLLOWING_ERROR: u16 = HOMING_FAILED;
    /// Homing: it failed.
    pub const HOMING_FAILED: u16 = 1 << 13;
}

/// Result of the last homing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Homing {
    /// None since the mode was set.
    #[default]
    NotBegun,
    /// The joint moves to its stop, or from it.
    Running,
    /// The home position is set.
    Attained,
    /// Failed: the joint moved, or found no stop.
    Failed,
}

/// Drive states that are not those of the supervisor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    OperationEnabled,
    /// A ramp is under way by this command; then the drive is in the state of the command.
    Stopping(StopCause),
    QuickStopActive,
}

impl State {
    /// Returns true if the bridge is on.
    const fn is_powered(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::Stopping(_) | Self::QuickStopActive)
    }
}

/// State of the supervisor, as the profile reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultState {
    /// No fault.
    None,
    /// A fault; the joint stops with a ramp.
    Reacting,
    /// A fault; the bridge is open.
    Latched,
}

/// Request of a controlword to the supervisor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveRequest {
    /// No request.
    None,
    /// Arm. If the supervisor refuses, call [`Profile::arm_refused`].
    Arm,
    /// Disarm.
    Disarm,
    /// Clear faults.
    ClearFaults,
    /// Home: at the present position, or at a stop.
    Home,
    /// Take a set-point of mode 1.
    TakeSetPoint,
}

with_defaults! {
    /// State of the CiA 402 profile.
    #[derive(Clone, Copy, Debug)]
    pub struct Profile {
        state: State,
        /// 6040h.
        pub controlword: u16,
        /// 6060h.
        pub mode: i8,
        /// 6071h.
        pub target_permille: i16,
        /// 6072h.
        pub max_permille: u16 = TORQUE_MAX_PERMILLE,
        /// 60FFh, 1e-6 rad/s.
        pub target_micro_rad_s: i32,
        /// 6080h, motor turns per minute; `None` if no master has written it.
        pub max_motor_rpm: Option<u32>,
        /// 6098h, of [`HOMING_METHODS`].
        pub homing_method: i8 = HOMING_METHODS[0],
        /// 607Ah, 1e-6 rad.
        pub target_position_micro_rad: i32,
        /// Set-points of mode 1.
        pub set_points: SetPoint,
        /// 607Ch, 1e-6 rad.
        pub home_offset_micro_rad: i32,
        /// Result of the last homing.
        pub homing: Homing,
    }
}

impl Profile {
    /// Returns true if a mode of the profile commands the joint.
    pub const fn is_active(&self) -> bool {
        is_supported(self.mode)
    }

    /// Returns true if the homing method moves the joint to a stop.
    pub const fn homes_at_stop(&self) -> bool {
        self.homing_method < 0
    }

    /// Returns true while the master requests homing.
    pub const fn wants_homing(&self) -> bool {
        self.controlword & control::START_HOMING != 0
    }

    /// Returns the set-point of mode 1 that target and controlword offer.
    pub const fn set_point_offer(&self) -> SetPointOffer {
        SetPointOffer {
            target_micro_rad: self.target_position_micro_rad,
            is_relative: self.controlword & control::RELATIVE != 0,
            replaces_others: self.controlword & control::CHANGE_AT_ONCE != 0,
        }
    }

    /// Returns the bits 10 and 12 of the statusword in mode 1.
    pub fn set_point_bits(&self) -> u16 {
        if self.mode != PP || self.state != State::OperationEnabled {
            return 0;
        }
        let is_offered = self.controlword & control::NEW_SET_POINT != 0;
        let when = |bit: u16, is_so: bool| if is_so { bit } else { 0 };
        when(status::SET_POINT_TAKEN, self.set_points.is_acknowledged(is_offered))
            | when(status::TARGET_REACHED, self.set_points.is_reached())
    }

    /// Returns 6072h as a share of the rated torque.
    pub fn max_share(&self) -> f32 {
        f32::from(self.max_permille.min(TORQUE_MAX_PERMILLE)) * 1e-3
    }

    /// Returns 60FFh limited to `+-most_rad_s`.
    #[inline(never)]
    pub fn target_rad_s(&self, most_rad_s: f32) -> f32 {
        (self.target_micro_rad_s as f32 * 1e-6).max(-most_rad_s).min(most_rad_s)
    }

    /// Returns the target torque limited by 6072h, as a share of the rated torque.
    #[inline(never)]
    pub fn target_share(&self) -> f32 {
        let most = i32::from(self.max_permille.min(TORQUE_MAX_PERMILLE));
        i32::from(self.target_permille).clamp(-most, most) as f32 * 1e-3
    }

    /// Processes a controlword; `joint` is the present state of the supervisor, or of a joint in HIL.
    #[must_use]
    pub fn control(&mut self, controlword: u16, joint: JointState) -> DriveRequest {
        let rising = controlword & !self.controlword;
        self.controlword = controlword;
        self.follow_joint(joint);
        if joint == JointState::Fault {
            let reset = rising & control::FAULT_RESET != 0;
            return if reset { DriveRequest::ClearFaults } else { DriveRequest::None };
        }
        let powered =
            controlword & control::ENABLE_VOLTAGE != 0 && controlword & control::QUICK_STOP != 0;
        let was = self.state;
        let is_voltage_enabled = controlword & control::ENABLE_VOLTAGE != 0;
        self.state = match (was, controlword & 0xF) {
            // A lost connection is no command that its master could take back.
            (State::Stopping(StopCause::ConnectionLost), _) if is_voltage_enabled => was,
            (State::OperationEnabled | State::Stopping(_), _) if is_voltage_enabled && !powered => {
                State::QuickStopActive
            }
            // Only "enable operation", which leads back, and "disable voltage" end this state.
            (State::QuickStopActive, _) if is_voltage_enabled && controlword & 0xF != 0xF => {
                State::QuickStopActive
            }
            _ if !powered => State::SwitchOnDisabled,
            (now, 0b0110 | 0b1110) if now.is_powered() => State::Stopping(StopCause::Shutdown),
            (now, 0b0111) if now.is_powered() => State::Stopping(StopCause::DisableOperation),
            // Shutdown is the only transition out of this state.
            (_, 0b0110 | 0b1110) => State::ReadyToSwitchOn,
            (State::SwitchOnDisabled, _) => State::SwitchOnDisabled,
            (_, 0b0111) => State::SwitchedOn,
            // Passes through "switched on" in one step, which the profile permits.
            _ => State::OperationEnabled,
        };
        match (was.is_powered(), self.state.is_powered()) {
            (false, true) => DriveRequest::Arm,
            (true, false) => DriveRequest::Disarm,
            (true, true)
                if self.mode == HOMING
                    && self.state == State::OperationEnabled
                    && rising & control::START_HOMING != 0 =>
            {
                DriveRequest::Home
            }
            (true, true)
                if self.mode == PP
                    && self.state == State::OperationEnabled
                    && rising & control::NEW_SET_POINT != 0 =>
            {
                DriveRequest::TakeSetPoint
            }
            _ => DriveRequest::None,
        }
    }

    /// The supervisor refused to arm: the drive stays switched on, and the next enable command requests it
    /// again.
    pub fn arm_refused(&mut self) {
        self.state = State::SwitchedOn;
    }

    /// Adopts a state change that the supervisor made.
    pub fn follow_joint(&mut self, joint: JointState) {
        let is_stopped = self.state.is_powered() && joint != JointState::Armed;
        if is_stopped || joint == JointState::Fault {
            self.state = State::SwitchOnDisabled;
        }
    }

    /// Returns the command by which the drive stops or holds the joint now.
    #[inline(never)]
    pub fn stop_cause(&self) -> Option<StopCause> {
        match self.state {
            State::Stopping(cause) => Some(cause),
            State::QuickStopActive => Some(StopCause::QuickStop),
            State::OperationEnabled if self.controlword & control::HALT != 0 => {
                Some(StopCause::Halt)
            }
            _ => None,
        }
    }

    /// Stops the drive because its network stops.
    pub fn stop_connection(&mut self) {
        if self.state.is_powered() {
            self.state = State::Stopping(StopCause::ConnectionLost);
        }
    }

    /// The stop has ended, and the bridge opens: the drive takes the state of the command.
    #[inline(never)]
    pub fn end_stop(&mut self) {
        self.state = match self.state {
            State::Stopping(StopCause::Shutdown) => State::ReadyToSwitchOn,
            State::Stopping(StopCause::DisableOperation) => State::SwitchedOn,
            _ => State::SwitchOnDisabled,
        };
    }

    /// Returns the state bits of the statusword.
    pub fn state_bits(&self, fault: FaultState) -> u16 {
        match self.state {
            _ if fault == FaultState::Latched => 0x08,
            _ if fault == FaultState::Reacting => 0x0F,
            State::SwitchOnDisabled => 0x40,
            State::ReadyToSwitchOn => 0x21,
            State::SwitchedOn => 0x23,
            State::QuickStopActive => 0x07,
            State::Stopping(_) => 0x27,
            State::OperationEnabled
                if ![CSP, CSV, CST].contains(&self.mode) || self.stop_cause().is_some() =>
            {
                0x27
            }
            State::OperationEnabled => 0x27 | status::FOLLOWS_TARGET,
        }
    }

    /// Returns the homing bits of the statusword, in homing mode.
    pub fn homing_bits(&self, stands: bool) -> u16 {
        let ended = |bits| if stands { bits | status::TARGET_REACHED } else { bits };
        match self.homing {
            _ if self.mode != HOMING => 0,
            Homing::NotBegun => status::TARGET_REACHED,
            Homing::Running => 0,
            Homing::Attained => status::TARGET_REACHED | status::HOMED,
            Homing::Failed => ended(status::HOMING_FAILED),
        }
    }
}

#[cfg(test)]
#[path = "profile/profile_tests.rs"]
mod tests;
