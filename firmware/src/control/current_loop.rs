//! One cycle of the current loop, from sample to duties.
//!
//! ```text
//! encoder  -> observer -> joint velocity, acceleration, position; attitude now and 1.5 periods on
//! currents -> Clarke -> Park (attitude now) -> i_d, i_q
//! set-point + compensation -> limit -> i_q*          the limit comes after the last addition
//! i_d* = 0, i_q* -> PI, with what speed induces known beforehand -> circle -> inverse Park (then) -> duties
//! ```
//! State: observer, two integrals, the last good bus voltage, the compensator. Parameters ([`Motor`]) and
//! compensator are swapped whole between two cycles: integrals are volts and the observer's state SI, so both
//! stay; a new compensator starts at rest, and over [`FADE_S`] its current takes the place of the old one's.
//!
//! A set-point that is stale or not a number means *no current at all*, compensation included: a joint
//! whose friction is cancelled and which nobody holds would run off.

use super::compensation::Compensate;
use super::flags::LoopFlags;
use super::observer::Observer;
use super::parameters::Motor;
use super::pi::Integral;
use super::space_vector::{clamp, duties, limit};
use super::transform::{Rotating, Rotation, Stationary, clarke};
use super::{Bridge, StageSample, Valid};
use compensator_core::compensator::Reading;
use compensator_core::network::Factors;
use compensator_core::{Flags, Inputs};

/// How long the old compensation fades into the new after a swap, s.
pub const FADE_S: f32 = 5e-3;

/// Cycles the last good bus voltage stands in for a missing one.
pub const BUS_HOLD_CYCLES: u8 = 20;

/// A load torque older than this makes no residual, s.
const LOAD_TORQUE_HOLD_S: f32 = 0.1;

/// Share of the overcurrent three phase currents may sum to.
const IMBALANCE_SHARE: f32 = 0.1;

/// What the joint is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Motor current before compensation, A, positive towards positive joint position.
    pub current_a: f32,
    /// Velocity the joint is meant to have, rad/s; NaN where nobody says.
    pub velocity_reference_rad_s: f32,
    /// Time since it was received, s; negative or NaN for never.
    pub age_s: f32,
}

impl Setpoint {
    /// Nothing has been received.
    pub const NONE: Self = Self { current_a: 0.0, velocity_reference_rad_s: f32::NAN, age_s: -1.0 };
}

/// What is known of the joint beside its encoder; see [`Inputs`] for units.
#[derive(Clone, Copy, Debug)]
pub struct Covariates {
    /// Side load on the shaft, N.
    pub radial_force_n: Reading<f32>,
    /// Outside minus inside pressure, MPa.
    pub pressure_diff_mpa: Reading<f32>,
    /// Temperature at the seal, deg C.
    pub temperature_c: Reading<f32>,
    /// Torque transmitted to the load, Nm.
    pub load_torque_nm: Reading<f32>,
    /// A covariate of this joint's own.
    pub auxiliary: Reading<f32>,
    /// Time since the campaign began, h.
    pub campaign_time_h: f32,
}

impl Covariates {
    /// No sensor at all.
    pub fn none() -> Self {
        let missing = Reading::missing();
        Self {
            radial_force_n: missing,
            pressure_diff_mpa: missing,
            temperature_c: missing,
            load_torque_nm: missing,
            auxiliary: missing,
            campaign_time_h: 0.0,
        }
    }

    /// Whether one of them is said to be measured and is no finite number.
    #[inline(always)]
    fn any_invalid(&self) -> bool {
        let invalid = |r: &Reading<f32>| r.age_s >= 0.0 && !r.value.is_finite();
        invalid(&self.radial_force_n)
            | invalid(&self.pressure_diff_mpa)
            | invalid(&self.temperature_c)
            | invalid(&self.load_torque_nm)
            | invalid(&self.auxiliary)
            | !self.campaign_time_h.is_finite()
    }
}

