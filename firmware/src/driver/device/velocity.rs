//! The device's velocity loop: in mode CSV, and in a friction run.
//!
//! It takes a step with each report, so once a millisecond, and what it asks for goes down with the next orders: as a current,
//! and as the velocity reference the compensator takes. How old the set-point is stays the master's sign of life.

use super::{Device, Source};
use crate::control::Setpoint;
use crate::control::velocity_loop::{VelocityGains, VelocityLoop};
use crate::driver::REPORT_PERIOD_S;
use crate::driver::profile::CSV;
use core::f32::consts::TAU;
use embedded_storage::nor_flash::NorFlash;

/// Turns per minute of a radian per second.
const RPM: f32 = 60.0 / TAU;

impl<F: NorFlash> Device<F> {
    /// Whether the velocity is the drive's.
    fn is_in_csv(&self) -> bool {
        self.settings.source == Source::Sensors && self.profile.mode == CSV
    }

    /// Begins anew, from the velocity the joint has: with every arming.
    pub(super) fn begin_velocity(&mut self, acceleration_rad_s2: f32) {
        let (motor, joint) = (&self.staging.active().motor, &self.staging.active().friction);
        let mut motor = *motor;
        motor.acceleration_max_rad_s2 = acceleration_rad_s2;
        let constant = joint.compensator.torque_constant_nm_per_a;
        self.velocity_gains = VelocityGains::build(&motor, constant, REPORT_PERIOD_S);
        self.velocity = VelocityLoop::begin(self.report.velocity_rad_s);
        self.velocity_order = self.velocity.order(0.0);
    }

    /// A report came: a step.
    pub(super) fn step_velocity(&mut self) {
        let rubs = self.rubs();
        if !(rubs || self.is_in_csv()) || !self.supervisor.is_armed() {
            return;
        }
        let (target_rad_s, limit_a) = if rubs {
            self.friction_target()
        } else {
            let most_a = self.rated().0 * self.profile.max_share();
            (self.profile.target_rad_s(self.max_speed_rad_s()).0, most_a)
        };
        if rubs && !self.rubs() {
            self.velocity_order = self.velocity.order(0.0);
            self.supervisor.disarm();
            return;
        }
        let before_rad_s = self.velocity_order.reference_rad_s;
        let velocity_rad_s = self.report.velocity_rad_s;
        let limit_a = limit_a * self.supervisor.current_share();
        self.velocity_order =
            self.velocity.step(&self.velocity_gains, target_rad_s, velocity_rad_s, limit_a);
        let turned = before_rad_s * self.velocity_order.reference_rad_s < 0.0;
        if rubs && turned {
            self.velocity.turn_integral();
        }
    }

    /// The set-point with the velocity loop's current and reference, where it has the say.
    pub(super) fn driven(&self, setpoint: Setpoint) -> Setpoint {
        if !(self.rubs() || self.is_in_csv()) {
            return setpoint;
        }
        let order = self.velocity_order;
        Setpoint {
            current_a: order.current_a,
            velocity_reference_rad_s: order.reference_rad_s,
            ..setpoint
        }
    }

    /// 606Bh, 1e-6 rad/s: where the reference is on its way to the target.
    pub(in crate::driver) fn velocity_demand(&self) -> i32 {
        super::drive::micro(self.velocity_order.reference_rad_s)
    }

    /// 6080h: what a master wrote, or what the joint's largest speed is of the motor.
    pub(in crate::driver) fn max_motor_rpm(&self) -> u32 {
        let motor = &self.set().motor;
        let own = motor.velocity_max_rad_s * motor.gear_ratio * RPM;
        self.profile.max_motor_rpm.unwrap_or(own as u32)
    }

    /// The same of the joint, rad/s, within what the joint is believed to reach.
    pub(super) fn max_speed_rad_s(&self) -> f32 {
        let motor = &self.set().motor;
        let told = self.profile.max_motor_rpm.map(|rpm| rpm as f32 / (RPM * motor.gear_ratio));
        told.map_or(motor.velocity_max_rad_s, |told| told.min(motor.velocity_max_rad_s))
    }
}
