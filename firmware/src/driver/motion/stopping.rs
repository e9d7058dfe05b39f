//! A stop with a ramp: the velocity loop brings the joint to rest, then the bridge opens or holds it.
//!
//! A stop that ends with an open bridge needs no master: its set-point does not age, and it ends at the latest a
//! second after the ramp would have. A stop that holds the joint (halt, *quick stop active*) needs one.
//! [`crate::driver::profile::stop`] has the reactions.

use super::Motion;
use crate::control::LoopFlags;
use crate::control::velocity_loop::VelocityGains;
use crate::driver::holding_brake::{BrakeInputs, HoldingBrake};
use crate::driver::loop_data::REPORT_PERIOD_S;
use crate::driver::profile::stop::{StopCause, StopReaction, fault_cause};
use crate::driver::profile::{self, STANDSTILL_RAD_S};
use crate::joint_node::JointBase;
use crate::supervisor::CodeSet;

/// Time for which the joint must stand before the bridge opens, us: a few delays of velocity and current.
const REST_US: u64 = 20_000;
/// Maximum velocity towards the position that is held, rad/s.
const HOLDING_RAD_S: f32 = 1.0;
/// Motion within which the load of a braked joint is the same, rad.
const BRAKE_PLAY_RAD: f32 = 0.05;
/// Time after the ramp at which the stop ends although the joint moves, us.
const MARGIN_US: u64 = 1_000_000;

/// A stop under way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stop {
    cause: StopCause,
    deceleration_rad_s2: f32,
    /// The joint is held afterwards.
    holds: bool,
    /// Time at which the stop ends at the latest, us.
    until_us: u64,
    /// Time since which the joint stands, us.
    rest_us: Option<u64>,
    /// The joint stands, and the holding brake closes.
    closes_brake: bool,
}

/// Load of a joint when its brake closed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BrakedLoad {
    /// Current that held it, A.
    load_a: f32,
    /// Its position from the arbitrary zero, rad.
    at_rad: f32,
}

/// The stop under way, and the holding brake.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stopping {
    stop: Option<Stop>,
    /// The low sides are to be shorted while the bridge drives nothing: the reaction to the last stop.
    pub(crate) shorts_low_sides: bool,
    /// Position at which the velocity loop holds the joint, rad from the arbitrary zero.
    held_rad: Option<f32>,
    brake: HoldingBrake,
    /// Load of the joint when the brake closed.
    braked_load: Option<BrakedLoad>,
}

impl Stopping {
    /// Returns the holding brake.
    pub(crate) const fn brake(&self) -> &HoldingBrake {
        &self.brake
    }

    /// Ends the stop.
    pub(crate) fn end(&mut self) {
        self.stop = None;
    }

    /// Returns the gains of the velocity loop, with the ramp of the stop if there is one.
    pub(crate) fn gains(&self, gains: &VelocityGains) -> VelocityGains {
        self.stop.map_or(*gains, |stop| {
            gains.with_acceleration(stop.deceleration_rad_s2, REPORT_PERIOD_S)
        })
    }

    /// Returns true if a stop that ends with an open bridge is under way.
    pub(crate) fn is_to_rest(&self) -> bool {
        self.stop.is_some_and(|stop| !stop.holds)
    }

    /// Returns true if the joint stands, held by a halt.
    pub(crate) fn is_held(&self) -> bool {
        self.stop.is_some_and(|stop| stop.holds && stop.rest_us.is_some())
    }
}

impl Motion {
    /// Returns true if the driver can stop the joint with a ramp: it drives the joint, and does not measure its motor.
    pub(crate) fn can_ramp(&self, joint: &JointBase) -> bool {
        !joint.settings.is_in_hil() && !self.is_commissioning()
    }

    /// Returns the faults after which the joint stops with a ramp.
    pub(crate) fn ramp_faults(&self, joint: &JointBase) -> CodeSet {
        if self.can_ramp(joint) { joint.settings.drive.ramp_faults() } else { CodeSet::EMPTY }
    }