/// What came of a cycle. Every number is finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// What the bridge is to do in the next period.
    pub bridge: Bridge,
    /// Current along the magnet, A.
    pub current_d_a: f32,
    /// Current that makes torque, A, in the joint's sign.
    pub current_q_a: f32,
    /// What that current should be, after compensation and limits, A.
    pub current_reference_a: f32,
    /// Voltage given along d and q, V, in the motor's sign.
    pub voltage_v: [f32; 2],
    /// Bus voltage the duties were made for, V; 0 where there is none.
    pub bus_v: f32,
    /// Joint position, rad; see [`LoopFlags::POSITION_UNREFERENCED`].
    pub position_rad: f32,
    /// Joint velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Joint acceleration, rad/s^2.
    pub acceleration_rad_s2: f32,
    /// The model's friction torque, Nm, unscaled.
    pub friction_torque_nm: f32,
    /// Current the compensation asked for, A, cross-fade included.
    pub feed_forward_current_a: f32,
    /// Torque of the measured current at the joint, Nm.
    pub motor_torque_nm: f32,
    /// What no part of the model explains, Nm: motor torque less inertia, load torque and friction. A load
    /// torque never heard of counts as 0.
    pub residual_torque_nm: f32,
    /// Whether all parts of the residual were measured and the model was running.
    pub residual_valid: bool,
    /// What the loop replaced, limited or refused.
    pub flags: LoopFlags,
    /// What the compensator did.
    pub compensator: Flags,
}

/// The current loop of one joint.
#[derive(Clone, Debug)]
pub struct CurrentLoop<C> {
    motor: Motor,
    compensator: C,
    observer: Observer,
    d: Integral,
    q: Integral,
    bus_v: f32,
    bus_age: u8,
    driving: bool,
    compensating: bool,
    /// Current of the compensation in the last cycle, A: where a cross-fade begins.
    feed_forward_a: f32,
    /// The old one's share, 1 at a swap and 0 after [`FADE_S`], and its current, A.
    fade: f32,
    fade_from_a: f32,
}

impl<C: Compensate> CurrentLoop<C> {
    /// A loop that knows nothing of its motor yet; bridge open, compensation off.
    pub fn new(motor: Motor, compensator: C) -> Self {
        let mut this = Self {
            observer: Observer::new(&motor),
            motor,
            compensator,
            d: Integral::default(),
            q: Integral::default(),
            bus_v: 0.0,
            bus_age: u8::MAX,
            driving: false,
            compensating: false,
            feed_forward_a: 0.0,
            fade: 0.0,
            fade_from_a: 0.0,
        };
        this.compensator.set_enabled(false);
        this
    }

    /// Lets the loop drive the bridge, or opens it from the next cycle on.
    pub fn set_driving(&mut self, driving: bool) {
        self.driving = driving;
    }

    /// Switches compensation on (it comes in at its slew limit) or off, from the next cycle on.
    pub fn set_compensating(&mut self, compensating: bool) {
        self.compensating = compensating;
    }

    /// Says where the joint is, rad: after homing.
    pub fn set_position(&mut self, position_rad: f32) {
        self.observer.set_position(&self.motor, position_rad);
    }

    /// Takes other parameters, whole. Integrals and observer stay, unless encoder or gear are others:
    /// then the rotor is lost until the observer has settled anew.
    pub fn swap(&mut self, motor: &Motor) {
        if !motor.same_shaft(&self.motor) {
            self.observer = Observer::new(motor);
        }
        self.motor = *motor;
    }

    /// Takes another compensator, whole. The current it adds goes over from
    /// the old one's in [`FADE_S`]: by `|old - new| T / FADE_S` a cycle, and the new one's own slew limit.
    pub fn swap_compensator(&mut self, compensator: &C)
    where
        C: Clone,
    {
        if self.compensator.is_enabled() {
            self.fade = 1.0;
            self.fade_from_a = self.feed_forward_a;
        }
        self.compensator.clone_from(compensator);
        self.compensator.set_enabled(false);
    }

