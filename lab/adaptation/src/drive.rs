//! The driver: position and velocity loop with one of the aids against friction.
//!
//! The loops are those of a commissioned joint: P on position, PI on velocity, feed-forward of the known inertia. The aid
//! adds its torque. All arms have the same gains.

use crate::encoder::Encoder;
use crate::motion::Demand;
use crate::plant::{Measured, PERIOD_S};
use compensator_core::adaptation::{Adaptation, AdaptationParameters, Frozen, Gains, Observation};
use compensator_core::compensator::{Compensator, CompensatorParameters, Inputs, Reading};
use compensator_core::configuration::Configuration;
use compensator_core::{ParameterId, Parameters, Quantity, Sample};
use std::f64::consts::TAU;

/// Crossover of the velocity loop by the usual rule, Hz.
const CROSSOVER_HZ: f64 = 4.0;
/// Gain of the position loop per crossover of the velocity loop.
const POSITION_SHARE: f64 = 0.4;
/// Integral time of the velocity loop, s.
const INTEGRAL_S: f64 = 0.1;
/// Largest commanded torque, Nm.
pub const TORQUE_LIMIT_NM: f64 = 20.0;
/// Following error that stops the drive, rad, and its time, s.
const FOLLOWING: [f64; 2] = [0.3, 0.1];
/// Largest commanded speed, rad/s.
const SPEED_LIMIT_RAD_S: f64 = 3.0;
/// Periods of the loop per step of the adaptation.
const ADAPTATION_DIVIDER: u32 = 5;
/// Share of the friction that the compensation and the disturbance observer cancel.
const SCALE: f32 = 0.9;

/// Gains and constants that a person has set.
#[derive(Clone, Copy, Debug)]
pub struct Commissioned {
    /// Known inertia, kg m^2.
    pub inertia_kg_m2: f64,
    /// Gains of both loops per those of the usual rule.
    pub gain_factor: [f64; 2],
}

impl Commissioned {
    /// Returns the crossover of the velocity loop, rad/s.
    fn crossover(&self) -> f64 {
        TAU * CROSSOVER_HZ * self.gain_factor[0]
    }
}

/// A set, and the noise that its identification found.
#[derive(Clone, Debug)]
pub struct TunedSet {
    /// The model.
    pub model: Parameters<f32>,
    /// Residual of the identification, Nm.
    pub noise_nm: f32,
}

impl TunedSet {
    /// Returns the largest torque of the compensation, Nm: that of the box of the adaptation.
    pub fn torque_limit_nm(&self) -> f32 {
        let most = AdaptationParameters::default().largest_gain;
        let level = self.model.get(ParameterId::StaticTorque);
        most * 1.3 * (level + 2.0 * self.model.get(ParameterId::ViscousFriction).abs())
    }

    fn compensator(&self) -> Option<Compensator<f32>> {
        let compensator = CompensatorParameters {
            scale: SCALE,
            torque_limit_nm: self.torque_limit_nm(),
            ..CompensatorParameters::default()
        };
        let configuration = Configuration { model: self.model.clone(), compensator };
        let mut built = Compensator::build(&configuration, PERIOD_S as f32).ok()?;
        built.set_enabled(true);
        Some(built)
    }

    fn adaptation(&self) -> Option<Adaptation> {
        let settings =
            AdaptationParameters { noise_nm: self.noise_nm, ..AdaptationParameters::default() };
        let period_s = PERIOD_S as f32 * ADAPTATION_DIVIDER as f32;
        Adaptation::build(&self.model, &settings, period_s).ok()
    }
}

/// What a drive does against friction.
#[derive(Clone, Debug)]
pub enum Aid {
    /// Nothing.
    Off,
    /// Compensation with a set that does not change.
    Fixed(Box<Compensator<f32>>),
    /// Compensation with gains that follow the joint.
    Adaptive(Box<(Compensator<f32>, Adaptation)>),
    /// Disturbance observer: the filtered torque beyond the inertia, Nm.
    Observer(f64),
}

