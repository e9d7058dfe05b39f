//! The objects of commissioning: command, limits and results. [`crate::driver::commissioning`] has the procedure.
//!
//! A motor measurement arms the joint for itself only. It does not need confirmed wiring, but every fault stops it. The master
//! must write "continue" within `command_timeout_us`. The results are staged.

use super::Device;
use crate::control::PERIOD_S;
use crate::driver::commissioning::CommissioningBounds;
use crate::driver::commissioning::friction_run::{FrictionBounds, FrictionRun};
use crate::node::dictionary::records::CommissioningRunObject;
use crate::node::sdo::Abort;
use crate::sensors::encoder::EncoderKind;
use compensator_core::refusal;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// Range of the travel, rad: at most a turn, for a motor without gear.
const TRAVEL_MIN_RAD: f32 = 1e-3;
const TRAVEL_MAX_RAD: f32 = 6.3;
/// Minimum speed of a friction run, rad/s.
const SPEED_MIN_RAD_S: f32 = 1e-2;
/// Acceleration of a friction run, rad/s^2, unless the joint's own limit is lower.
const ACCELERATION_RAD_S2: f32 = 20.0;
/// Minimum current for a good measurement, A: 20 times the noise of the sensors.
const CURRENT_MIN_A: f32 = 0.5;

/// Commands.
const STOP: u8 = 0;
const MEASURE: u8 = 1;
const CONTINUE: u8 = 2;
const FRICTION_RUN: u8 = 3;

impl<F: NorFlash> Device<F> {
    pub(crate) fn write_commissioning(&mut self, place: u8, word: u32) -> Result<(), Abort> {
        let (motor, run) = (&self.base.set().motor, &mut self.motion.commissioning);
        let (name, setting, least, most) = match place {
            CommissioningRunObject::ORDER => return self.order_commissioning(word as u8),
            CommissioningRunObject::CURRENT => {
                (text!("current_a"), &mut run.current_a, CURRENT_MIN_A, motor.current_limit_a)
            }
            CommissioningRunObject::SPEED => (
                text!("speed_rad_s"),
                &mut run.speed_rad_s,
                SPEED_MIN_RAD_S,
                motor.velocity_max_rad_s,
            ),
            _ => (text!("travel_rad"), &mut run.travel_rad, TRAVEL_MIN_RAD, TRAVEL_MAX_RAD),
        };
        let number = f32::from_bits(word);
        if !(number >= least && number <= most) {
            let why = refusal!("{name} = {f32}: must be {f32} to {f32}", name, number, least, most);
            return Err(self.base.refuse(Abort::Value, why));
        }
        *setting = number;
        Ok(())
    }

    fn order_commissioning(&mut self, order: u8) -> Result<(), Abort> {
        match order {
            STOP if self.motion.is_commissioning() => self.disarm(),
            STOP => {}
            // "Continue" is accepted without a run, too. A master that has not yet seen the end of a run must
            // not start it again, and a run that ended for lack of confirmation can be cleared.
            CONTINUE => self.confirm_master(),
            MEASURE => return self.begin_commissioning(),
            FRICTION_RUN => return self.begin_friction_run(),
            _ => {
                let why = refusal!(
                    "order = {u32}: must be 0 (stop), 1 (measure the motor), 2 (continue) or 3 (friction run)",
                    order
                );
                return Err(self.base.refuse(Abort::Value, why));
            }
        }
        Ok(())
    }

    fn confirm_master(&mut self) {
        self.motion.commissioning.confirmed_us = self.base.now_us;
        self.base.supervisor.record_command(self.base.now_us);
    }