    /// The parameters in use.
    pub fn motor(&self) -> &Motor {
        &self.motor
    }

    /// The compensator in use.
    pub fn compensator(&self) -> &C {
        &self.compensator
    }

    /// Hands its compensator the factors of a network, from the next cycle on.
    pub fn supply(&mut self, factors: Option<Factors<f32>>) {
        self.compensator.supply(factors);
    }

    /// One cycle.
    #[inline]
    pub fn step(
        &mut self,
        sample: &StageSample,
        setpoint: &Setpoint,
        covariates: &Covariates,
    ) -> Cycle {
        let mut flags = LoopFlags::BRIDGE_OFF.when(!self.driving);
        let measured = self.phase_currents(sample, &mut flags);
        // Park needs the attitude, so the observer comes first.
        let angle = self.observe(sample, &mut flags);
        let speed = self.observer.motor_velocity_rad_s();
        let pole_pairs = self.motor.pole_pairs;
        let at = |delay_units: f32| {
            let ahead = (speed * delay_units) as i32 as u32;
            Rotation::at(angle.wrapping_add(ahead).wrapping_mul(pole_pairs))
        };
        let current = at(self.motor.park_units).park(measured);

        let mut cycle = self.reference(setpoint, covariates, flags);
        cycle.bus_v = self.bus(sample, &mut cycle.flags);
        self.drive(&mut cycle, current, at(self.motor.drive_units));
        cycle.current_d_a = current.d;
        cycle.current_q_a = current.q * self.motor.joint_direction;
        self.explain(&mut cycle, covariates);
        cycle
    }

    /// The current vector that was sampled; 0 where it is not known, which a cycle's flags say.
    pub fn measured(&self, sample: &StageSample) -> Stationary {
        self.phase_currents(sample, &mut LoopFlags::empty())
    }

    /// The current vector, from three shunts or two; 0 where it is not known.
    #[inline(always)]
    fn phase_currents(&self, sample: &StageSample, flags: &mut LoopFlags) -> Stationary {
        let [a, b, c] = sample.currents_a;
        let all = Valid::CURRENT_A.union(Valid::CURRENT_B).union(Valid::CURRENT_C);
        let valid = sample.valid.intersection(all);
        let three = valid == all;
        let phases = if three {
            [a, b, c]
        } else if valid == Valid::CURRENT_A.union(Valid::CURRENT_B) {
            [a, b, -a - b]
        } else if valid == Valid::CURRENT_A.union(Valid::CURRENT_C) {
            [a, -a - c, c]
        } else if valid == Valid::CURRENT_B.union(Valid::CURRENT_C) {
            [-b - c, b, c]
        } else {
            [f32::NAN; 3]
        };
        // An infinite or NaN phase makes the sum of magnitudes so, too.
        let [x, y, z] = phases.map(f32::abs);
        if !(x + y + z).is_finite() {
            *flags |= LoopFlags::CURRENT_INVALID;
            return Stationary::default();
        }
        let bound = self.motor.overcurrent_a;
        let [a, b, c] = phases;
        *flags |= LoopFlags::OVERCURRENT.when((x > bound) | (y > bound) | (z > bound));
        let sum = (a + b + c).abs();
        *flags |= LoopFlags::CURRENT_IMBALANCE.when(three & (sum > IMBALANCE_SHARE * bound));
        // Numbers no sensor gives would make products that are not finite.
        clarke(phases.map(|phase| clamp(phase, 1e6)))
    }

