//! The objects of a CiA 402 drive. [`profile`] has the state machine.

use super::{Motion, Refused};
use crate::driver::angle::{Angle, micro};
use crate::driver::profile::FaultState;
use crate::driver::profile::{self, Homing, status};
use crate::joint_node::JointBase;
use crate::node::dictionary::{HOMING_METHODS, index};
use crate::node::sdo::Abort;
use crate::node_settings::InputSource;
use crate::supervisor::Code;
use crate::supervisor::JointState;
use compensator_core::refusal;

/// What a CiA 402 master wants: one PDO, or one write of an object.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Target {
    pub(crate) controlword: Option<u16>,
    torque_permille: Option<i16>,
    velocity_micro_rad_s: Option<i32>,
    position_micro_rad: Option<i32>,
    torque_offset_permille: Option<i16>,
    velocity_offset_micro_rad_s: Option<i32>,
}

impl Target {
    /// Adds the value of an object. Returns false if the object is no part of a target.
    pub(crate) fn add(&mut self, at_index: u16, word: u32) -> bool {
        match at_index {
            index::CONTROLWORD => self.controlword = Some(word as u16),
            index::TARGET_TORQUE => self.torque_permille = Some(word as i16),
            index::TARGET_VELOCITY => self.velocity_micro_rad_s = Some(word as i32),
            index::TARGET_POSITION => self.position_micro_rad = Some(word as i32),
            index::TORQUE_OFFSET => self.torque_offset_permille = Some(word as i16),
            index::VELOCITY_OFFSET => self.velocity_offset_micro_rad_s = Some(word as i32),
            _ => return false,
        }
        true
    }

    /// Parses receive PDO 1: controlword, target torque and target velocity. A master without velocity mode omits the velocity.
    pub(crate) fn parse(data: &[u8]) -> Option<Self> {
        let (velocity_micro_rad_s, [a, b, c, d]) = match *data {
            [a, b, c, d] => (None, [a, b, c, d]),
            [a, b, c, d, w, x, y, z] => (Some(i32::from_le_bytes([w, x, y, z])), [a, b, c, d]),
            _ => return None,
        };
        Some(Self {
            controlword: Some(u16::from_le_bytes([a, b])),
            torque_permille: Some(i16::from_le_bytes([c, d])),
            velocity_micro_rad_s,
            ..Self::default()
        })
    }

    /// Returns true if it confirms the last target, as all but an offset do. A controlword does so where it is processed.
    const fn is_confirmation(&self) -> bool {
        self.torque_permille.is_some()
            || self.velocity_micro_rad_s.is_some()
            || self.position_micro_rad.is_some()
    }
}

impl JointBase {
    /// Returns the rated current, A: the lower one of the current limits.
    #[inline(never)]
    pub(crate) fn rated_current_a(&self) -> f32 {
        self.set().motor.current_limit_a.min(self.set().friction.compensator.current_limit_a)
    }

    /// Returns the torque of the rated current, Nm.
    #[inline(never)]
    pub(crate) fn rated_torque_nm(&self) -> f32 {
        self.rated_current_a() * self.set().friction.compensator.torque_constant_nm_per_a
    }

    /// 6077h: torque of the measured current, thousandths of the rated one; not defined for a joint in HIL.
    pub(crate) fn actual_permille(&self) -> i16 {
        (self.report().motor_torque_nm / self.rated_torque_nm() * 1e3) as i16
    }

    /// 6078h: measured torque-producing current, thousandths of the rated one.
    pub(crate) fn actual_current_permille(&self) -> i16 {
        (self.report().current_a / self.rated_current_a() * 1e3) as i16
    }

    /// 6064h, 1e-6 rad. While the position is unknown, it counts from an arbitrary zero; a joint in HIL then has 0.
    #[inline(never)]
    pub(crate) fn actual_position(&self) -> i32 {
        micro(match (self.is_position_known(), self.settings.source) {
            (true, _) => f32::from_bits(self.measured().position_rad),
            (false, InputSource::Sensors) => self.report().turned_rad,
            (false, InputSource::Bus) => 0.0,
        })
    }