    /// Prepares the reaction to a fault in the observation that follows.
    pub(crate) fn prepare_stops(&mut self, joint: &JointBase) {
        if joint.supervisor.is_armed() {
            // The interrupt opens the bridge before the driver knows the fault.
            let reaction = joint.settings.drive.reaction(StopCause::Fault);
            self.stopping.shorts_low_sides = reaction == StopReaction::Short;
            if self.stopping.is_to_rest() || self.brake_test.is_requested() {
                self.orders.confirms = true;
            }
        }
    }

    /// Selects the reaction of the low sides to faults that opened the bridge.
    pub(crate) fn react_to_fault(&mut self, joint: &JointBase) {
        let faults = joint.supervisor.faults();
        if !faults.is_empty() {
            let reaction = joint.settings.drive.reaction(fault_cause(faults));
            self.stopping.shorts_low_sides = reaction == StopReaction::Short;
        }
    }

    /// Returns true if the bridge is open, its low sides too, and the holding brake is closed: a restart changes nothing.
    pub(crate) fn has_stopped(&self, joint: &JointBase) -> bool {
        let report = joint.report();
        // A board without a current loop samples nothing.
        let is_open = report.sample_age_us.is_none()
            || report.loop_flags.contains(LoopFlags::BRIDGE_OFF) && !report.bridge_shorted;
        let is_closed = self.stopping.brake.is_closed(&joint.settings.drive, joint.now_us);
        !joint.is_bridge_in_use() && is_open && is_closed
    }

    /// Begins, changes or ends a stop according to the supervisor and the controlword.
    pub(crate) fn update_stop(&mut self, joint: &JointBase) {
        if !joint.supervisor.is_bridge_allowed() || !self.can_ramp(joint) {
            self.stopping.stop = None;
            if self.profile.stop_cause().is_some_and(|cause| cause != StopCause::Halt) {
                // A joint in HIL has no ramp.
                self.profile.end_stop();
                self.disarm();
            }
            return;
        }
        let cause = if joint.supervisor.is_stopping() {
            Some(fault_cause(joint.supervisor.faults()))
        } else if self.profile.is_active() {
            // A drive without torque has nothing to halt, and mode 4 halts its torque.
            let is_free = self.is_torque_free_homing() || self.is_in_profile_torque(joint);
            self.profile.stop_cause().filter(|cause| *cause != StopCause::Halt || !is_free)
        } else {
            // Without the profile, only the network stops the joint.
            self.stopping.stop.map(|stop| stop.cause)
        };
        if cause == self.stopping.stop.map(|stop| stop.cause) {
            return;
        }
        let Some(cause) = cause else {
            self.stopping.stop = None;
            return;
        };
        match joint.settings.drive.reaction(cause) {
            StopReaction::Ramp(deceleration) => self.begin_stop(joint, cause, deceleration),
            reaction => {
                self.stopping.shorts_low_sides = reaction == StopReaction::Short;
                self.profile.end_stop();
                self.disarm();
            }
        }
    }

    pub(crate) fn begin_stop(&mut self, joint: &JointBase, cause: StopCause, deceleration: u32) {
        if self.stopping.stop.is_none() && !self.is_in_velocity_loop(joint) {
            self.velocity.begin_loaded(joint.report().velocity_rad_s, joint.load_a());
            self.velocity.withhold_current();
        }
        let deceleration_rad_s2 = deceleration as f32 * 1e-6;
        let ramp_s = self.velocity.command().reference_rad_s.abs() / deceleration_rad_s2;
        let until_us = joint.now_us.saturating_add((ramp_s * 1e6) as u64 + MARGIN_US);
        let holds = joint.settings.drive.holds_after(cause);
        self.stopping.stop = Some(Stop {
            cause,
            deceleration_rad_s2,
            holds,
            until_us,
            rest_us: None,
            closes_brake: false,
        });
        self.stopping.held_rad = None;
    }

