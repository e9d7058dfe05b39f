//! The runs of commissioning: the measurement of the motor, and the friction run. [`crate::driver::commissioning`] has the
//! procedure.
//!
//! A friction run moves a commissioned joint through the velocity loop, without compensation. It has no results of its own: its
//! purpose is the log of what the joint sends meanwhile.

use super::Motion;
use crate::control::pi::Margins;
use crate::control::transform::{Rotating, Rotation, binary_angle};
use crate::control::{MotorParameters, PERIOD_S};
use crate::driver::commissioning::friction_run::{FrictionRun, FrictionSample};
use crate::driver::commissioning::{AbortReason, Commissioning};
use crate::joint_node::JointBase;
use crate::node::dictionary::records::CommissioningRunObject;
use crate::supervisor::JointState;

/// Default current of a run, as a share of the current limit.
const CURRENT_SHARE: f32 = 0.3;
/// Default travel of the joint to either side, rad.
const TRAVEL_RAD: f32 = 0.5;
/// Default speed of the first passes of a friction run, rad/s. It is above the Stribeck curve of a seal, and 0.2
/// rad suffice to stop and reverse with the run's acceleration.
const SPEED_RAD_S: f32 = 2.0;

with_defaults! {
    /// The runs and their settings.
    #[derive(Debug)]
    pub(crate) struct Run {
        pub(crate) run: Commissioning,
        pub(crate) friction: FrictionRun,
        /// The last run was a friction run.
        pub(crate) is_friction_run: bool,
        /// Current in A; 0 selects a share of the limit.
        pub(crate) current_a: f32,
        pub(crate) travel_rad: f32 = TRAVEL_RAD,
        pub(crate) speed_rad_s: f32 = SPEED_RAD_S,
        /// Time of the master's last confirmation, us.
        pub(crate) confirmed_us: u64,
    }
}

impl Motion {
    /// Returns true if commissioning controls the bridge.
    #[inline(never)]
    pub(crate) fn is_commissioning(&self) -> bool {
        self.is_measuring_motor() || self.is_friction_run()
    }

    /// Returns true while the motor is measured: its parameters are unknown.
    pub(crate) fn is_measuring_motor(&self) -> bool {
        self.commissioning.run.is_running()
    }

    /// Returns true during a friction run.
    pub(crate) fn is_friction_run(&self) -> bool {
        self.commissioning.friction.is_running()
    }

    /// Returns the target velocity of a step of the friction run, rad/s; `None` if it has ended.
    pub(crate) fn friction_target(&mut self, joint: &JointBase) -> Option<f32> {
        let sample = FrictionSample {
            position_rad: joint.report().turned_rad,
            velocity_rad_s: joint.report().velocity_rad_s,
            commanded_a: self.velocity.command().current_a,
        };
        let run = &mut self.commissioning.friction;
        let speed_rad_s = run.next_speed_rad_s(&sample);
        run.is_running().then_some(speed_rad_s)
    }

    /// Returns the current of a run, A.
    pub(crate) fn commissioning_current_a(&self, joint: &JointBase) -> f32 {
        let requested_a = self.commissioning.current_a;
        if requested_a > 0.0 {
            requested_a
        } else {
            CURRENT_SHARE * joint.set().motor.current_limit_a
        }
    }

    /// Ends a run for a reason; the caller disarms the joint.
    #[inline(never)]
    pub(crate) fn end_commissioning(&mut self, reason: AbortReason) {
        self.commissioning.run.end(reason);
        self.commissioning.friction.end(reason);
    }

    /// Ends a run that the supervisor has stopped.
    pub(crate) fn watch_commissioning(&mut self, joint: &JointBase) {
        if self.is_commissioning() && !joint.supervisor.is_armed() {
            let fault = joint.supervisor.state() == JointState::Fault;
            self.end_commissioning(if fault { AbortReason::Fault } else { AbortReason::Stopped });
        }
    }

    pub(crate) fn commissioning_object(&self, joint: &JointBase) -> CommissioningRunObject {
        let run = &self.commissioning.run;
        let found = run.found();
        let compensator = &joint.set().friction.compensator;
        let motor = &joint.set().motor;
        // Friction holds the rotor back by this part of the current.
        let efficiency = compensator.torque_constant_nm_per_a
            / (motor.torque_constant_nm_per_a * motor.gear_ratio);
        let pulls_nm = found.torque_constant_nm_per_a() * motor.gear_ratio * efficiency;
        let behind = Rotation::at(binary_angle(found.lag_rad));
        let along_a = behind.inverse_park(Rotating { d: run.bounds().current_a, q: 0.0 });
        let friction_nm = pulls_nm * along_a.beta;
        let measured = MotorParameters {
            resistance_ohm: found.resistance_ohm,
            inductance_d_h: found.inductance_h[0],
            inductance_q_h: found.inductance_h[1],
            ..*motor
        };
        let is_measured = found.inductance_h[1] > 0.0;
        let bandwidth_hz =
            if is_measured { measured.current_bandwidth_max_hz(PERIOD_S) } else { 0.0 };
        let margins = Margins::at(bandwidth_hz.max(1.0), PERIOD_S);
        let friction = &self.commissioning.friction;
        let (step, reason) = if self.commissioning.is_friction_run {
            (friction.step(), friction.reason())
        } else {
            (run.step(), run.reason())
        };
        CommissioningRunObject {
            order: 0,
            current_a: self.commissioning_current_a(joint).to_bits(),
            travel_rad: self.commissioning.travel_rad.to_bits(),
            step: step as u32,
            reason: reason as u32,
            offset_a_a: found.offset_a[0].to_bits(),
            offset_b_a: found.offset_a[1].to_bits(),
            resistance_ohm: found.resistance_ohm.to_bits(),
            inductance_d_h: found.inductance_h[0].to_bits(),
            inductance_q_h: found.inductance_h[1].to_bits(),
            pole_pairs: found.pole_pairs.into(),
            encoder_direction: found.encoder_direction as u32,
            encoder_offset_rad: found.encoder_offset_rad.to_bits(),
            lag_rad: found.lag_rad.to_bits(),
            torque_constant_nm_per_a: found.torque_constant_nm_per_a().to_bits(),
            friction_torque_nm: friction_nm.to_bits(),
            speed_rad_s: self.commissioning.speed_rad_s.to_bits(),
            dead_time_s: found.dead_time_s.to_bits(),
            dead_time_current_a: found.dead_time_current_a.to_bits(),
            current_bandwidth_hz: bandwidth_hz.to_bits(),
            phase_margin_rad: margins.phase_rad.to_bits(),
            gain_margin: margins.gain.to_bits(),
        }
    }
}
