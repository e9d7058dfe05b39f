//! The velocity loop of the device: in velocity and position modes, during a stop, and in a friction run.
//!
//! The loop runs a step per report, once a millisecond. Its current, and the velocity reference of the
//! compensator, are sent with the next commands. The age of the set-point remains the time since the master's
//! last message.

use super::Motion;
use crate::control::LoopFlags;
use crate::control::MotorParameters;
use crate::control::velocity_loop::{
    TrackedVelocity, VelocityCommand, VelocityGains, VelocityLoop,
};
use crate::driver::angle::micro;
use crate::driver::loop_data::REPORT_PERIOD_S;
use crate::driver::profile::{CSP, CSV, PV};
use crate::driver::trajectory::VelocityInterpolation;
use crate::joint_node::JointBase;
use core::f32::consts::TAU;

/// Turns per minute of a radian per second.
const RPM: f32 = 60.0 / TAU;

/// Velocity below which a joint that continues in another mode begins at rest, rad/s: the noise of the observer.
const NOISE_RAD_S: f32 = 0.02;

/// Target of a step of the velocity loop.
#[derive(Clone, Copy, Debug)]
pub(crate) enum VelocityTarget {
    /// A velocity that is approached with the acceleration of the gains.
    Slew { gains: VelocityGains, target_rad_s: f32 },
    /// A velocity as it is.
    Track(TrackedVelocity),
}

/// The velocity loop with its gains and its last command.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct VelocityControl {
    control: VelocityLoop,
    gains: VelocityGains,
    command: VelocityCommand,
    /// Targets of the master in CSV.
    course: VelocityInterpolation,
}

impl VelocityControl {
    /// Restarts the loop from the present velocity, rad/s, with these gains and no current.
    fn begin(&mut self, gains: VelocityGains, velocity_rad_s: f32) {
        self.gains = gains;
        self.control = VelocityLoop::begin(velocity_rad_s);
        self.withhold_current();
    }

    /// Restarts the loop from the present velocity, rad/s, with the current that holds a load, A. The last command is
    /// kept until the next step.
    #[inline(never)]
    pub(crate) fn begin_loaded(&mut self, velocity_rad_s: f32, load_a: f32) {
        self.control = VelocityLoop::begin_loaded(velocity_rad_s, load_a);
    }

    /// Continues in another mode. If the loop does not run yet, it begins at this velocity, rad/s, with this current, A. If it
    /// runs, the offset of the mode before stays in the integral.
    #[inline(never)]
    pub(crate) fn continue_from(&mut self, is_running: bool, velocity_rad_s: f32, current_a: f32) {
        if is_running {
            self.control.absorb_feed_forward();
        } else {
            // The inertia would take the noise of the velocity for an acceleration.
            let is_moving = velocity_rad_s.abs() > NOISE_RAD_S;
            self.begin_loaded(if is_moving { velocity_rad_s } else { 0.0 }, current_a);
            self.command = self.control.command(current_a);
        }
        self.begin_course();
    }

    /// Forgets the targets of the master: its course begins at the present reference.
    fn begin_course(&mut self) {
        self.course = VelocityInterpolation::begin(self.command.reference_rad_s);
    }

    /// Commands no current until the next step.
    pub(crate) fn withhold_current(&mut self) {
        self.command = self.control.command(0.0);
    }

    /// Returns the last command.
    pub(crate) const fn command(&self) -> &VelocityCommand {
        &self.command
    }

    /// Returns the gains.
    pub(crate) const fn gains(&self) -> &VelocityGains {
        &self.gains
    }

    /// The reference has changed its direction: so does the friction that the integral holds.
    pub(crate) fn turn_integral(&mut self) {
        self.control.turn_integral();
    }

    /// Runs a step. Returns true if the reference changed its direction.
    pub(crate) fn step(
        &mut self,
        target: VelocityTarget,
        velocity_rad_s: f32,
        limit_a: f32,
        withheld_a: f32,
    ) -> bool {
        let before_rad_s = self.command.reference_rad_s;
        self.command = match target {
            VelocityTarget::Slew { gains, target_rad_s } => {
                self.control.step(&gains, target_rad_s, velocity_rad_s, limit_a, withheld_a)
            }
            VelocityTarget::Track(reference) => {
                self.control.track(&self.gains, reference, velocity_rad_s, limit_a, withheld_a)
            }
        };
        before_rad_s * self.command.reference_rad_s < 0.0
    }
}

impl Motion {
    /// Returns true if the velocity loop commands the joint on its own sensors, by the mode.
    #[inline(never)]
    pub(crate) fn is_in_velocity_loop(&self, joint: &JointBase) -> bool {
        let is_velocity_mode = matches!(self.profile.mode, CSV | PV);
        let is_on_sensors = !joint.settings.is_in_hil();
        is_velocity_mode && is_on_sensors || self.is_in_position_control(joint)
    }