    /// Ends a stop when the joint stands, or when it does not stop in time.
    pub(crate) fn watch_stop(&mut self, joint: &JointBase) {
        let (now_us, speed_rad_s) = (joint.now_us, joint.report().velocity_rad_s.abs());
        let is_down = self.stopping.held_rad.is_some();
        let Some(stop) = &mut self.stopping.stop else { return };
        if !is_down || speed_rad_s > STANDSTILL_RAD_S {
            stop.rest_us = None;
        } else if stop.rest_us.is_none() {
            stop.rest_us = Some(now_us);
        }
        let stands = stop.rest_us.is_some_and(|since_us| now_us - since_us >= REST_US);
        if stop.holds || !(stands || now_us >= stop.until_us) {
            return;
        }
        // The motor holds the joint until the brake is closed.
        stop.closes_brake = true;
        if self.stopping.brake.is_closed(&joint.settings.drive, now_us) {
            if joint.settings.drive.brake_output != 0 {
                let (load_a, at_rad) =
                    (self.velocity.command().current_a, joint.report().turned_rad);
                self.stopping.braked_load = Some(BrakedLoad { load_a, at_rad });
            }
            self.stopping.shorts_low_sides = false;
            self.profile.end_stop();
            self.disarm();
        }
    }

    /// Runs a step of the holding brake.
    pub(crate) fn step_brake(&mut self, joint: &JointBase) {
        let report = joint.report();
        let is_driven = joint.supervisor.is_bridge_allowed()
            && !report.loop_flags.contains(LoopFlags::BRIDGE_OFF)
            && !self.is_measuring_motor();
        let is_known = !report.loop_flags.contains(LoopFlags::ENCODER_LOST);
        // Homing by the present position gives no torque, so that the brake must hold the joint.
        let wants_closed = self.stopping.stop.is_some_and(|stop| stop.closes_brake)
            || self.brake_test.is_running()
            || self.is_torque_free_homing() && !self.is_commissioning();
        let inputs = BrakeInputs {
            is_driven,
            wants_closed,
            is_bridge_sound: joint.supervisor.is_braking_allowed(),
            speed_rad_s: is_known.then_some(report.velocity_rad_s.abs()),
            now_us: joint.now_us,
        };
        self.stopping.brake.step(&joint.settings.drive, &inputs);
    }

    /// Returns true in homing by the present position, which gives no torque.
    pub(crate) fn is_torque_free_homing(&self) -> bool {
        self.profile.mode == profile::HOMING && !self.profile.homes_at_stop()
    }

    /// Returns true while the driver holds the joint: a stop, or a brake that is not yet open.
    pub(crate) fn holds_joint(&self, joint: &JointBase) -> bool {
        self.stopping.stop.is_some()
            || joint.supervisor.is_armed()
                && self.can_ramp(joint)
                && !self.is_torque_free_homing()
                && !self.stopping.brake.is_open(&joint.settings.drive, joint.now_us)
    }

    /// Starts the velocity loop with the current that held the joint when the brake closed, if it has not moved since.
    pub(crate) fn preload_brake(&mut self, joint: &JointBase) {
        self.stopping.held_rad = None;
        let Some(BrakedLoad { load_a, at_rad }) = self.stopping.braked_load.take() else { return };
        if (joint.report().turned_rad - at_rad).abs() < BRAKE_PLAY_RAD {
            self.velocity.begin_loaded(joint.report().velocity_rad_s, load_a);
        }
    }

    /// Returns the velocity that holds the joint, rad/s: 0 during a ramp, then a velocity towards the position at which
    /// it ended.
    pub(crate) fn holding_velocity(&mut self, joint: &JointBase) -> f32 {
        let at_rad = joint.report().turned_rad;
        if self.stopping.held_rad.is_none() && self.velocity.command().reference_rad_s != 0.0 {
            return 0.0;
        }
        let held_rad = *self.stopping.held_rad.get_or_insert(at_rad);
        let gain = joint.settings.drive.position_gain as f32 * 1e-3;
        (gain * (held_rad - at_rad)).clamp(-HOLDING_RAD_S, HOLDING_RAD_S)
    }
}