    /// Lets the observer take its sample; gives the rotor's angle.
    #[inline(always)]
    fn observe(&mut self, sample: &StageSample, flags: &mut LoopFlags) -> u32 {
        let motor = &self.motor;
        let measured =
            sample.valid.contains(Valid::ENCODER).then(|| motor.rotor_angle(sample.encoder));
        let encoder = self.observer.step(motor, measured);
        *flags |= LoopFlags::NOT_FINITE.when(!self.observer.ensure_finite(motor));
        *flags |= LoopFlags::ENCODER_INVALID.when(encoder.invalid);
        *flags |= LoopFlags::ENCODER_IMPLAUSIBLE.when(encoder.implausible);
        *flags |= LoopFlags::ENCODER_COASTING.when(encoder.coasting);
        *flags |= LoopFlags::ENCODER_LOST.when(encoder.lost);
        *flags |= LoopFlags::POSITION_UNREFERENCED.when(!self.observer.is_referenced());
        match measured {
            // As measured: the observer's lags while the joint accelerates.
            Some(angle) if !encoder.coasting => angle,
            _ => self.observer.angle(),
        }
    }

    /// Set-point and compensation, summed and then limited.
    #[inline(always)]
    fn reference(
        &mut self,
        setpoint: &Setpoint,
        covariates: &Covariates,
        mut flags: LoopFlags,
    ) -> Cycle {
        let motor = &self.motor;
        // Not below 0 and not NaN, either.
        let fresh = setpoint.age_s >= 0.0 && setpoint.age_s <= motor.setpoint_timeout_s;
        let sound = setpoint.current_a.is_finite();
        flags |= LoopFlags::SETPOINT_STALE.when(!fresh);
        flags |= LoopFlags::SETPOINT_INVALID.when(fresh & !sound);
        let usable = fresh & sound;
        let compensate =
            self.compensating & self.driving & usable & !flags.contains(LoopFlags::ENCODER_LOST);
        self.compensator.set_enabled(compensate);
        let compensate = self.compensator.is_enabled();
        flags |= LoopFlags::COMPENSATION_OFF.when(!compensate);
        flags |= LoopFlags::COVARIATE_INVALID.when(covariates.any_invalid());

        let velocity_rad_s = self.observer.velocity_rad_s(motor);
        let acceleration_rad_s2 = self.observer.acceleration_rad_s2(motor);
        let position_rad = self.observer.position_rad(motor);
        flags |= LoopFlags::OVERSPEED.when(velocity_rad_s.abs() > motor.velocity_max_rad_s);
        let age_s = self.observer.age_s();
        let seen = |value| Reading { value, age_s };
        let inputs = Inputs {
            velocity_rad_s: seen(velocity_rad_s),
            velocity_reference_rad_s: Reading {
                value: setpoint.velocity_reference_rad_s,
                age_s: setpoint.age_s,
            },
            position_rad: if self.observer.is_referenced() {
                seen(position_rad)
            } else {
                Reading::missing()
            },
            acceleration_rad_s2: seen(acceleration_rad_s2),
            radial_force_n: covariates.radial_force_n,
            pressure_diff_mpa: covariates.pressure_diff_mpa,
            temperature_c: covariates.temperature_c,
            load_torque_nm: covariates.load_torque_nm,
            auxiliary: covariates.auxiliary,
            campaign_time_h: covariates.campaign_time_h,
        };
        let output = self.compensator.step(&inputs);
        let command = if usable { setpoint.current_a } else { 0.0 };
        let faded = self.faded(compensate, output.feed_forward_current_a, &mut flags);
        // Adding 0 would turn -0 into 0: without a fade the command keeps its bits.
        let command = if faded == 0.0 { command } else { command + faded };
        let (sum, mut compensator) = self.compensator.sum(command, &output);
        // The compensator's limit is the joint's, this one the motor's.
        let limited = clamp(sum, self.motor.current_limit_a);
        // The bus of the cycle before: a capacitor does not change in one.
        let room = (self.motor.bus_brakes_to_v - self.bus_v) * self.motor.braking_per_v;
        let brakes = room < 1.0 && limited * velocity_rad_s < 0.0;
        let limited = if brakes { limited * room.max(0.0) } else { limited };
        compensator.set(Flags::DISABLED, !compensate);
        let acted = limited != sum || compensator.contains(Flags::CURRENT_LIMITED);
        flags |= LoopFlags::CURRENT_LIMITED.when(acted);
        self.feed_forward_a = output.feed_forward_current_a + faded;
        Cycle {
            bridge: Bridge::Off,
            current_d_a: 0.0,
            current_q_a: 0.0,
            current_reference_a: limited,
            voltage_v: [0.0; 2],
            bus_v: 0.0,
            position_rad,
            velocity_rad_s,
            acceleration_rad_s2,
            friction_torque_nm: output.friction_torque_nm,
            feed_forward_current_a: self.feed_forward_a,
            motor_torque_nm: 0.0,
            residual_torque_nm: 0.0,
            residual_valid: false,
            flags,
            compensator,
        }
    }

