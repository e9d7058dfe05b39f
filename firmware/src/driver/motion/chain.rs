//! What the current loop gets: a chain of stages over one value, decided here and nowhere else.
//!
//! ```text
//! once per report        mover -> target velocity -> current limit -> velocity loop
//! with every command     mover -> wanted (velocity loop, master's torque, test) -> position limits -> age -> loop
//! ```
//! Exactly one [`Mover`] commands the joint at a time. A mover of the velocity loop gets its target limited in position and
//! speed, and its current limited by 6072h, the supervisor and homing. A mover that gives a torque has 6072h, and near the
//! position limits the current with which a velocity loop would keep them.

use super::Motion;
use super::velocity::VelocityTarget;
use crate::control::Setpoint;
use crate::driver::profile;
use crate::joint_node::JointBase;

/// Who commands the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mover {
    /// The measurement of the motor, in the interrupt.
    MotorMeasurement,
    /// The friction run.
    FrictionRun,
    /// The test of the holding brake.
    BrakeTest,
    /// The driver: a stop, or a holding brake that is not yet open.
    Hold,
    /// CSP, PP, or homing at a stop.
    Position,
    /// CSV.
    CyclicVelocity,
    /// Mode 3.
    ProfileVelocity,
    /// CST or mode 4.
    Torque,
    /// Homing by the present position, which gives no torque.
    TorqueFree,
    /// Command frames, without a mode of CiA 402.
    Commands,
}

impl Mover {
    /// Returns true if the velocity loop gives the current.
    pub(crate) const fn has_velocity_loop(self) -> bool {
        use Mover::{CyclicVelocity, FrictionRun, Hold, Position, ProfileVelocity};
        matches!(self, FrictionRun | Hold | Position | CyclicVelocity | ProfileVelocity)
    }

    /// Returns true if a master gives the torque, and no loop above the current loop holds the speed.
    pub(crate) const fn is_torque(self) -> bool {
        matches!(self, Self::Torque | Self::TorqueFree | Self::Commands)
    }
}

impl Motion {
    /// Returns who commands the joint.
    #[inline(never)]
    pub(crate) fn mover(&self, joint: &JointBase) -> Mover {
        let is_on_sensors = !joint.settings.is_in_hil();
        match self.profile.mode {
            _ if self.is_measuring_motor() => Mover::MotorMeasurement,
            _ if self.is_friction_run() => Mover::FrictionRun,
            _ if self.brake_test.is_running() => Mover::BrakeTest,
            _ if self.holds_joint(joint) => Mover::Hold,
            _ if self.is_in_position_control(joint) => Mover::Position,
            profile::CSV if is_on_sensors => Mover::CyclicVelocity,
            profile::PV if is_on_sensors => Mover::ProfileVelocity,
            profile::CST | profile::TQ => Mover::Torque,
            _ if self.profile.is_active() => Mover::TorqueFree,
            _ => Mover::Commands,
        }
    }

    /// Runs a step of the loops above the current loop, with a report.
    pub(crate) fn step_motion(&mut self, joint: &JointBase) {
        self.step_offsets(joint);
        self.step_profile_modes(joint);
        let mover = self.mover(joint);
        if mover == Mover::BrakeTest {
            return self.step_brake_test(joint);
        }
        if !mover.has_velocity_loop() || !joint.supervisor.is_bridge_allowed() {
            return;
        }
        let Some(target) = self.target_velocity(joint, mover) else {
            // The friction run has ended.
            self.velocity.withhold_current();
            self.orders.disarms = true;
            return;
        };
        let limit_a = self.velocity_loop_limit_a(joint, mover);
        let (velocity_rad_s, withheld_a) =
            (joint.report().velocity_rad_s, self.withheld_current_a(joint));
        let has_turned = self.velocity.step(target, velocity_rad_s, limit_a, withheld_a);
        if mover == Mover::FrictionRun && has_turned {
            self.velocity.turn_integral();
        }
    }