impl Aid {
    /// Returns a compensation with a set that does not change; off if the set is not valid.
    pub fn fixed(set: &TunedSet) -> Self {
        set.compensator().map_or(Self::Off, |built| Self::Fixed(Box::new(built)))
    }

    /// Returns a compensation that adapts; off if the set is not valid.
    pub fn adaptive(set: &TunedSet) -> Self {
        match (set.compensator(), set.adaptation()) {
            (Some(built), Some(adaptation)) => Self::Adaptive(Box::new((built, adaptation))),
            _ => Self::Off,
        }
    }
}

/// Sums of the samples since the last step of the adaptation.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    velocity: f64,
    torque: f64,
    acceleration: f64,
    is_limited: bool,
    count: u32,
}

/// The driver of one joint.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Gains and constants.
    pub commissioned: Commissioned,
    /// What it does against friction.
    pub aid: Aid,
    /// Position and velocity by the encoder.
    pub encoder: Encoder,
    integral_nm: f64,
    torque_nm: f64,
    /// Torque of the aid, Nm.
    pub aid_nm: f64,
    /// The last valid pressure, Pa, and its age, s.
    pressure: [f64; 2],
    sums: Sums,
    was_lost: bool,
    /// Time of a following error, s.
    following_s: f64,
}

impl Drive {
    /// Creates a drive at rest at this position, rad.
    pub fn new(commissioned: Commissioned, aid: Aid, position_rad: f64) -> Self {
        Self {
            commissioned,
            aid,
            encoder: Encoder::new(position_rad),
            integral_nm: 0.0,
            torque_nm: 0.0,
            aid_nm: 0.0,
            pressure: [0.0, 0.0],
            sums: Sums::default(),
            was_lost: false,
            following_s: 0.0,
        }
    }

    /// Returns true if a following error has stopped the drive. It stays stopped.
    pub fn is_stopped(&self) -> bool {
        self.following_s > FOLLOWING[1]
    }

    /// Returns the gains in use; those of the tuned set without an adaptation.
    pub fn gains(&self) -> Gains<f32> {
        match &self.aid {
            Aid::Adaptive(parts) => *parts.1.gains(),
            _ => Gains::default(),
        }
    }

    /// Returns the torque by the measured current less the inertia, Nm.
    pub fn friction_nm(&self, measured: &Measured) -> f64 {
        measured.torque_nm - self.commissioned.inertia_kg_m2 * self.encoder.acceleration_rad_s2
    }

    /// Processes the measurements of a period. Returns the torque of the next one, Nm.
    pub fn step(&mut self, measured: &Measured, demand: &Demand) -> f64 {
        self.encoder.step(measured.encoder_rad);
        let is_pressure_valid = (0.0..=4e6).contains(&measured.pressure_pa.max(0.0));
        self.pressure[1] += PERIOD_S;
        if is_pressure_valid {
            self.pressure = [measured.pressure_pa.max(0.0), 0.0];
        }
        let is_lost = self.encoder.is_lost();
        if is_lost != self.was_lost {
            // The bridge opens, and the loops start anew.
            self.integral_nm = 0.0;
            match &mut self.aid {
                Aid::Fixed(built) => built.set_enabled(!is_lost),
                Aid::Adaptive(parts) => parts.0.set_enabled(!is_lost),
                Aid::Observer(held_nm) => *held_nm = 0.0,
                Aid::Off => {}
            }
        }
        self.was_lost = is_lost;
        self.adapt(measured, is_lost);
        let error_rad = demand.position_rad - self.encoder.position_rad;
        if !self.is_stopped() {
            let is_far = error_rad.abs() > FOLLOWING[0];
            self.following_s = if is_far { self.following_s + PERIOD_S } else { 0.0 };
        }
        if is_lost || self.is_stopped() {
            (self.torque_nm, self.aid_nm) = (0.0, 0.0);
            return 0.0;
        }
        let crossover = self.commissioned.crossover();
        let gain = POSITION_SHARE * crossover * self.commissioned.gain_factor[1];
        let wanted =
            (demand.velocity_rad_s + gain * error_rad).clamp(-SPEED_LIMIT_RAD_S, SPEED_LIMIT_RAD_S);
        self.aid_nm = self.help(measured, wanted);
        let inertia = self.commissioned.inertia_kg_m2;
        let velocity_error = wanted - self.encoder.velocity_rad_s;
        let proportional_nm = crossover * inertia * velocity_error;
        let before_nm =
            proportional_nm + self.integral_nm + inertia * demand.acceleration_rad_s2 + self.aid_nm;
        self.torque_nm = before_nm.clamp(-TORQUE_LIMIT_NM, TORQUE_LIMIT_NM);
        let change_nm = PERIOD_S / INTEGRAL_S * proportional_nm;
        if before_nm == self.torque_nm || before_nm * change_nm < 0.0 {
            self.integral_nm += change_nm;
        }
        self.torque_nm
    }