    /// Checks the conditions of a run that controls the bridge.
    pub(super) fn may_begin(&mut self) -> Result<(), Abort> {
        self.finish_trial();
        if self.base.settings.is_in_hil() {
            let why = text!("a joint in HIL drives no motor that could be measured (2001h:1)");
            return Err(self.base.refuse(Abort::State, why));
        }
        if self.is_armed() {
            let why = text!("the joint is armed: disarm first");
            return Err(self.base.refuse(Abort::State, why));
        }
        if let Some(why) = self.update_blocks_arming() {
            return Err(self.base.refuse(Abort::State, why));
        }
        self.confirm_master();
        Ok(())
    }

    fn begin_friction_run(&mut self) -> Result<(), Abort> {
        self.may_begin()?;
        self.base.arm()?;
        let acceleration = self.set().motor.acceleration_max_rad_s2.min(ACCELERATION_RAD_S2);
        let bounds = FrictionBounds {
            current_a: self.motion.commissioning_current_a(&self.base),
            travel_rad: self.motion.commissioning.travel_rad,
            speed_rad_s: self.motion.commissioning.speed_rad_s,
            acceleration_rad_s2: acceleration,
        };
        self.motion.commissioning.friction = FrictionRun::begin(bounds);
        self.motion.commissioning.is_friction_run = true;
        self.move_with(&mut |motion, joint| motion.begin_velocity(joint, acceleration));
        Ok(())
    }

    fn begin_commissioning(&mut self) -> Result<(), Abort> {
        self.may_begin()?;
        self.base.check_start()?;
        let armed = self.base.supervisor.arm_to_commission(self.base.now_us);
        armed.map_err(|refusal| self.base.refuse_arming(refusal))?;
        let bounds = CommissioningBounds {
            current_a: self.motion.commissioning_current_a(&self.base),
            travel_rad: self.motion.commissioning.travel_rad,
            gear_ratio: self.set().motor.gear_ratio,
            bus_v: self.base.report().bus_voltage_v.unwrap_or(0.0),
        };
        self.motion.commissioning.run.begin(bounds);
        self.motion.commissioning.is_friction_run = false;
        Ok(())
    }

    /// Runs a step of the measurement with a report. At its end the joint is disarmed.
    pub(super) fn step_commissioning(&mut self) {
        if !self.motion.is_measuring_motor() {
            return;
        }
        let found_all = self.motion.commissioning.run.process_block(&self.base.report().probe);
        if !self.motion.is_measuring_motor() {
            self.base.supervisor.disarm();
        }
        if found_all {
            self.stage_found();
        }
    }

    /// Stages the measured values. The joint's positive direction and the efficiency of the gear are kept.
    fn stage_found(&mut self) {
        let found = *self.motion.commissioning.run.found();
        let set = self.base.staging.staged_mut();
        let (motor, joint) = (&mut set.motor, &mut set.friction.compensator);
        let direction = f32::from(found.encoder_direction);
        let constant = found.torque_constant_nm_per_a();
        motor.joint_direction *= motor.encoder_direction * direction;
        motor.encoder_direction = direction;
        motor.encoder_offset_rad = found.encoder_offset_rad;
        motor.pole_pairs = f32::from(found.pole_pairs);
        motor.resistance_ohm = found.resistance_ohm;
        [motor.inductance_d_h, motor.inductance_q_h] = found.inductance_h;
        motor.dead_time_s = found.dead_time_s;
        motor.dead_time_current_a = found.dead_time_current_a;
        motor.current_bandwidth_hz = motor.current_bandwidth_max_hz(PERIOD_S);
        joint.torque_constant_nm_per_a *= constant / motor.torque_constant_nm_per_a;
        motor.torque_constant_nm_per_a = constant;
        // The electrical angle of other encoders does not count from an index.
        let kind = EncoderKind::of(set.sensors.encoder_kind);
        if let Some(hall) = self.motion.commissioning.run.found_hall()
            && matches!(kind, EncoderKind::Abz | EncoderKind::AbzHall)
        {
            (set.sensors.hall_order, set.sensors.hall_offset_rad) = (hall.order, hall.begin_rad);
        }
        self.base.motor.measured_wiring = Some(set.wiring_crc());
    }
}