    /// Returns true if the position is absolute.
    pub(crate) fn is_position_known(&self) -> bool {
        !f32::from_bits(self.measured().position_rad).is_nan()
    }

    /// 606Ch, 1e-6 rad/s; 0 if unknown.
    pub(crate) fn actual_velocity(&self) -> i32 {
        micro(f32::from_bits(self.measured().velocity_rad_s))
    }

    /// Returns true if the bus voltage is above the level of an undervoltage fault. A joint in HIL needs none.
    pub(crate) fn is_powered(&self) -> bool {
        let level_v = self.supervisor.thresholds().bus_undervoltage_v;
        self.settings.is_in_hil()
            || self.report().bus_voltage_v.is_some_and(|bus_v| bus_v > level_v)
    }

    pub(crate) fn fault_state(&self) -> FaultState {
        match self.supervisor.state() {
            JointState::Fault if self.supervisor.is_stopping() => FaultState::Reacting,
            JointState::Fault => FaultState::Latched,
            JointState::Safe | JointState::Armed => FaultState::None,
        }
    }

    /// Returns true if the joint is slow enough to count as standing.
    pub(crate) fn is_standing(&self) -> bool {
        self.report().velocity_rad_s.abs() <= profile::STANDSTILL_RAD_S
    }

    /// Returns the position of 6064h, rad.
    pub(crate) fn position_rad(&self) -> f32 {
        let report = self.report();
        if report.position_rad.is_nan() { report.turned_rad } else { report.position_rad }
    }

    /// Returns the current that holds the load of a joint in torque mode, A. At rest it is the commanded current. In
    /// motion it is the torque that inertia and friction do not explain: the residual and the load torque of a sensor, which
    /// the residual leaves out. It needs the inertia; without it, 0.
    pub(crate) fn load_a(&self) -> f32 {
        let (report, set) = (self.report(), self.set());
        if self.is_standing() {
            return report.current_reference_a - report.feed_forward_current_a;
        }
        if set.motor.inertia_kg_m2 > 0.0 && report.residual_torque_nm.is_finite() {
            // 0 without a sensor. A value that is too old or not finite has no finite residual.
            let sensor_nm = self.received.covariates(0.0, self.now_us).load_torque_nm.value;
            return (report.residual_torque_nm + sensor_nm)
                / set.friction.compensator.torque_constant_nm_per_a;
        }
        0.0
    }
}

impl Motion {
    /// Returns true if the position is required (`position_required`) and unknown, and the drive is not in homing
    /// mode, which gives no torque.
    pub(crate) fn is_position_missing(&self, joint: &JointBase) -> bool {
        joint.supervisor.thresholds().position_required != 0
            && self.profile.mode != profile::HOMING
            && !joint.is_position_known()
    }

    /// 6041h.
    pub(crate) fn statusword(&self, joint: &JointBase) -> u16 {
        let when = |bit: u16, is_so: bool| if is_so { bit } else { 0 };
        let powered = joint.is_powered();
        let limits = joint.supervisor.limits();
        let target_rad_s = self.profile.target_micro_rad_s as f32 * 1e-6;
        let too_fast = match self.profile.mode {
            profile::CSV => {
                (target_rad_s + self.velocity_offset_rad_s()).abs() > self.max_speed_rad_s(joint)
            }
            profile::PV => target_rad_s.abs() > self.profile_speed_rad_s(joint),
            _ => false,
        };
        let is_limited = limits.contains(Code::CurrentLimited)
            || too_fast
            || joint.is_armed() && self.is_position_limited(joint);
        self.profile.state_bits(joint.fault_state())
            | self.profile.homing_bits(joint.is_standing())
            | self.profile.set_point_bits()
            | self.profile_mode_bits(joint)
            | when(status::FOLLOWING_ERROR, self.following_exceeded_ms(joint) > 0)
            | status::REMOTE
            | when(status::VOLTAGE_ENABLED, powered)
            | when(status::TARGET_REACHED, self.stopping.is_held())
            | when(status::WARNING, limits.iter().next().is_some())
            | when(status::POSITION_KNOWN, joint.is_position_known())
            | when(status::INTERNAL_LIMIT, is_limited)
    }

