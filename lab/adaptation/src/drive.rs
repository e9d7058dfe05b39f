//! The driver: position and velocity loop with one of the aids against friction.
//!
//! The loops are those of a commissioned joint: P on position, PI on velocity, feed-forward of the known inertia. The aid
//! adds its torque. All arms have the same gains.
//!
//! A reading that is not valid is not used: [`Encoder`] predicts the position for a moment, then the bridge opens, and the last
//! valid pressure ages. A following error stops the drive for good. So a course that lies grades what a driver would do.

use crate::GradeError;
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
/// Following error that stops the drive, rad.
const FOLLOWING_ERROR_RAD: f64 = 0.3;
/// Time of such an error after which the drive stops, s.
const FOLLOWING_TIME_S: f64 = 0.1;
/// Largest commanded speed, rad/s.
const SPEED_LIMIT_RAD_S: f64 = 3.0;
/// Periods of the loop per step of the adaptation.
const ADAPTATION_DIVIDER: u32 = 5;
/// Share of the friction that the compensation and the disturbance observer cancel.
const SCALE: f32 = 0.9;
/// Largest pressure difference that a reading and a set may have, Pa.
pub const PRESSURE_MAX_PA: f32 = 4e6;
/// Age of the pressure above which the adaptation learns nothing, s.
const PRESSURE_AGE_MAX_S: f64 = 0.1;
/// Bound of the compensation of a tuned set, relative to its static level and its viscous torque at 2 rad/s.
const TORQUE_LIMIT_FACTOR: f32 = 1.3;

/// Gains and constants that a person has set.
#[derive(Clone, Copy, Debug)]
pub struct Commissioned {
    /// Known inertia, kg m^2.
    pub inertia_kg_m2: f64,
    /// Gain of the velocity loop per that of the usual rule.
    pub velocity_gain_factor: f64,
    /// Gain of the position loop, likewise.
    pub position_gain_factor: f64,
}

impl Commissioned {
    fn crossover_rad_s(&self) -> f64 {
        TAU * CROSSOVER_HZ * self.velocity_gain_factor
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
        most * TORQUE_LIMIT_FACTOR
            * (level + 2.0 * self.model.get(ParameterId::ViscousFriction).abs())
    }

    fn compensator(&self) -> Result<Compensator<f32>, GradeError> {
        let compensator = CompensatorParameters {
            scale: SCALE,
            torque_limit_nm: self.torque_limit_nm(),
            ..CompensatorParameters::default()
        };
        let configuration = Configuration { model: self.model.clone(), compensator };
        let mut built = Compensator::build(&configuration, PERIOD_S as f32)?;
        built.set_enabled(true);
        Ok(built)
    }

    fn adaptation(&self) -> Result<Adaptation, GradeError> {
        let settings =
            AdaptationParameters { noise_nm: self.noise_nm, ..AdaptationParameters::default() };
        let period_s = PERIOD_S as f32 * ADAPTATION_DIVIDER as f32;
        Ok(Adaptation::build(&self.model, &settings, period_s)?)
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
    Adaptive(Box<Adaptive>),
    /// Disturbance observer: the filtered torque beyond the inertia, Nm.
    Observer(f64),
}

/// A compensation, and the adaptation of its gains.
#[derive(Clone, Debug)]
pub struct Adaptive {
    compensator: Compensator<f32>,
    adaptation: Adaptation,
    sums: Sums,
}

impl Aid {
    /// Returns a compensation with a set that does not change.
    ///
    /// # Errors
    /// Returns an error if the driver would refuse the set.
    pub fn fixed(set: &TunedSet) -> Result<Self, GradeError> {
        Ok(Self::Fixed(Box::new(set.compensator()?)))
    }

    /// Returns a compensation that adapts.
    ///
    /// # Errors
    /// As [`Aid::fixed`].
    pub fn adaptive(set: &TunedSet) -> Result<Self, GradeError> {
        let (compensator, adaptation) = (set.compensator()?, set.adaptation()?);
        Ok(Self::Adaptive(Box::new(Adaptive { compensator, adaptation, sums: Sums::default() })))
    }

    /// Enables the aid, or disables it while the bridge is open.
    fn set_enabled(&mut self, is_enabled: bool) {
        match self {
            Self::Off => {}
            Self::Fixed(compensator) => compensator.set_enabled(is_enabled),
            Self::Adaptive(adaptive) => adaptive.compensator.set_enabled(is_enabled),
            Self::Observer(held_nm) => *held_nm = 0.0,
        }
    }
}

/// Sums of the samples since the last step of the adaptation.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    velocity_rad_s: f64,
    torque_nm: f64,
    acceleration_rad_s2: f64,
    is_limited: bool,
    count: u32,
}

