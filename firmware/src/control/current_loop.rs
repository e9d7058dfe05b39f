//! One cycle of the current loop, from sample to duties.
//!
//! ```text
//! encoder  -> observer -> joint velocity, acceleration, position; rotor angle now and 1.5 periods on
//! currents -> Clarke -> Park (angle now) -> i_d, i_q
//! set-point + compensation -> limit -> i_q*          the limit follows the last addition
//! i_q* -> limits of power and voltage -> i_d*, i_q*    i_d* = 0 unless a limit of the bus acts
//! i_d*, i_q* -> PI with feed-forward of the induced voltage -> circle -> inverse Park (angle then)
//!            -> voltage that the dead time will take -> duties
//! ```
//! The state is the observer, two integrals, the last valid bus voltage and the compensator. Parameters
//! ([`Motor`]) and compensator are swapped whole between two cycles. Integrals (in volts) and the observer's
//! state (in SI units) stay valid over a swap. A new compensator starts at rest; over [`FADE_S`] its current
//! replaces the current of the old one.
//!
//! If the set-point is stale or not finite, the current is zero, compensation included. Compensation alone would
//! let a joint without friction run away.

use super::compensation::Compensate;
use super::covariates::{Covariates, MotionReadings};
use super::current_limits::{self, OperatingPoint};
use super::cycle::{CycleResult, Setpoint};
use super::flags::LoopFlags;
use super::observer::Observer;
use super::parameters::Motor;
use super::pi::Integral;
use super::space_vector::{clamp, duties, limit};
use super::transform::{Rotating, Rotation, Stationary, clarke, inverse_clarke};
use super::{Bridge, StageSample, ValidChannels};
use compensator_core::Flags;
use compensator_core::adaptation::Gains;
use compensator_core::compensator::Reading;
use compensator_core::network::Factors;

/// Duration of the cross-fade from the old to the new compensation after a swap, s.
pub const FADE_S: f32 = 5e-3;

/// Number of cycles in which the last valid bus voltage replaces a missing one.
pub const BUS_HOLD_CYCLES: u8 = 20;

/// Maximum age of the load torque for a valid residual, s.
const LOAD_TORQUE_HOLD_S: f32 = 0.1;

/// Square of the share of the voltage circle from which the current is checked against it.
const NEAR_CIRCLE: f32 = 0.8;

/// Phase current above which a reading is limited, A: more than any sensor measures.
const MAX_PLAUSIBLE_A: f32 = 1e6;

/// Maximum sum of the three phase currents, as a share of the overcurrent limit.
const IMBALANCE_SHARE: f32 = 0.1;

/// The current loop of one joint.
#[derive(Clone, Debug)]
pub struct CurrentLoop<C> {
    motor: Motor,
    compensator: C,
    observer: Observer,
    d: Integral,
    q: Integral,
    /// Reference of the q current that the controller follows, A, in the motor's sign.
    reference_q_a: f32,
    /// Current vector of the last cycle; 0 if it was unknown.
    measured: Stationary,
    bus_v: f32,
    bus_age: u8,
    driving: bool,
    /// The last voltage was near the circle, so that the current may need a limit.
    is_near_circle: bool,
    compensating: bool,
    /// Compensation current of the last cycle, A: the start of a cross-fade.
    feed_forward_a: f32,
    /// Weight of the old compensation, 1 at a swap and 0 after [`FADE_S`], and its current, A.
    fade: f32,
    fade_from_a: f32,
}

impl<C: Compensate> CurrentLoop<C> {
    /// Creates a loop whose rotor angle is unknown; bridge open, compensation off.
    pub fn new(motor: Motor, compensator: C) -> Self {
        let mut this = Self {
            observer: Observer::new(&motor),
            motor,
            compensator,
            d: Integral::default(),
            q: Integral::default(),
            reference_q_a: 0.0,
            measured: Stationary::default(),
            bus_v: 0.0,
            bus_age: u8::MAX,
            driving: false,
            is_near_circle: false,
            compensating: false,
            feed_forward_a: 0.0,
            fade: 0.0,
            fade_from_a: 0.0,
        };
        this.compensator.set_enabled(false);
        this
    }

    /// Enables the bridge, or opens it from the next cycle on.
    pub fn set_driving(&mut self, driving: bool) {
        self.driving = driving;
    }