    /// 6060h.
    pub(crate) fn set_mode(&mut self, joint: &JointBase, mode: i8) -> Result<(), Refused> {
        if mode != 0 && !profile::is_supported(mode) {
            let why = refusal!(
                "modes_of_operation = {i32}: must be 0 (none), 1 (PP), 3 (PV), 4 (TQ), 6 (homing), 8 (CSP), 9 (CSV) or 10 (CST); 8 replaces 7",
                mode
            );
            return Err(Refused::new(Abort::Value, why));
        }
        if ![0, profile::CST].contains(&mode) && joint.settings.is_in_hil() {
            let why = refusal!(
                "a joint in HIL drives nothing and has no position of its own: mode {i32} needs the joint's own sensors (2001h:1)",
                mode
            );
            return Err(Refused::new(Abort::State, why));
        }
        self.enter_mode(joint, mode)
    }

    /// Sets the present position as home. If the joint moves, the statusword reports that homing failed, and
    /// 2028h the reason.
    pub(crate) fn home_here(&mut self, joint: &JointBase) {
        let home_rad = -Angle::from_micro_rad(self.profile.home_offset_micro_rad).rad();
        let homed = joint.is_standing();
        self.profile.homing = if homed { Homing::Attained } else { Homing::Failed };
        if homed {
            self.orders.home_rad = Some(home_rad);
        } else {
            let why = refusal!(
                "homing uses the present position, and the joint moves (more than {f32} rad/s)",
                profile::STANDSTILL_RAD_S
            );
            self.orders.refusal = Some(Refused::new(Abort::State, why));
        }
    }

    /// 6098h. The object dictionary refuses a write while the bridge is in use.
    pub(crate) fn set_homing_method(&mut self, method: i8) -> Result<(), Refused> {
        if !HOMING_METHODS.contains(&method) {
            let why = refusal!(
                "homing_method = {i32}: must be 37 or 35 (the present position), -1 or -2 (a stop); the joint has no switches",
                method
            );
            return Err(Refused::new(Abort::Value, why));
        }
        self.profile.homing_method = method;
        Ok(())
    }

    /// Sets the parts of a target together.
    pub(crate) fn set_target(&mut self, joint: &JointBase, target: &Target) {
        if let Some(permille) = target.torque_permille {
            self.profile.target_permille = permille;
        }
        if let Some(micro_rad_s) = target.velocity_micro_rad_s {
            self.set_target_velocity(joint, micro_rad_s);
        }
        if let Some(micro_rad) = target.position_micro_rad {
            self.set_target_position(joint, micro_rad);
        }
        self.set_offsets(joint, target.velocity_offset_micro_rad_s, target.torque_offset_permille);
        if target.is_confirmation() {
            self.confirm_target(joint);
        }
    }

    /// Refreshes the age of the master's target. Has no effect outside the profile.
    pub(crate) fn confirm_target(&mut self, joint: &JointBase) {
        if self.profile.is_active() {
            self.target_us = Some(joint.now_us);
            self.orders.confirms = true;
        }
    }

    /// Stops an armed joint whose targets have exceeded their deadline.
    pub(crate) fn watch_target(&mut self, joint: &JointBase) {
        let deadline_us = u64::from(joint.settings.target_timeout_ms) * 1000;
        let is_followed =
            self.profile.is_active() && joint.supervisor.is_armed() && !self.is_commissioning();
        // A stop ends by itself, and so does a test of the brake on request.
        let needs_none = self.stopping.is_to_rest() || self.brake_test.is_requested();
        let is_followed = is_followed && !needs_none;
        let is_late = joint.now_us.saturating_sub(self.target_us.unwrap_or(0)) >= deadline_us;
        if is_followed && deadline_us > 0 && is_late {
            self.orders.trips = Some(Code::CommandTimeout);
        }
    }
}
