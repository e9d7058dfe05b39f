//! Commissioning by the driver itself, as objects: order, bounds, progress, what was found. The run is
//! [`crate::driver::commissioning`]'s.
//!
//! A run arms the joint for itself alone, in spite of nobody having confirmed its wiring and of nothing else: every fault stops
//! it. The master lives as long as it writes that it goes on, within `command_timeout_us`. What is found is staged.
//! A friction run moves a joint that is commissioned, through the velocity loop and without compensation; it finds nothing by
//! itself: what the joint says of itself meanwhile, logged, is what it is for.

use super::{Device, Source, State};
use crate::control::Setpoint;
use crate::control::probe::ProbeOrder;
use crate::control::transform::{Rotating, Rotation, binary_angle};
use crate::driver::commissioning::friction_run::{FrictionBounds, FrictionRun, Seen};
use crate::driver::commissioning::{Bounds, Commissioning, Reason};
use crate::node::dictionary::records::CommissioningRun;
use crate::node::sdo::Abort;
use compensator_core::parameters::Digits;
use embedded_storage::nor_flash::NorFlash;

/// Share of the current limit a run takes where nobody says.
const CURRENT_SHARE: f32 = 0.3;
/// How far the joint may go to either side where nobody says, rad.
const TRAVEL_RAD: f32 = 0.5;
/// Farthest it may be let go, rad: a turn, for a motor without gear.
const TRAVEL_MAX_RAD: f32 = 6.3;
/// Speed of a friction run's first passes where nobody says, rad/s: above the Stribeck curve of a seal, and 0.2 rad from there
/// to rest and back with the run's acceleration.
const SPEED_RAD_S: f32 = 2.0;
/// Acceleration a friction run reverses with, rad/s^2, where the joint's own is not less.
const ACCELERATION_RAD_S2: f32 = 20.0;
/// Least current that is measured well, A: 20 times the sensors' noise.
const CURRENT_MIN_A: f32 = 0.5;

/// Orders.
const STOP: u8 = 0;
const MEASURE: u8 = 1;
const GO_ON: u8 = 2;
const RUB: u8 = 3;

/// The run and what it was told.
#[derive(Debug)]
pub(super) struct Run {
    run: Commissioning,
    friction: FrictionRun,
    /// The last one was a friction run.
    rubs: bool,
    /// A; 0 for a share of the limit.
    current_a: f32,
    travel_rad: f32,
    speed_rad_s: f32,
    /// When the master last gave a sign of life.
    alive_us: u64,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            run: Commissioning::default(),
            friction: FrictionRun::default(),
            rubs: false,
            current_a: 0.0,
            travel_rad: TRAVEL_RAD,
            speed_rad_s: SPEED_RAD_S,
            alive_us: 0,
        }
    }
}

impl<F: NorFlash> Device<F> {
    /// Whether the bridge is the commissioning's.
    pub(super) fn commissions(&self) -> bool {
        self.measures() || self.rubs()
    }

    /// Whether it measures its motor: nothing is known of it then.
    pub(super) fn measures(&self) -> bool {
        self.commissioning.run.is_running()
    }

    /// Whether it moves for its friction to be seen.
    pub(super) fn rubs(&self) -> bool {
        self.commissioning.friction.is_running()
    }

    /// What the interrupt is to do for it.
    pub(super) fn probe(&self) -> Option<ProbeOrder> {
        self.commissioning.run.order()
    }

    /// The set-point; of a joint that commissions itself, none, as old as the master's sign of life.
    pub(super) fn commanded(&self, now_us: u64) -> Setpoint {
        if !self.commissions() {
            return self.driven(self.live.setpoint(now_us));
        }
        let age_s = now_us.saturating_sub(self.commissioning.alive_us) as f32 * 1e-6;
        let nothing = Setpoint { current_a: 0.0, velocity_reference_rad_s: 0.0, age_s };
        if self.rubs() { self.driven(nothing) } else { nothing }
    }

    /// The velocity a friction run wants, rad/s, and the current it may take, A.
    pub(super) fn friction_target(&mut self) -> (f32, f32) {
        let seen = Seen {
            position_rad: self.report.turned_rad,
            velocity_rad_s: self.report.velocity_rad_s,
            asked_a: self.velocity_order.current_a,
        };
        let run = &mut self.commissioning.friction;
        (run.take(&seen), run.bounds().current_a)
    }

    fn commissioning_current_a(&self) -> f32 {
        let told_a = self.commissioning.current_a;
        if told_a > 0.0 { told_a } else { CURRENT_SHARE * self.set().motor.current_limit_a }
    }

    pub(in crate::driver) fn write_commissioning(
        &mut self,
        place: u8,
        word: u32,
    ) -> Result<(), Abort> {
        let (name, least, most) = match place {
            CommissioningRun::ORDER => return self.order_commissioning(word as u8),
            CommissioningRun::CURRENT => {
                ("current_a", CURRENT_MIN_A, self.set().motor.current_limit_a)
            }
            CommissioningRun::SPEED => ("speed_rad_s", 1e-2, self.set().motor.velocity_max_rad_s),
            _ => ("travel_rad", 1e-3, TRAVEL_MAX_RAD),
        };
        let number = f32::from_bits(word);
        if !(number >= least && number <= most) {
            let [number, least, most] = [number, least, most].map(|n| Digits(n.into()));
            let why = format_args!("{name} = {number}: must be {least} to {most}");
            return Err(self.staging.refuse(Abort::Value, why));
        }
        let run = &mut self.commissioning;
        *match place {
            CommissioningRun::CURRENT => &mut run.current_a,
            CommissioningRun::SPEED => &mut run.speed_rad_s,
            _ => &mut run.travel_rad,
        } = number;
        Ok(())
    }

