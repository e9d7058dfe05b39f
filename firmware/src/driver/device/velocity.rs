//! The velocity loop of the device: in velocity and position modes, during a stop, and in a friction run.
//!
//! The loop runs a step per report, once a millisecond. Its current, and the velocity reference of the
//! compensator, are sent with the next commands. The age of the set-point remains the time since the master's
//! last message.

use super::position::VelocityTarget;
use super::{Device, InputSource};
use crate::control::velocity_loop::{VelocityGains, VelocityLoop};
use crate::control::{LoopFlags, Setpoint};
use crate::driver::loop_data::REPORT_PERIOD_S;
use crate::driver::profile::CSV;
use core::f32::consts::TAU;
use embedded_storage::nor_flash::NorFlash;

/// Turns per minute of a radian per second.
const RPM: f32 = 60.0 / TAU;

impl<F: NorFlash> Device<F> {
    /// Returns true if the joint is in velocity mode on its own sensors.
    pub(super) fn is_in_csv(&self) -> bool {
        self.settings.source == InputSource::Sensors && self.profile.mode == CSV
    }

    /// Restarts the velocity loop from the present velocity, at every arming.
    pub(super) fn begin_velocity(&mut self, acceleration_rad_s2: f32) {
        let (motor, joint) = (&self.staging.active().motor, &self.staging.active().friction);
        let mut motor = *motor;
        motor.acceleration_max_rad_s2 = acceleration_rad_s2;
        let constant = joint.compensator.torque_constant_nm_per_a;
        self.velocity_gains = VelocityGains::build(&motor, constant, REPORT_PERIOD_S);
        self.velocity = VelocityLoop::begin(self.report.velocity_rad_s);
        self.velocity_command = self.velocity.command(0.0);
    }

    /// Runs a step with a report.
    pub(super) fn step_velocity(&mut self) {
        let rubs = self.is_friction_run();
        let holds = self.holds_joint();
        let is_in_use = rubs || self.is_in_csv() || holds || self.is_in_position_control();
        if !is_in_use || !self.supervisor.is_bridge_allowed() {
            return;
        }
        let (target, limit_a) = if rubs {
            let (target_rad_s, limit_a) = self.friction_target();
            (VelocityTarget::Slew(self.velocity_gains, target_rad_s), limit_a)
        } else {
            (self.velocity_target(holds), self.rated().0 * self.profile.max_share())
        };
        if rubs && !self.is_friction_run() {
            self.velocity_command = self.velocity.command(0.0);
            self.supervisor.disarm();
            return;
        }
        let before_rad_s = self.velocity_command.reference_rad_s;
        let share = if rubs { 1.0 } else { self.torque_share() };
        let limit_a = limit_a * share * self.supervisor.current_share();
        let withheld_a = self.withheld_current_a();
        self.velocity_command = self.velocity_step(target, limit_a, withheld_a);
        let turned = before_rad_s * self.velocity_command.reference_rad_s < 0.0;
        if rubs && turned {
            self.velocity.turn_integral();
        }
    }

    /// Returns the target of a step, outside of a friction run. `holds`: the driver holds the joint.
    fn velocity_target(&mut self, holds: bool) -> VelocityTarget {
        if holds {
            self.interrupt_position();
            let gains =
                self.stop.map_or(self.velocity_gains, |stop| stop.gains(&self.velocity_gains));
            return VelocityTarget::Slew(gains, self.holding_velocity());
        }
        if self.is_in_csv() {
            self.position.is_limited = false;
            let (target_rad_s, _) = self.profile.target_rad_s(self.max_speed_rad_s());
            let target_rad_s = self.bounded_velocity(target_rad_s);
            return VelocityTarget::Slew(self.velocity_gains, target_rad_s);
        }
        self.position_target()
    }

    /// Returns the current that the current loop applied less the last command, A; 0 if none of its limits acted.
    fn withheld_current_a(&self) -> f32 {
        let report = &self.report;
        let applied_a = if report.loop_flags.contains(LoopFlags::VOLTAGE_LIMITED) {
            report.current_a
        } else if report.loop_flags.contains(LoopFlags::CURRENT_LIMITED) {
            report.current_reference_a
        } else {
            return 0.0;
        };
        applied_a - report.feed_forward_current_a - self.velocity_command.current_a
    }

    /// Returns the set-point, with current and reference of the velocity loop if it is active.
    pub(super) fn with_velocity_command(&self, setpoint: Setpoint) -> Setpoint {
        let is_in_use = self.is_friction_run() || self.is_in_csv() || self.is_in_position_control();
        if !(is_in_use || self.holds_joint()) {
            return self.bounded_setpoint(setpoint);
        }
        let order = self.velocity_command;
        // A stop needs no master.
        let age_s = if self.is_stopping_to_rest() { 0.0 } else { setpoint.age_s };
        Setpoint {
            age_s,
            current_a: order.current_a,
            velocity_reference_rad_s: order.reference_rad_s,
        }
    }

    /// 606Bh, 1e-6 rad/s: the present reference.
    pub(in crate::driver) fn velocity_demand(&self) -> i32 {
        super::drive::micro(self.velocity_command.reference_rad_s)
    }

    /// 6080h: the value that a master wrote, or the motor speed at the joint's maximum speed.
    pub(in crate::driver) fn max_motor_rpm(&self) -> u32 {
        let motor = &self.set().motor;
        let own = motor.velocity_max_rad_s * motor.gear_ratio * RPM;
        self.profile.max_motor_rpm.unwrap_or(own as u32)
    }

    /// Returns the maximum speed of the joint, rad/s, within its plausible range.
    #[inline(never)]
    pub(super) fn max_speed_rad_s(&self) -> f32 {
        let motor = &self.set().motor;
        let limit_rad_s =
            self.profile.max_motor_rpm.map(|rpm| rpm as f32 / (RPM * motor.gear_ratio));
        limit_rad_s.map_or(motor.velocity_max_rad_s, |limit| limit.min(motor.velocity_max_rad_s))
    }
}