    /// Returns the torque of the aid, Nm.
    fn help(&mut self, measured: &Measured, wanted_rad_s: f64) -> f64 {
        let friction_nm = self.friction_nm(measured);
        let share = PERIOD_S * self.commissioned.crossover();
        let inputs = self.inputs(wanted_rad_s);
        let step =
            |built: &mut Compensator<f32>| f64::from(built.step(&inputs).compensation_torque_nm);
        match &mut self.aid {
            Aid::Off => 0.0,
            Aid::Fixed(built) => step(built),
            Aid::Adaptive(parts) => step(&mut parts.0),
            Aid::Observer(held_nm) => {
                if friction_nm.is_finite() {
                    *held_nm += share * (friction_nm.clamp(-20.0, 20.0) - *held_nm);
                }
                f64::from(SCALE) * *held_nm
            }
        }
    }

    fn inputs(&self, wanted_rad_s: f64) -> Inputs<f32> {
        Inputs {
            velocity_rad_s: Reading::fresh(self.encoder.velocity_rad_s as f32),
            position_rad: Reading::fresh(self.encoder.position_rad as f32),
            velocity_reference_rad_s: Reading::fresh(wanted_rad_s as f32),
            ..Inputs::missing()
        }
        .with(Quantity::Pressure, self.pressure[0] as f32, self.pressure[1] as f32)
    }

    /// Passes means of some samples to the adaptation.
    fn adapt(&mut self, measured: &Measured, is_lost: bool) {
        let Aid::Adaptive(parts) = &mut self.aid else { return };
        let (compensator, adaptation) = &mut **parts;
        self.sums.velocity += self.encoder.velocity_rad_s;
        self.sums.acceleration += self.encoder.acceleration_rad_s2;
        self.sums.torque += measured.torque_nm;
        self.sums.is_limited |= self.torque_nm.abs() >= TORQUE_LIMIT_NM;
        self.sums.count += 1;
        if self.sums.count < ADAPTATION_DIVIDER {
            return;
        }
        let sums = std::mem::take(&mut self.sums);
        let share = 1.0 / f64::from(sums.count);
        let acceleration = share * sums.acceleration;
        let blocked = match () {
            () if is_lost => Some(Frozen::NotArmed),
            () if sums.is_limited => Some(Frozen::Saturated),
            // A model with pressure learns nothing from an old reading.
            () if self.pressure[1] > 0.1 => Some(Frozen::Inputs),
            () => None,
        };
        let sample = Sample {
            velocity_rad_s: (share * sums.velocity) as f32,
            position_rad: self.encoder.position_rad as f32,
            acceleration_rad_s2: acceleration as f32,
            pressure_diff_mpa: (1e-6 * self.pressure[0]) as f32,
            ..Sample::default()
        };
        let torque_nm = share * sums.torque - self.commissioned.inertia_kg_m2 * acceleration;
        let observation =
            Observation { sample, torque_nm: torque_nm as f32, followed: [None; 3], blocked };
        if adaptation.step(&observation) {
            compensator.set_gains(adaptation.gains());
        }
    }
}