    /// What a cross-fade adds to the new compensation, A.
    #[inline(always)]
    fn faded(&mut self, compensate: bool, feed_forward_a: f32, flags: &mut LoopFlags) -> f32 {
        if !compensate {
            self.fade = 0.0;
        }
        let share = self.fade;
        *flags |= LoopFlags::CROSS_FADING.when(share > 0.0);
        self.fade = (share - self.motor.period_s * (1.0 / FADE_S)).max(0.0);
        share * (self.fade_from_a - feed_forward_a)
    }

    /// The bus voltage to go by, V; 0 where there is none.
    #[inline(always)]
    fn bus(&mut self, sample: &StageSample, flags: &mut LoopFlags) -> f32 {
        let (bus, motor) = (sample.bus_v, &self.motor);
        if sample.valid.contains(Valid::BUS) && bus > 0.0 && bus.is_finite() {
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

    /// From the currents' error to duties, or an open bridge.
    #[inline(always)]
    fn drive(&mut self, cycle: &mut Cycle, current: Rotating, then: Rotation) {
        let motor = &self.motor;
        if !self.driving {
            self.d = Integral::default();
            self.q = Integral::default();
            return;
        }
        // Open for this cycle; the integrals wait.
        if cycle.flags.intersects(LoopFlags::FAULTS) {
            return;
        }
        let electrical = self.observer.motor_velocity_rad_s() * motor.pole_pairs_f32;
        let error = Rotating {
            d: -current.d,
            q: cycle.current_reference_a * motor.joint_direction - current.q,
        };
        let wanted = Rotating {
            d: self.d.wanted(&motor.d, error.d, -electrical * motor.inductance_q_h * current.q),
            q: self.q.wanted(
                &motor.q,
                error.q,
                electrical * (motor.inductance_d_h * current.d + motor.flux_vs),
            ),
        };
        if !(wanted.d.abs() + wanted.q.abs()).is_finite() {
            cycle.flags |= LoopFlags::NOT_FINITE;
            self.d = Integral::default();
            self.q = Integral::default();
            return;
        }
        let radius = cycle.bus_v * motor.radius_per_bus;
        let (given, limited) = limit(wanted, radius);
        cycle.flags |= LoopFlags::VOLTAGE_LIMITED.when(limited);
        self.d.settle(&motor.d, error.d, wanted.d, given.d, radius);
        self.q.settle(&motor.q, error.q, wanted.q, given.q, radius);
        cycle.voltage_v = [given.d, given.q];
        cycle.bridge = Bridge::Drive(duties(then.inverse_park(given), cycle.bus_v));
    }

    /// What is left when the model has had its say.
    #[inline(always)]
    fn explain(&self, cycle: &mut Cycle, covariates: &Covariates) {
        let load = &covariates.load_torque_nm;
        let reported = load.age_s >= 0.0;
        // Never reported: there is no such sensor. Old or not a number: there is one, and it failed.
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