    /// Stage 1 of the velocity loop: its target, within the limits of speed and position.
    fn target_velocity(&mut self, joint: &JointBase, mover: Mover) -> Option<VelocityTarget> {
        if matches!(mover, Mover::Position | Mover::CyclicVelocity | Mover::ProfileVelocity) {
            self.feed_torque_forward(joint);
        }
        Some(match mover {
            Mover::FrictionRun => {
                let target_rad_s = self.friction_target(joint)?;
                VelocityTarget::Slew { gains: *self.velocity.gains(), target_rad_s }
            }
            Mover::Hold => self.holding_target(joint),
            Mover::ProfileVelocity => self.profile_velocity_target(joint),
            Mover::CyclicVelocity => self.cyclic_velocity_target(joint),
            _ => self.position_target(joint),
        })
    }

    /// Stage 2 of the velocity loop: the limit of its current, A.
    fn velocity_loop_limit_a(&self, joint: &JointBase, mover: Mover) -> f32 {
        let limit_a = match mover {
            Mover::FrictionRun => self.commissioning.friction.bounds().current_a,
            _ => joint.rated_current_a() * self.profile.max_share() * self.torque_share(joint),
        };
        limit_a * joint.supervisor.current_share()
    }

    /// Returns what the current loop gets.
    #[inline(never)]
    pub(crate) fn setpoint(&self, joint: &JointBase, now_us: u64) -> Setpoint {
        let mover = self.mover(joint);
        let wanted = self.wanted(joint, mover, now_us);
        let current_a = match mover {
            Mover::Torque => self.bounded_current_a(joint, wanted.current_a),
            _ => wanted.current_a,
        };
        Setpoint { current_a, age_s: self.setpoint_age_s(joint, mover, now_us), ..wanted }
    }

    /// Stage 1 of the set-point: current and velocity reference of the mover, within 6072h.
    fn wanted(&self, joint: &JointBase, mover: Mover, now_us: u64) -> Setpoint {
        let (current_a, velocity_reference_rad_s) = match mover {
            Mover::MotorMeasurement => (0.0, 0.0),
            Mover::BrakeTest => (self.brake_test.current_a(), 0.0),
            Mover::Torque => (self.torque_mode_current_a(joint), f32::NAN),
            Mover::TorqueFree => (0.0, f32::NAN),
            Mover::Commands => return joint.received.setpoint(now_us),
            _ => {
                let command = self.velocity.command();
                (command.current_a, command.reference_rad_s)
            }
        };
        Setpoint { current_a, velocity_reference_rad_s, age_s: 0.0 }
    }

    /// Returns the current of a torque mode, A: the ramp of mode 4, or target and torque offset of CST within 6072h; 0 in any
    /// other mode.
    #[inline(never)]
    pub(crate) fn torque_mode_current_a(&self, joint: &JointBase) -> f32 {
        let rated_a = joint.rated_current_a();
        match self.profile.mode {
            profile::TQ => self.modes.torque_permille * 1e-3 * rated_a,
            profile::CST => {
                let most_a = self.profile.max_share() * rated_a;
                let wanted_a = self.profile.target_share() * rated_a + self.offset_current_a(joint);
                wanted_a.max(-most_a).min(most_a)
            }
            _ => 0.0,
        }
    }

    /// Last stage of the set-point: its age, s, which is the time since who must confirm it did; 0 if nobody must.
    fn setpoint_age_s(&self, joint: &JointBase, mover: Mover, now_us: u64) -> f32 {
        let since_us = match mover {
            Mover::MotorMeasurement | Mover::FrictionRun => self.commissioning.confirmed_us,
            Mover::BrakeTest if self.brake_test.is_requested() => return 0.0,
            Mover::Hold if self.stopping.is_to_rest() => return 0.0,
            _ if !self.profile.is_active() => return joint.received.setpoint(now_us).age_s,
            _ => match self.target_us {
                Some(target_us) => target_us,
                None => return Setpoint::NONE.age_s,
            },
        };
        now_us.saturating_sub(since_us) as f32 * 1e-6
    }
}
