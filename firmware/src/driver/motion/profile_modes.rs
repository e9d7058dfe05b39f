//! Profile velocity (mode 3) and profile torque (mode 4) of CiA 402-2, and changes of the mode while the drive is enabled.
//!
//! ```text
//! mode 3: reference goes to 60FFh, faster with 6083h and slower with 6084h, within 607Fh and 6080h
//! mode 4: torque demand goes to 6071h with 6087h, within 6072h; the speed stays within 6080h
//! ```
//! *Change of the mode.* The target of the new mode becomes the present demand: the torque for torque modes, the velocity for
//! velocity modes. Position modes bring their reference to rest with a ramp. So neither torque nor velocity jumps, and the
//! master writes the targets of a mode after the mode.

use super::offsets::Offsets;
use super::velocity::VelocityTarget;
use super::{Motion, Refused};
use crate::driver::angle::micro;
use crate::driver::loop_data::REPORT_PERIOD_S;
use crate::driver::profile::stop::StopCause;
use crate::driver::profile::{self, Homing, SetPoint, status};
use crate::joint_node::JointBase;
use crate::node::sdo::Abort;
use compensator_core::refusal;

/// State of the profile modes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ProfileModes {
    /// Torque demand of mode 4, thousandths of the rated torque.
    pub(super) torque_permille: f32,
    /// Reports for which the velocity is within its window, and for which the joint stands (mode 3).
    pub(super) reached_reports: u16,
    standing_reports: u16,
}

impl Motion {
    /// Returns true if mode 4 commands the torque.
    pub(crate) fn is_in_profile_torque(&self, joint: &JointBase) -> bool {
        !joint.settings.is_in_hil() && self.profile.mode == profile::TQ
    }

    /// Returns the maximum speed of mode 3, rad/s.
    #[inline(never)]
    pub(crate) fn profile_speed_rad_s(&self, joint: &JointBase) -> f32 {
        self.max_speed_rad_s(joint).min(joint.settings.drive.max_profile_velocity as f32 * 1e-6)
    }

    /// Returns the target of a step of mode 3.
    pub(crate) fn profile_velocity_target(&mut self, joint: &JointBase) -> VelocityTarget {
        self.position.is_limited = false;
        let wanted_rad_s = self.profile.target_rad_s(self.profile_speed_rad_s(joint));
        let wanted_rad_s = self.bounded_velocity(joint, wanted_rad_s);
        let reference_rad_s = self.velocity.command().reference_rad_s;
        let (drive, reverses) = (&joint.settings.drive, wanted_rad_s * reference_rad_s < 0.0);
        let is_slower = reverses || wanted_rad_s.abs() < reference_rad_s.abs();
        let acceleration = if is_slower { drive.deceleration } else { drive.acceleration };
        // A reversal passes through rest, where the other ramp begins.
        let target_rad_s = if reverses { 0.0 } else { wanted_rad_s };
        let acceleration_rad_s2 = acceleration as f32 * 1e-6;
        let gains = self.velocity.gains().with_acceleration(acceleration_rad_s2, REPORT_PERIOD_S);
        VelocityTarget::Slew { gains, target_rad_s }
    }

    /// Runs a step of the profile modes, once per report.
    pub(crate) fn step_profile_modes(&mut self, joint: &JointBase) {
        let drive = &joint.settings.drive;
        let velocity_rad_s = joint.report().velocity_rad_s;
        let target_rad_s = self.profile.target_micro_rad_s as f32 * 1e-6;
        let modes = &mut self.modes;
        let count = |reports: &mut u16, window: u16, difference_rad_s: f32| {
            let is_within = difference_rad_s.abs() <= f32::from(window) * 1e-6;
            *reports = if is_within { reports.saturating_add(1) } else { 0 };
        };
        count(&mut modes.reached_reports, drive.velocity_window, velocity_rad_s - target_rad_s);
        count(&mut modes.standing_reports, drive.velocity_threshold, velocity_rad_s);
        if !self.is_in_profile_torque(joint) {
            return;
        }
        self.modes.torque_permille = if !joint.supervisor.is_bridge_allowed() {
            0.0
        } else if self.holds_joint(joint) {
            // Afterwards the demand begins at the torque that held the joint.
            self.permille_of(joint, self.velocity.command().current_a)
        } else {
            let step = joint.settings.drive.torque_slope as f32 * REPORT_PERIOD_S;
            let demand = self.modes.torque_permille;
            demand + (self.profile_torque_target() - demand).max(-step).min(step)
        };
    }

