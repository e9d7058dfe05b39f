//! The objects of commissioning: command, limits, progress and results. [`crate::driver::commissioning`] has the
//! procedure.
//!
//! A motor measurement arms the joint for itself only. It does not need confirmed wiring, but every fault stops
//! it. The master must write "continue" within `command_timeout_us`. The results are staged.
//!
//! A friction run moves a commissioned joint through the velocity loop, without compensation. It has no results
//! of its own: its purpose is the log of what the joint sends meanwhile.

use super::{Device, InputSource, JointState};
use crate::control::pi::Margins;
use crate::control::probe::ProbeCommand;
use crate::control::transform::{Rotating, Rotation, binary_angle};
use crate::control::{MotorParameters, PERIOD_S};
use crate::driver::commissioning::friction_run::{FrictionBounds, FrictionRun, FrictionSample};
use crate::driver::commissioning::{AbortReason, Commissioning, CommissioningBounds};
use crate::node::dictionary::records::CommissioningRunObject;
use crate::node::sdo::Abort;
use crate::sensors::encoder::EncoderKind;
use compensator_core::refusal;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// Default current of a run, as a share of the current limit.
const CURRENT_SHARE: f32 = 0.3;
/// Default travel of the joint to either side, rad.
const TRAVEL_RAD: f32 = 0.5;
/// Maximum travel, rad: a turn, for a motor without gear.
const TRAVEL_MAX_RAD: f32 = 6.3;
/// Default speed of the first passes of a friction run, rad/s. It is above the Stribeck curve of a seal, and 0.2
/// rad suffice to stop and reverse with the run's acceleration.
const SPEED_RAD_S: f32 = 2.0;
/// Acceleration of a friction run, rad/s^2, unless the joint's own limit is lower.
const ACCELERATION_RAD_S2: f32 = 20.0;
/// Minimum current for a good measurement, A: 20 times the noise of the sensors.
const CURRENT_MIN_A: f32 = 0.5;

/// Commands.
const STOP: u8 = 0;
const MEASURE: u8 = 1;
const CONTINUE: u8 = 2;
const FRICTION_RUN: u8 = 3;

/// The runs and their settings.
#[derive(Debug)]
pub(super) struct Run {
    run: Commissioning,
    friction: FrictionRun,
    /// The last run was a friction run.
    is_friction_run: bool,
    /// Current in A; 0 selects a share of the limit.
    current_a: f32,
    travel_rad: f32,
    speed_rad_s: f32,
    /// Time of the master's last confirmation.
    alive_us: u64,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            run: Commissioning::default(),
            friction: FrictionRun::default(),
            is_friction_run: false,
            current_a: 0.0,
            travel_rad: TRAVEL_RAD,
            speed_rad_s: SPEED_RAD_S,
            alive_us: 0,
        }
    }
}

impl<F: NorFlash> Device<F> {
    /// Returns true if commissioning controls the bridge.
    #[inline(never)]
    pub(super) fn is_commissioning(&self) -> bool {
        self.is_measuring_motor() || self.is_friction_run()
    }

    /// Returns true while the motor is measured: its parameters are unknown.
    pub(super) fn is_measuring_motor(&self) -> bool {
        self.commissioning.run.is_running()
    }

    /// Returns true during a friction run.
    pub(super) fn is_friction_run(&self) -> bool {
        self.commissioning.friction.is_running()
    }

    /// Takes the levels of Hall sensors, once per tick.
    pub(in crate::driver) fn take_hall(&mut self, levels: u8) {
        self.commissioning.run.take_hall(levels);
    }

    /// Returns the command for the measurement in the interrupt.
    pub(super) fn probe(&self) -> Option<ProbeCommand> {
        self.commissioning.run.probe_command()
    }

    /// Returns the time of the master's last confirmation, us.
    pub(super) const fn confirmed_us(&self) -> u64 {
        self.commissioning.alive_us
    }

    /// Returns the current limit of a friction run, A.
    pub(super) fn friction_limit_a(&self) -> f32 {
        self.commissioning.friction.bounds().current_a
    }

    /// Returns the target velocity of a step of the friction run, rad/s; `None` if it has ended.
    pub(super) fn friction_target(&mut self) -> Option<f32> {
        let sample = FrictionSample {
            position_rad: self.current_loop.report().turned_rad,
            velocity_rad_s: self.current_loop.report().velocity_rad_s,
            commanded_a: self.velocity.command().current_a,
        };
        let run = &mut self.commissioning.friction;
        let speed_rad_s = run.next_speed_rad_s(&sample);
        run.is_running().then_some(speed_rad_s)
    }

    fn commissioning_current_a(&self) -> f32 {
        let requested_a = self.commissioning.current_a;
        if requested_a > 0.0 {
            requested_a
        } else {
            CURRENT_SHARE * self.set().motor.current_limit_a
        }
    }