    /// Enables compensation (its slew limit applies) or disables it, from the next cycle on.
    pub fn set_compensating(&mut self, compensating: bool) {
        self.compensating = compensating;
    }

    /// Sets the joint position, rad, after homing.
    pub fn set_position(&mut self, position_rad: f32) {
        self.observer.set_position(&self.motor, position_rad);
    }

    /// Replaces all parameters. Integrals and observer state are kept, unless the encoder or gear parameters
    /// differ: then the rotor angle is unknown until the observer has settled again.
    pub fn swap(&mut self, motor: &Motor) {
        if !motor.has_same_shaft(&self.motor) {
            self.observer = Observer::new(motor);
        }
        self.motor = *motor;
    }

    /// Replaces the compensator. The compensation current cross-fades from the old to the new one in [`FADE_S`]:
    /// it changes by `|old - new| T / FADE_S` per cycle, plus the new compensator's own slew limit.
    pub fn swap_compensator(&mut self, compensator: &C)
    where
        C: Clone,
    {
        if self.compensator.is_enabled() {
            self.fade = 1.0;
            self.fade_from_a = self.feed_forward_a;
        }
        self.compensator.replace(compensator);
        self.compensator.set_enabled(false);
    }

    /// Completes a swap of the compensator.
    pub fn complete_swap(&mut self, compensator: &C) {
        self.compensator.replace_base(compensator);
    }

    /// Returns the parameters in use.
    pub fn motor(&self) -> &Motor {
        &self.motor
    }

    /// Returns the compensator in use.
    pub fn compensator(&self) -> &C {
        &self.compensator
    }

    /// Passes the factors of a network to the compensator, from the next cycle on.
    pub fn supply(&mut self, factors: Option<Factors<f32>>) {
        self.compensator.supply(factors);
    }

    /// Passes gains on the sizes of the model to the compensator, from the next cycle on.
    pub fn set_gains(&mut self, gains: &Gains<f32>) {
        self.compensator.set_gains(gains);
    }

    /// Runs one cycle.
    #[inline]
    pub fn step(
        &mut self,
        sample: &StageSample,
        setpoint: &Setpoint,
        covariates: &Covariates,
    ) -> CycleResult {
        let mut flags = LoopFlags::BRIDGE_OFF.when(!self.driving);
        let measured = self.phase_currents(sample, &mut flags);
        self.measured = measured;
        // The Park transform needs the rotor angle, so the observer comes first.
        let angle = self.update_observer(sample, &mut flags);
        let speed = self.observer.motor_velocity_rad_s();
        let pole_pairs = self.motor.pole_pairs;
        let at = |delay_units: f32| {
            let ahead = (speed * delay_units) as i32 as u32;
            Rotation::at(angle.wrapping_add(ahead).wrapping_mul(pole_pairs))
        };
        let current = at(self.motor.park_units).park(measured);

        let mut cycle = self.compute_reference(setpoint, covariates, flags);
        cycle.bus_v = self.update_bus_voltage(sample, &mut cycle.flags);
        self.compute_duties(&mut cycle, current, at(self.motor.drive_units));
        cycle.current_d_a = current.d;
        cycle.current_q_a = current.q * self.motor.joint_direction;
        self.compute_residual(&mut cycle, covariates);
        cycle
    }

    /// Returns the rotor's mechanical angle, 2^-32 turns.
    #[inline(always)]
    pub fn rotor_angle(&self) -> u32 {
        self.observer.angle()
    }

    /// Returns the current vector of the last cycle; 0 if it was unknown, which the flags of that cycle report.
    pub const fn measured_current(&self) -> Stationary {
        self.measured
    }