    fn order_commissioning(&mut self, order: u8) -> Result<(), Abort> {
        match order {
            STOP if self.commissions() => self.disarm(),
            STOP => {}
            // A sign of life, also where nothing runs: a run that has ended is not begun again by a master that has not seen
            // it yet, and one that ended for want of it can be cleared.
            GO_ON => self.sign_of_commissioning(),
            MEASURE => return self.begin_commissioning(),
            RUB => return self.begin_friction_run(),
            _ => {
                let why = format_args!(
                    "order = {order}: must be 0 (stop), 1 (measure the motor), 2 (go on) or 3 (friction run)"
                );
                return Err(self.staging.refuse(Abort::Value, why));
            }
        }
        Ok(())
    }

    fn sign_of_commissioning(&mut self) {
        self.commissioning.alive_us = self.now_us;
        self.supervisor.command_received(self.now_us);
    }

    /// What stands against either run.
    fn may_begin(&mut self) -> Result<(), Abort> {
        if self.settings.source == Source::Bus {
            let why = "a joint fed by the bus drives no motor to be measured (2001h:1)";
            return Err(self.staging.refuse(Abort::State, why));
        }
        if self.is_armed() {
            let why = "the joint is armed: disarm first";
            return Err(self.staging.refuse(Abort::State, why));
        }
        self.sign_of_commissioning();
        Ok(())
    }

    fn begin_friction_run(&mut self) -> Result<(), Abort> {
        self.may_begin()?;
        self.supervisor.arm(self.now_us).map_err(|refusal| {
            self.blocking = refusal.causes.fault_bits();
            self.staging.refuse(Abort::State, refusal)
        })?;
        let acceleration = self.set().motor.acceleration_max_rad_s2.min(ACCELERATION_RAD_S2);
        let bounds = FrictionBounds {
            current_a: self.commissioning_current_a(),
            travel_rad: self.commissioning.travel_rad,
            speed_rad_s: self.commissioning.speed_rad_s,
            acceleration_rad_s2: acceleration,
        };
        self.commissioning.friction = FrictionRun::begin(bounds);
        self.commissioning.rubs = true;
        self.begin_velocity(acceleration);
        Ok(())
    }

    fn begin_commissioning(&mut self) -> Result<(), Abort> {
        self.may_begin()?;
        self.supervisor.arm_to_commission(self.now_us).map_err(|refusal| {
            self.blocking = refusal.causes.fault_bits();
            self.staging.refuse(Abort::State, refusal)
        })?;
        let bounds = Bounds {
            current_a: self.commissioning_current_a(),
            travel_rad: self.commissioning.travel_rad,
            gear_ratio: self.set().motor.gear_ratio,
            bus_v: self.report.bus_voltage_v.unwrap_or(0.0),
        };
        self.commissioning.run.begin(bounds);
        self.commissioning.rubs = false;
        Ok(())
    }

    /// Ends a run for a reason; the joint is disarmed by whoever calls this.
    pub(super) fn end_commissioning(&mut self, reason: Reason) {
        self.commissioning.run.end(reason);
        self.commissioning.friction.end(reason);
    }

    /// The supervisor has looked: what it stopped has ended.
    pub(super) fn watch_commissioning(&mut self) {
        if self.commissions() && !self.supervisor.is_armed() {
            let fault = self.supervisor.state() == State::Fault;
            self.end_commissioning(if fault { Reason::Fault } else { Reason::Stopped });
        }
    }

    /// A report came: a step of the run. Ended, it leaves the joint disarmed.
    pub(super) fn step_commissioning(&mut self) {
        if !self.measures() {
            return;
        }
        let found_all = self.commissioning.run.take(&self.report.probe);
        if !self.measures() {
            self.supervisor.disarm();
        }
        if found_all {
            self.stage_found();
        }
    }

    /// Stages what was found. The joint's positive direction stays where the encoder had it, and the gear's efficiency.
    fn stage_found(&mut self) {
        let found = *self.commissioning.run.found();
        let mut set = self.staging.staged();
        let (motor, joint) = (&mut set.motor, &mut set.friction.compensator);
        let direction = f32::from(found.encoder_direction);
        let constant = found.torque_constant_nm_per_a();
        motor.joint_direction *= motor.encoder_direction * direction;
        motor.encoder_direction = direction;
        motor.encoder_offset_rad = found.encoder_offset_rad;
        motor.pole_pairs = f32::from(found.pole_pairs);
        motor.resistance_ohm = found.resistance_ohm;
        [motor.inductance_d_h, motor.inductance_q_h] = found.inductance_h;
        joint.torque_constant_nm_per_a *= constant / motor.torque_constant_nm_per_a;
        motor.torque_constant_nm_per_a = constant;
        self.staging.stage(set);
    }

    pub(in crate::driver) fn commissioning_object(&self) -> CommissioningRun {
        let run = &self.commissioning.run;
        let found = run.found();
        let joint = &self.set().friction.compensator;
        let motor = &self.set().motor;
        // Of the current that turns the rotor, what friction holds it back by.
        let efficiency =
            joint.torque_constant_nm_per_a / (motor.torque_constant_nm_per_a * motor.gear_ratio);
        let pulls_nm = found.torque_constant_nm_per_a() * motor.gear_ratio * efficiency;
        let behind = Rotation::at(binary_angle(found.lag_rad));
        let along_a = behind.inverse_park(Rotating { d: run.bounds().current_a, q: 0.0 });
        let friction_nm = pulls_nm * along_a.beta;
        let friction = &self.commissioning.friction;
        let (step, reason) = if self.commissioning.rubs {
            (friction.step(), friction.reason())
        } else {
            (run.step(), run.reason())
        };
        CommissioningRun {
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
        }
    }
}