    pub(in crate::driver) fn write_commissioning(
        &mut self,
        place: u8,
        word: u32,
    ) -> Result<(), Abort> {
        let (name, least, most) = match place {
            CommissioningRunObject::ORDER => return self.order_commissioning(word as u8),
            CommissioningRunObject::CURRENT => {
                (text!("current_a"), CURRENT_MIN_A, self.set().motor.current_limit_a)
            }
            CommissioningRunObject::SPEED => {
                (text!("speed_rad_s"), 1e-2, self.set().motor.velocity_max_rad_s)
            }
            _ => (text!("travel_rad"), 1e-3, TRAVEL_MAX_RAD),
        };
        let number = f32::from_bits(word);
        if !(number >= least && number <= most) {
            let why = refusal!("{name} = {f32}: must be {f32} to {f32}", name, number, least, most);
            return Err(self.staging.refuse(Abort::Value, why));
        }
        let run = &mut self.commissioning;
        *match place {
            CommissioningRunObject::CURRENT => &mut run.current_a,
            CommissioningRunObject::SPEED => &mut run.speed_rad_s,
            _ => &mut run.travel_rad,
        } = number;
        Ok(())
    }

    fn order_commissioning(&mut self, order: u8) -> Result<(), Abort> {
        match order {
            STOP if self.is_commissioning() => self.disarm(),
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
                return Err(self.staging.refuse(Abort::Value, why));
            }
        }
        Ok(())
    }

    fn confirm_master(&mut self) {
        self.commissioning.alive_us = self.now_us;
        self.supervisor.record_command(self.now_us);
    }

    /// Checks the conditions of a run that controls the bridge.
    pub(super) fn may_begin(&mut self) -> Result<(), Abort> {
        self.finish_trial();
        if self.settings.source == InputSource::Bus {
            let why = text!("a joint in HIL drives no motor that could be measured (2001h:1)");
            return Err(self.staging.refuse(Abort::State, why));
        }
        if self.is_armed() {
            let why = text!("the joint is armed: disarm first");
            return Err(self.staging.refuse(Abort::State, why));
        }
        if let Some(why) = self.update_blocks_arming() {
            return Err(self.staging.refuse(Abort::State, why));
        }
        self.confirm_master();
        Ok(())
    }

    fn begin_friction_run(&mut self) -> Result<(), Abort> {
        self.may_begin()?;
        self.arm_supervisor()?;
        let acceleration = self.set().motor.acceleration_max_rad_s2.min(ACCELERATION_RAD_S2);
        let bounds = FrictionBounds {
            current_a: self.commissioning_current_a(),
            travel_rad: self.commissioning.travel_rad,
            speed_rad_s: self.commissioning.speed_rad_s,
            acceleration_rad_s2: acceleration,
        };
        self.commissioning.friction = FrictionRun::begin(bounds);
        self.commissioning.is_friction_run = true;
        self.begin_velocity(acceleration);
        Ok(())
    }

    fn begin_commissioning(&mut self) -> Result<(), Abort> {
        self.may_begin()?;
        self.check_start()?;
        self.supervisor.arm_to_commission(self.now_us).map_err(|refusal| {
            self.blocking = refusal.causes.fault_bits();
            self.staging.refuse(Abort::State, refusal)
        })?;
        let bounds = CommissioningBounds {
            current_a: self.commissioning_current_a(),
            travel_rad: self.commissioning.travel_rad,
            gear_ratio: self.set().motor.gear_ratio,
            bus_v: self.current_loop.report().bus_voltage_v.unwrap_or(0.0),
        };
        self.commissioning.run.begin(bounds);
        self.commissioning.is_friction_run = false;
        Ok(())
    }

    /// Ends a run for a reason; the caller disarms the joint.
    #[inline(never)]
    pub(super) fn end_commissioning(&mut self, reason: AbortReason) {
        self.commissioning.run.end(reason);
        self.commissioning.friction.end(reason);
    }

    /// Ends a run that the supervisor has stopped.
    pub(super) fn watch_commissioning(&mut self) {
        if self.is_commissioning() && !self.supervisor.is_armed() {
            let fault = self.supervisor.state() == JointState::Fault;
            self.end_commissioning(if fault { AbortReason::Fault } else { AbortReason::Stopped });
        }
    }

    /// Runs a step of the measurement with a report. At its end the joint is disarmed.
    pub(super) fn step_commissioning(&mut self) {
        if !self.is_measuring_motor() {
            return;
        }
        let found_all = self.commissioning.run.process_block(&self.current_loop.report().probe);
        if !self.is_measuring_motor() {
            self.supervisor.disarm();
        }
        if found_all {
            self.stage_found();
        }
    }

    /// Stages the measured values. The joint's positive direction and the efficiency of the gear are kept.
    fn stage_found(&mut self) {
        let found = *self.commissioning.run.found();
        let set = self.staging.staged_mut();
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
        if let Some([order, begin_rad]) = self.commissioning.run.found_hall()
            && matches!(kind, EncoderKind::Abz | EncoderKind::AbzHall)
        {
            (set.sensors.hall_order, set.sensors.hall_offset_rad) = (order, begin_rad);
        }
        self.motor.record_measurement(set.wiring_crc());
    }

    pub(in crate::driver) fn commissioning_object(&self) -> CommissioningRunObject {
        let run = &self.commissioning.run;
        let found = run.found();
        let joint = &self.set().friction.compensator;
        let motor = &self.set().motor;
        // Friction holds the rotor back by this part of the current.
        let efficiency =
            joint.torque_constant_nm_per_a / (motor.torque_constant_nm_per_a * motor.gear_ratio);
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
            current_a: self.commissioning_current_a().to_bits(),
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