    /// Restarts the velocity loop from the present velocity, at every arming.
    pub(crate) fn begin_velocity(&mut self, joint: &JointBase, acceleration_rad_s2: f32) {
        let set = joint.set();
        let motor = MotorParameters { acceleration_max_rad_s2: acceleration_rad_s2, ..set.motor };
        let constant = set.friction.compensator.torque_constant_nm_per_a;
        let gains = VelocityGains::build(&motor, constant, REPORT_PERIOD_S);
        self.velocity.begin(gains, joint.report().velocity_rad_s);
        self.velocity.begin_course();
    }

    /// Returns the target of a step while the driver holds the joint.
    pub(crate) fn holding_target(&mut self, joint: &JointBase) -> VelocityTarget {
        // The load remains, whether the master goes on to send its offset or not.
        self.velocity.control.absorb_feed_forward();
        self.interrupt_position();
        self.velocity.begin_course();
        let gains = self.stopping.gains(self.velocity.gains());
        VelocityTarget::Slew { gains, target_rad_s: self.holding_velocity(joint) }
    }

    /// Returns the target of a step of CSV.
    pub(crate) fn cyclic_velocity_target(&mut self, joint: &JointBase) -> VelocityTarget {
        self.position.is_limited = false;
        let most_rad_s = self.max_speed_rad_s(joint);
        let last_rad_s = self.profile.target_rad_s(most_rad_s);
        let target_rad_s = self.velocity.course.step().unwrap_or(last_rad_s);
        let target_rad_s = target_rad_s + self.velocity_offset_rad_s();
        let target_rad_s = target_rad_s.max(-most_rad_s).min(most_rad_s);
        let target_rad_s = self.bounded_velocity(joint, target_rad_s);
        VelocityTarget::Slew { gains: *self.velocity.gains(), target_rad_s }
    }

    /// Gives the torque offset to the velocity loop, in the cyclic modes.
    pub(crate) fn feed_torque_forward(&mut self, joint: &JointBase) {
        let is_cyclic = matches!(self.profile.mode, CSP | CSV);
        let offset_a = if is_cyclic { self.offset_current_a(joint) } else { 0.0 };
        self.velocity.control.feed_forward(offset_a);
    }

    /// 60FFh: takes a target of the master.
    pub(crate) fn set_target_velocity(&mut self, joint: &JointBase, target_micro_rad_s: i32) {
        if target_micro_rad_s != self.profile.target_micro_rad_s {
            self.modes.reached_reports = 0;
        }
        self.profile.target_micro_rad_s = target_micro_rad_s;
        let is_followed = self.profile.mode == CSV && !joint.settings.is_in_hil();
        if is_followed && joint.supervisor.is_armed() {
            let target_rad_s = self.profile.target_rad_s(self.max_speed_rad_s(joint));
            let steps = joint.settings.drive.interpolation_ms();
            self.velocity.course.set_target(target_rad_s, steps);
        }
    }

    /// Returns the current that the current loop applied less the last command, A; 0 if none of its limits acted.
    pub(crate) fn withheld_current_a(&self, joint: &JointBase) -> f32 {
        let report = joint.report();
        let applied_a = if report.loop_flags.contains(LoopFlags::VOLTAGE_LIMITED) {
            report.current_a
        } else if report.loop_flags.contains(LoopFlags::CURRENT_LIMITED) {
            report.current_reference_a
        } else {
            return 0.0;
        };
        applied_a - report.feed_forward_current_a - self.velocity.command.current_a
    }

    /// 606Bh, 1e-6 rad/s: the present reference.
    pub(crate) fn velocity_demand(&self) -> i32 {
        micro(self.velocity.command.reference_rad_s)
    }

    /// 6080h: the value that a master wrote, or the motor speed at the joint's maximum speed.
    #[inline(never)]
    pub(crate) fn max_motor_rpm(&self, joint: &JointBase) -> u32 {
        let motor = &joint.set().motor;
        let rated_rpm = motor.velocity_max_rad_s * motor.gear_ratio * RPM;
        self.profile.max_motor_rpm.unwrap_or(rated_rpm as u32)
    }

    /// Returns the maximum speed of the joint, rad/s, within its plausible range.
    #[inline(never)]
    pub(crate) fn max_speed_rad_s(&self, joint: &JointBase) -> f32 {
        let motor = &joint.set().motor;
        let limit_rad_s =
            self.profile.max_motor_rpm.map(|rpm| rpm as f32 / (RPM * motor.gear_ratio));
        limit_rad_s.map_or(motor.velocity_max_rad_s, |limit| limit.min(motor.velocity_max_rad_s))
    }
}