    /// Returns the current vector from three shunts or two; 0 if it is unknown.
    #[inline(always)]
    fn phase_currents(&self, sample: &StageSample, flags: &mut LoopFlags) -> Stationary {
        let [a, b, c] = sample.currents_a;
        let all = ValidChannels::CURRENT_A
            .union(ValidChannels::CURRENT_B)
            .union(ValidChannels::CURRENT_C);
        let valid = sample.valid.intersection(all);
        let three = valid == all;
        let phases = if three {
            [a, b, c]
        } else if valid == ValidChannels::CURRENT_A.union(ValidChannels::CURRENT_B) {
            [a, b, -a - b]
        } else if valid == ValidChannels::CURRENT_A.union(ValidChannels::CURRENT_C) {
            [a, -a - c, c]
        } else if valid == ValidChannels::CURRENT_B.union(ValidChannels::CURRENT_C) {
            [-b - c, b, c]
        } else {
            [f32::NAN; 3]
        };
        // If any phase is infinite or NaN, so is the sum of magnitudes.
        let [a, b, c] = phases;
        let (x, y, z) = (a.abs(), b.abs(), c.abs());
        let magnitude = x + y + z;
        if !magnitude.is_finite() {
            *flags |= LoopFlags::CURRENT_INVALID;
            return Stationary::default();
        }
        let bound = self.motor.overcurrent_a;
        *flags |= LoopFlags::OVERCURRENT.when((x > bound) | (y > bound) | (z > bound));
        let sum = (a + b + c).abs();
        *flags |= LoopFlags::CURRENT_IMBALANCE.when(three & (sum > IMBALANCE_SHARE * bound));
        // Currents that no sensor can measure would make products that are not finite.
        if magnitude > MAX_PLAUSIBLE_A {
            return clarke(phases.map(|phase| clamp(phase, MAX_PLAUSIBLE_A)));
        }
        clarke(phases)
    }

    /// Updates the observer with the sample; returns the rotor angle.
    #[inline(always)]
    fn update_observer(&mut self, sample: &StageSample, flags: &mut LoopFlags) -> u32 {
        let motor = &self.motor;
        let measured = sample
            .valid
            .contains(ValidChannels::ENCODER)
            .then(|| motor.rotor_angle(sample.encoder));
        let encoder = self.observer.step(motor, measured);
        *flags |= LoopFlags::NOT_FINITE.when(!self.observer.ensure_finite(motor));
        *flags |= LoopFlags::ENCODER_INVALID.when(encoder.is_invalid);
        *flags |= LoopFlags::ENCODER_IMPLAUSIBLE.when(encoder.is_implausible);
        *flags |= LoopFlags::ENCODER_COASTING.when(encoder.is_coasting);
        *flags |= LoopFlags::ENCODER_LOST.when(encoder.is_lost);
        *flags |= LoopFlags::POSITION_UNREFERENCED.when(!self.observer.is_referenced());
        match measured {
            // The measured angle: the observer lags while the joint accelerates.
            Some(angle) if !encoder.is_coasting => angle,
            _ => self.observer.angle(),
        }
    }

    /// Adds set-point and compensation, then limits the sum.
    #[inline(always)]
    fn compute_reference(
        &mut self,
        setpoint: &Setpoint,
        covariates: &Covariates,
        mut flags: LoopFlags,
    ) -> CycleResult {
        let command = self.usable_command(setpoint, &mut flags);
        let compensate = self.compensator.is_enabled();
        flags |= LoopFlags::COMPENSATION_OFF.when(!compensate);
        flags |= LoopFlags::COVARIATE_INVALID.when(covariates.has_invalid());

        let motor = &self.motor;
        let velocity_rad_s = self.observer.velocity_rad_s(motor);
        let acceleration_rad_s2 = self.observer.acceleration_rad_s2(motor);
        let position_rad = self.observer.position_rad(motor);
        let speed_rad_s = velocity_rad_s.abs();
        flags |= LoopFlags::VELOCITY_EXCEEDED.when(speed_rad_s > motor.velocity_max_rad_s);
        flags |= LoopFlags::OVERSPEED.when(speed_rad_s > motor.overspeed_rad_s);
        let age_s = self.observer.age_s();
        let observed = |value| Reading { value, age_s };
        let inputs = covariates.inputs(MotionReadings {
            velocity_rad_s: observed(velocity_rad_s),
            velocity_reference_rad_s: Reading {
                value: setpoint.velocity_reference_rad_s,
                age_s: setpoint.age_s,
            },
            position_rad: if self.observer.is_referenced() {
                observed(position_rad)
            } else {
                Reading::missing()
            },
            acceleration_rad_s2: observed(acceleration_rad_s2),
        });
        let output = self.compensator.step(&inputs);
        let cross_fade_a = self.cross_fade_a(compensate, output.feed_forward_current_a, &mut flags);
        // Adding 0 would turn -0 into 0. Without a cross-fade the command keeps its bits.
        let command = if cross_fade_a == 0.0 { command } else { command + cross_fade_a };
        let (sum, mut compensator) = self.compensator.sum(command, &output);
        // The compensator applies the joint's limit; this is the motor's.
        let limited = clamp(sum, self.motor.current_limit_a);
        let reference = self.limit_vector(limited, &mut flags);
        let limited = reference.q * self.motor.joint_direction;
        compensator.set(Flags::DISABLED, !compensate);
        let acted = limited != sum || compensator.contains(Flags::CURRENT_LIMITED);
        flags |= LoopFlags::CURRENT_LIMITED.when(acted);
        self.feed_forward_a = output.feed_forward_current_a + cross_fade_a;
        CycleResult {
            current_reference_a: limited,
            current_d_reference_a: reference.d,
            position_rad,
            velocity_rad_s,
            acceleration_rad_s2,
            friction_torque_nm: output.friction_torque_nm,
            feed_forward_current_a: self.feed_forward_a,
            flags,
            compensator,
            ..CycleResult::default()
        }
    }