    /// Returns the torque to which mode 4 goes, thousandths of the rated torque: 0 in a halt.
    fn profile_torque_target(&self) -> f32 {
        if self.profile.stop_cause() == Some(StopCause::Halt) {
            0.0
        } else {
            1e3 * self.profile.target_share()
        }
    }

    /// Returns a current in thousandths of the rated one.
    #[inline(never)]
    fn permille_of(&self, joint: &JointBase, current_a: f32) -> f32 {
        current_a / joint.rated_current_a() * 1e3
    }

    /// 6074h: the demand before the compensation, thousandths of the rated torque.
    pub(crate) fn torque_demand(&self, joint: &JointBase) -> i16 {
        if joint.supervisor.is_armed() {
            self.permille_of(joint, self.demand_a(joint)) as i16
        } else {
            0
        }
    }

    /// Returns the current that is commanded now, A.
    fn demand_a(&self, joint: &JointBase) -> f32 {
        self.setpoint(joint, joint.now_us).current_a
    }

    /// Returns the bits 10 and 12 of the statusword in the modes 3 and 4.
    pub(crate) fn profile_mode_bits(&self, joint: &JointBase) -> u16 {
        let (drive, modes) = (&joint.settings.drive, &self.modes);
        let when = |bit: u16, is_so: bool| if is_so { bit } else { 0 };
        let is_stopping = self.profile.stop_cause().is_some();
        match self.profile.mode {
            profile::PV => {
                let is_reached = modes.reached_reports > drive.velocity_time_ms && !is_stopping;
                when(status::TARGET_REACHED, is_reached)
                    | when(status::STANDS, modes.standing_reports > drive.threshold_time_ms)
            }
            profile::TQ => {
                let is_reached = modes.torque_permille == self.profile_torque_target();
                when(status::TARGET_REACHED, is_reached)
            }
            _ => 0,
        }
    }

    /// Returns true if a mode commands the bridge, so that a change from or to it has no gap.
    fn is_driving_mode(&self, mode: i8) -> bool {
        mode == profile::HOMING && self.profile.homes_at_stop()
            || [profile::PP, profile::PV, profile::TQ].contains(&mode)
            || [profile::CSP, profile::CSV, profile::CST].contains(&mode)
    }

    /// Sets a mode that the joint has. While the drive is enabled, the new mode begins with the demand of the one before.
    pub(crate) fn enter_mode(&mut self, joint: &JointBase, mode: i8) -> Result<(), Refused> {
        if !joint.is_bridge_in_use() {
            self.profile.mode = mode;
            self.begin_mode();
            self.profile.target_permille = 0;
            self.profile.target_micro_rad_s = 0;
            self.offsets = Offsets::default();
            self.target_us = None;
            return Ok(());
        }
        let continues = joint.supervisor.is_armed()
            && !joint.settings.is_in_hil()
            && !self.is_commissioning()
            && !self.brake_test.is_running();
        if !continues {
            return Err(Refused::armed());
        }
        if ![self.profile.mode, mode].iter().all(|mode| self.is_driving_mode(*mode)) {
            let why = refusal!(
                "modes_of_operation = {i32}: an enabled drive changes between 1, 3, 4, 8, 9, 10 and homing at a stop only",
                mode
            );
            return Err(Refused::new(Abort::State, why));
        }
        let (demand_a, had_loop) = (self.demand_a(joint), self.mover(joint).has_velocity_loop());
        self.profile.mode = mode;
        self.begin_mode();
        self.offsets = Offsets::default();
        let velocity_rad_s = joint.report().velocity_rad_s;
        self.velocity.continue_from(had_loop, velocity_rad_s, demand_a);
        self.end_position_course();
        let permille = self.permille_of(joint, demand_a);
        self.modes.torque_permille = permille;
        // Not `round`, which needs a function of its own.
        self.profile.target_permille = (permille + 0.5f32.copysign(permille)) as i16;
        self.profile.target_micro_rad_s = micro(self.velocity.command().reference_rad_s);
        self.confirm_target(joint);
        Ok(())
    }

    /// Clears what belongs to a mode.
    fn begin_mode(&mut self) {
        self.profile.homing = Homing::NotBegun;
        self.profile.set_points = SetPoint::default();
        self.modes = ProfileModes::default();
    }
}