/// The last valid pressure difference.
#[derive(Clone, Copy, Debug)]
struct HeldPressure {
    pressure_pa: f64,
    age_s: f64,
}

impl HeldPressure {
    /// Processes the reading of a period, Pa. Noise around 0 counts as 0; NaN and what is too large are not used.
    fn step(&mut self, reading_pa: f64) {
        self.age_s += PERIOD_S;
        if reading_pa.abs() <= f64::from(PRESSURE_MAX_PA) {
            *self = Self { pressure_pa: reading_pa.max(0.0), age_s: 0.0 };
        }
    }
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
    /// Torque of the aid, Nm.
    pub aid_nm: f64,
    integral_nm: f64,
    torque_nm: f64,
    pressure: HeldPressure,
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
            aid_nm: 0.0,
            integral_nm: 0.0,
            torque_nm: 0.0,
            pressure: HeldPressure { pressure_pa: 0.0, age_s: 0.0 },
            was_lost: false,
            following_s: 0.0,
        }
    }

    /// Returns true if a following error has stopped the drive. It stays stopped.
    pub fn is_stopped(&self) -> bool {
        self.following_s > FOLLOWING_TIME_S
    }

    /// Returns the gains in use; those of the tuned set without an adaptation.
    pub fn gains(&self) -> Gains<f32> {
        match &self.aid {
            Aid::Adaptive(adaptive) => *adaptive.adaptation.gains(),
            Aid::Off | Aid::Fixed(_) | Aid::Observer(_) => Gains::default(),
        }
    }

    /// Returns the torque by the measured current less the inertia, Nm.
    pub fn friction_nm(&self, measured: &Measured) -> f64 {
        measured.torque_nm - self.commissioned.inertia_kg_m2 * self.encoder.acceleration_rad_s2
    }

    /// Processes the measurements of a period. Returns the torque of the next one, Nm.
    pub fn step(&mut self, measured: &Measured, demand: &Demand) -> f64 {
        self.encoder.step(measured.encoder_rad);
        self.pressure.step(measured.pressure_pa);
        let is_lost = self.encoder.is_lost();
        if is_lost != self.was_lost {
            // The bridge opens or closes, and the loops start anew.
            self.integral_nm = 0.0;
            self.aid.set_enabled(!is_lost);
            self.was_lost = is_lost;
        }
        self.adapt(measured);
        let error_rad = demand.position_rad - self.encoder.position_rad;
        if !self.is_stopped() {
            let is_far = error_rad.abs() > FOLLOWING_ERROR_RAD;
            self.following_s = if is_far { self.following_s + PERIOD_S } else { 0.0 };
        }
        if is_lost || self.is_stopped() {
            (self.torque_nm, self.aid_nm) = (0.0, 0.0);
        } else {
            self.control(measured, demand, error_rad);
        }
        self.torque_nm
    }

    /// Computes the torques of the loops and of the aid. The integral stands while the torque is at its limit.
    fn control(&mut self, measured: &Measured, demand: &Demand, error_rad: f64) {
        let crossover_rad_s = self.commissioned.crossover_rad_s();
        let gain_per_s = POSITION_SHARE * crossover_rad_s * self.commissioned.position_gain_factor;
        let wanted_rad_s = (demand.velocity_rad_s + gain_per_s * error_rad)
            .clamp(-SPEED_LIMIT_RAD_S, SPEED_LIMIT_RAD_S);
        self.aid_nm = self.compute_aid(measured, wanted_rad_s);
        let inertia_kg_m2 = self.commissioned.inertia_kg_m2;
        let velocity_error_rad_s = wanted_rad_s - self.encoder.velocity_rad_s;
        let proportional_nm = crossover_rad_s * inertia_kg_m2 * velocity_error_rad_s;
        let feed_forward_nm = inertia_kg_m2 * demand.acceleration_rad_s2;
        let unlimited_nm = proportional_nm + self.integral_nm + feed_forward_nm + self.aid_nm;
        self.torque_nm = unlimited_nm.clamp(-TORQUE_LIMIT_NM, TORQUE_LIMIT_NM);
        let change_nm = PERIOD_S / INTEGRAL_S * proportional_nm;
        if unlimited_nm == self.torque_nm || unlimited_nm * change_nm < 0.0 {
            self.integral_nm += change_nm;
        }
    }

    /// Returns the torque of the aid, Nm.
    fn compute_aid(&mut self, measured: &Measured, wanted_rad_s: f64) -> f64 {
        let friction_nm = self.friction_nm(measured);
        let share = PERIOD_S * self.commissioned.crossover_rad_s();
        let inputs = self.inputs(wanted_rad_s);
        let compensator = match &mut self.aid {
            Aid::Off => return 0.0,
            Aid::Fixed(compensator) => &mut **compensator,
            Aid::Adaptive(adaptive) => &mut adaptive.compensator,
            Aid::Observer(held_nm) => {
                if friction_nm.is_finite() {
                    let limited_nm = friction_nm.clamp(-TORQUE_LIMIT_NM, TORQUE_LIMIT_NM);
                    *held_nm += share * (limited_nm - *held_nm);
                }
                return f64::from(SCALE) * *held_nm;
            }
        };
        f64::from(compensator.step(&inputs).compensation_torque_nm)
    }

    fn inputs(&self, wanted_rad_s: f64) -> Inputs<f32> {
        let HeldPressure { pressure_pa, age_s } = self.pressure;
        Inputs {
            velocity_rad_s: Reading::fresh(self.encoder.velocity_rad_s as f32),
            position_rad: Reading::fresh(self.encoder.position_rad as f32),
            velocity_reference_rad_s: Reading::fresh(wanted_rad_s as f32),
            ..Inputs::missing()
        }
        .with(Quantity::Pressure, pressure_pa as f32, age_s as f32)
    }

    /// Passes means of [`ADAPTATION_DIVIDER`] samples to the adaptation.
    fn adapt(&mut self, measured: &Measured) {
        let Aid::Adaptive(adaptive) = &mut self.aid else { return };
        let Adaptive { compensator, adaptation, sums } = &mut **adaptive;
        sums.velocity_rad_s += self.encoder.velocity_rad_s;
        sums.acceleration_rad_s2 += self.encoder.acceleration_rad_s2;
        sums.torque_nm += measured.torque_nm;
        sums.is_limited |= self.torque_nm.abs() >= TORQUE_LIMIT_NM;
        sums.count += 1;
        if sums.count < ADAPTATION_DIVIDER {
            return;
        }
        let sums = std::mem::take(sums);
        let share = 1.0 / f64::from(sums.count);
        let acceleration_rad_s2 = share * sums.acceleration_rad_s2;
        let blocked = if self.encoder.is_lost() {
            Some(Frozen::NotArmed)
        } else if sums.is_limited {
            Some(Frozen::Saturated)
        } else if self.pressure.age_s > PRESSURE_AGE_MAX_S {
            // A model with pressure learns nothing from an old reading.
            Some(Frozen::Inputs)
        } else {
            None
        };
        let sample = Sample {
            velocity_rad_s: (share * sums.velocity_rad_s) as f32,
            position_rad: self.encoder.position_rad as f32,
            acceleration_rad_s2: acceleration_rad_s2 as f32,
            pressure_diff_mpa: (1e-6 * self.pressure.pressure_pa) as f32,
            ..Sample::default()
        };
        let torque_nm =
            share * sums.torque_nm - self.commissioned.inertia_kg_m2 * acceleration_rad_s2;
        let observation =
            Observation { sample, torque_nm: torque_nm as f32, followed: [None; 3], blocked };
        if adaptation.step(&observation) {
            compensator.set_gains(adaptation.gains());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_with_pressure_that_is_not_valid_keeps_and_ages_the_last_one() {
        for wrong_pa in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e6] {
            let mut pressure = HeldPressure { pressure_pa: 0.0, age_s: 0.0 };
            [2e6, wrong_pa, wrong_pa].into_iter().for_each(|reading_pa| pressure.step(reading_pa));
            assert_eq!(pressure.pressure_pa, 2e6, "{wrong_pa}");
            assert!((pressure.age_s - 2.0 * PERIOD_S).abs() < 1e-12, "{wrong_pa}");
        }
    }

    #[test]
    fn step_with_pressure_noise_around_zero_is_fresh() {
        let mut pressure = HeldPressure { pressure_pa: 2e6, age_s: 1.0 };
        pressure.step(-3e3);
        assert_eq!((pressure.pressure_pa, pressure.age_s), (0.0, 0.0));
    }
}