    /// Returns the current of the set-point, A; 0 if it is too old or not finite. Enables the compensation if it is usable.
    #[inline(always)]
    fn usable_command(&mut self, setpoint: &Setpoint, flags: &mut LoopFlags) -> f32 {
        // False for a negative or NaN age, too.
        let is_fresh = setpoint.age_s >= 0.0 && setpoint.age_s <= self.motor.setpoint_timeout_s;
        let is_finite = setpoint.current_a.is_finite();
        *flags |= LoopFlags::SETPOINT_STALE.when(!is_fresh);
        *flags |= LoopFlags::SETPOINT_INVALID.when(is_fresh & !is_finite);
        let is_usable = is_fresh & is_finite;
        let compensate =
            self.compensating & self.driving & is_usable & !flags.contains(LoopFlags::ENCODER_LOST);
        if compensate != self.compensator.is_enabled() {
            self.compensator.set_enabled(compensate);
        }
        if is_usable { setpoint.current_a } else { 0.0 }
    }

    /// Returns the reference vector, in the motor's sign, for a limited current in the joint's sign.
    #[inline(always)]
    fn limit_vector(&self, limited_a: f32, flags: &mut LoopFlags) -> Rotating {
        let motor = &self.motor;
        let q = limited_a * motor.joint_direction;
        // Both limits are far away in nearly every period.
        let is_near_limit = self.is_near_circle | (self.bus_v > motor.braking_start_v);
        if !is_near_limit {
            return Rotating { d: 0.0, q };
        }
        self.limit_near_bounds(q, flags)
    }

    /// Applies the limits of voltage and braking power.
    #[cold]
    fn limit_near_bounds(&self, q: f32, flags: &mut LoopFlags) -> Rotating {
        let motor = &self.motor;
        if !self.driving {
            return Rotating { d: 0.0, q };
        }
        let at = OperatingPoint {
            electrical_rad_s: self.observer.motor_velocity_rad_s() * motor.pole_pairs_f32,
            bus_v: self.bus_v,
            limit_a: motor.current_limit_a.min(self.compensator.current_limit_a()),
        };
        let (vector, limits) = current_limits::limit(motor, q, &at);
        *flags |= limits;
        vector
    }

    /// Returns the current that a cross-fade adds to the new compensation, A; 0 without one.
    #[inline(always)]
    fn cross_fade_a(
        &mut self,
        compensate: bool,
        feed_forward_a: f32,
        flags: &mut LoopFlags,
    ) -> f32 {
        // By its bits: a comparison of floats costs more, and a cross-fade is rare.
        if self.fade.to_bits() == 0 {
            return 0.0;
        }
        self.step_cross_fade(compensate, feed_forward_a, flags)
    }

    /// Runs a period of a cross-fade; returns its current, A.
    #[cold]
    fn step_cross_fade(
        &mut self,
        compensate: bool,
        feed_forward_a: f32,
        flags: &mut LoopFlags,
    ) -> f32 {
        if !compensate {
            self.fade = 0.0;
        }
        let share = self.fade;
        *flags |= LoopFlags::CROSS_FADING.when(share > 0.0);
        let left = share - self.motor.period_s * (1.0 / FADE_S);
        // `f32::max` is a call on this core.
        self.fade = if left > 0.0 { left } else { 0.0 };
        share * (self.fade_from_a - feed_forward_a)
    }

    /// Updates the bus voltage and returns it, V; 0 if it is unknown.
    #[inline(always)]
    fn update_bus_voltage(&mut self, sample: &StageSample, flags: &mut LoopFlags) -> f32 {
        let (bus, motor) = (sample.bus_v, &self.motor);
        if sample.valid.contains(ValidChannels::BUS) && bus > 0.0 && bus.is_finite() {
            *flags |= LoopFlags::BUS_UNDERVOLTAGE.when(bus < motor.bus_min_v);
            *flags |= LoopFlags::BUS_OVERVOLTAGE.when(bus > motor.bus_max_v);
            self.bus_v = bus;
            self.bus_age = 0;
        } else {
            *flags |= LoopFlags::BUS_INVALID;
            self.bus_age = self.bus_age.saturating_add(1);
            if self.bus_age > BUS_HOLD_CYCLES {
                self.bus_v = 0.0;
            }
        }
        *flags |= LoopFlags::BUS_UNKNOWN.when(self.bus_v == 0.0);
        self.bus_v
    }

    /// Computes the duties from the current error, or leaves the bridge open.
    #[inline(always)]
    fn compute_duties(&mut self, cycle: &mut CycleResult, current: Rotating, then: Rotation) {
        let motor = &self.motor;
        if !self.driving {
            self.d = Integral::default();
            self.q = Integral::default();
            self.reference_q_a = 0.0;
            self.is_near_circle = false;
            return;
        }
        // The bridge is open in this cycle; the integrals keep their values.
        if cycle.flags.intersects(LoopFlags::FAULTS) {
            return;
        }
        let electrical = self.observer.motor_velocity_rad_s() * motor.pole_pairs_f32;
        let wanted_q_a = cycle.current_reference_a * motor.joint_direction;
        self.reference_q_a += motor.reference_gain * (wanted_q_a - self.reference_q_a);
        let reference = Rotating { d: cycle.current_d_reference_a, q: self.reference_q_a };
        let error = Rotating { d: reference.d - current.d, q: reference.q - current.q };
        let demand = Rotating {
            d: self.d.output(&motor.d, error.d, -electrical * motor.inductance_q_h * current.q),
            q: self.q.output(
                &motor.q,
                error.q,
                electrical * (motor.inductance_d_h * current.d + motor.flux_vs),
            ),
        };
        if !(demand.d.abs() + demand.q.abs()).is_finite() {
            cycle.flags |= LoopFlags::NOT_FINITE;
            self.d = Integral::default();
            self.q = Integral::default();
            return;
        }
        let radius = cycle.bus_v * motor.radius_per_bus;
        let (applied, limited) = limit(demand, radius);
        let square = demand.d * demand.d + demand.q * demand.q;
        self.is_near_circle = square > NEAR_CIRCLE * (radius * radius);
        cycle.flags |= LoopFlags::VOLTAGE_LIMITED.when(limited);
        self.d.update(&motor.d, error.d, demand.d, applied.d, radius);
        self.q.update(&motor.q, error.q, demand.q, applied.q, radius);
        cycle.voltage_v = applied;
        let phases_v = inverse_clarke(then.inverse_park(applied));
        let phases_v = motor.dead_time.compensate(phases_v, reference, then, cycle.bus_v);
        cycle.bridge = Bridge::Drive(duties(phases_v, cycle.bus_v));
    }

    /// Computes the residual torque.
    #[inline(always)]
    fn compute_residual(&self, cycle: &mut CycleResult, covariates: &Covariates) {
        let load = &covariates.load_torque_nm;
        let reported = load.age_s >= 0.0;
        // Never received: the joint has no such sensor. Old or not finite: the sensor failed.
        let known = !reported || (load.age_s <= LOAD_TORQUE_HOLD_S && load.value.abs() < 1e9);
        let load_nm = if reported && known { load.value } else { 0.0 };
        cycle.motor_torque_nm = cycle.current_q_a * self.compensator.torque_constant_nm_per_a();
        cycle.residual_torque_nm = cycle.motor_torque_nm
            - self.motor.inertia_kg_m2 * cycle.acceleration_rad_s2
            - load_nm
            - cycle.friction_torque_nm;
        let missing = LoopFlags::CURRENT_INVALID
            | LoopFlags::ENCODER_COASTING
            | LoopFlags::ENCODER_LOST
            | LoopFlags::COMPENSATION_OFF;
        cycle.residual_valid = known && !cycle.flags.intersects(missing);
    }
}
