//! Learns the friction levels of a joint from its samples (2044h), for a joint on its sensors and for one in HIL.
//!
//! A few samples together make one observation of [`Adaptation`]. The driver and the PC that checks a replay run this code,
//! so that their gains agree bit for bit.

use crate::control::{Covariates, LoopFlags};
use crate::drive_settings::DriveSettings;
use crate::parameter_set::ParameterSet;
use compensator_core::adaptation::{
    Adaptation, AdaptationParameters, FOLLOWED, Frozen, Gains, Observation,
};
use compensator_core::model::Sample;
use compensator_core::{Flags, ParameterId, Parameters, Quantity, Reading};

/// Duration of one observation, s: as short as the presliding of a slow joint, and long enough that the steady torque of
/// the law, which is computed for each gain, takes a few percent of the processor.
const OBSERVATION_S: f32 = 5e-3;

/// Age above which a covariate counts as missing, s.
const FRESH_S: f32 = 0.5;

/// Mode of 2044h:1: the set applies.
pub const OFF: u8 = 0;
/// Mode of 2044h:1: the joint learns, and what it learnt applies; in torque modes up to the set.
pub const ON: u8 = 1;
/// Mode of 2044h:1: the same, with gains above the set in torque modes, too.
pub const ON_IN_EVERY_MODE: u8 = 3;

/// Limits that hold the torque back, so that it is not that of friction.
const LIMITING: LoopFlags = LoopFlags::CURRENT_LIMITED
    .union(LoopFlags::VOLTAGE_LIMITED)
    .union(LoopFlags::BRAKING_LIMITED)
    .union(LoopFlags::CROSS_FADING);
/// The same, of the compensator.
const LIMITING_MODEL: Flags = Flags::TORQUE_LIMITED.union(Flags::CURRENT_LIMITED);
/// Inputs that are too old. A single implausible reading, such as noise below zero, is replaced by the last one.
const STALE: Flags = Flags::VELOCITY_INVALID
    .union(Flags::POSITION_STALE)
    .union(Flags::ACCELERATION_STALE)
    .union(Flags::RADIAL_FORCE_STALE)
    .union(Flags::PRESSURE_STALE)
    .union(Flags::TEMPERATURE_STALE)
    .union(Flags::LOAD_TORQUE_STALE)
    .union(Flags::AUXILIARY_STALE);

/// Parameters of a law that depend on the side load, and on the pressure.
const SIDE_LOAD: [ParameterId; 3] = [
    ParameterId::RadialForceCoulomb,
    ParameterId::RadialForceStaticExcess,
    ParameterId::RadialForceRate,
];
const PRESSURE: [ParameterId; 2] =
    [ParameterId::PressureCoulomb, ParameterId::PressureStaticExcess];

/// Returns the flags of old inputs that a model needs. The compensator reports side load and pressure as old on a joint without
/// these sensors, whose model does not need them.
fn needed_inputs(model: &Parameters<f32>) -> Flags {
    let needs = |quantity, of_law: &[ParameterId]| {
        let by_law = model.law.has_seal_load() && of_law.iter().any(|id| model.get(*id) != 0.0);
        by_law || model.terms.iter().any(|kind| kind.reads() == Some(quantity))
    };
    let mut flags = STALE;
    flags.set(Flags::RADIAL_FORCE_STALE, needs(Quantity::RadialForce, &SIDE_LOAD));
    flags.set(Flags::PRESSURE_STALE, needs(Quantity::Pressure, &PRESSURE));
    flags
}

/// A sample of the joint.
#[derive(Clone, Copy, Debug)]
pub struct LearningSample {
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Position, rad; NaN if it is not known.
    pub position_rad: f32,
    /// Torque that drives the joint, less inertia and known load, Nm; NaN if it is not known.
    pub torque_nm: f32,
    /// Flags of the current loop.
    pub loop_flags: LoopFlags,
    /// Flags of the compensator.
    pub flags: Flags,
    /// Time since the campaign began, h.
    pub campaign_time_h: f32,
}

/// Sums over the samples of one observation.
#[derive(Clone, Copy, Debug, Default)]
struct SampleSums {
    samples: u16,
    velocity_rad_s: f32,
    torque_nm: f32,
    loop_flags: LoopFlags,
    flags: Flags,
}

with_defaults! {
    /// State of the learning of a joint.
    #[derive(Clone, Debug)]
    pub struct LevelLearner {
        /// `None` if it is off, or if it cannot be built for the set.
        learner: Option<Adaptation>,
        /// Time between two samples, s.
        sample_s: f32 = OBSERVATION_S,
        /// Number of samples of an observation.
        samples: u16 = 1,
        sums: SampleSums,
        /// Flags of old inputs that stop the learning.
        needed: Flags = STALE,
        /// Mean velocity of the last observation, rad/s.
        last_rad_s: f32,
        covariates: Covariates = Covariates::MISSING,
        /// Reason of the driver that nothing is learnt.
        blocked: Frozen = Frozen::Off,
        /// Time since something was learnt, s.
        age_s: f32,
        /// Number of the gains, which the link compares with what it sent last.
        number: u32,
    }
}

/// Returns a reading that is neither missing nor too old.
// Not inlined: it is called for each covariate.
#[inline(never)]
fn fresh(reading: &Reading<f32>) -> Option<f32> {
    (reading.age_s >= 0.0 && reading.age_s < FRESH_S).then_some(reading.value)
}

impl LevelLearner {
    /// Starts at the tuned set, with these settings, for samples of this period, s.
    pub fn restart(&mut self, set: &ParameterSet, settings: &DriveSettings, sample_s: f32) {
        let parameters = AdaptationParameters {
            least_gain: f32::from(settings.adapt_least_permille) * 1e-3,
            largest_gain: f32::from(settings.adapt_most_permille) * 1e-3,
            memory_s: f32::from(settings.adapt_memory_s),
            least_velocity_rad_s: set.watch.least_velocity_rad_s,
            noise_nm: set.watch.band_nm,
            ..AdaptationParameters::default()
        };
        self.sample_s = sample_s;
        self.samples = ((OBSERVATION_S / sample_s + 0.5) as u16).max(1);
        let period_s = self.observation_s();
        self.learner = match settings.adapt {
            OFF => None,
            _ => Adaptation::build(&set.friction.model, &parameters, period_s).ok(),
        };
        self.needed = needed_inputs(&set.friction.model);
        self.blocked = Frozen::Off;
        self.sums = SampleSums::default();
        self.last_rad_s = 0.0;
        self.age_s = 0.0;
        self.number = self.number.wrapping_add(1);
    }

    fn observation_s(&self) -> f32 {
        f32::from(self.samples) * self.sample_s
    }

    /// Returns true if the joint has learnt levels, or may learn them.
    pub const fn is_active(&self) -> bool {
        self.learner.is_some()
    }

    /// Returns what is learnt; `None` if the adaptation is off.
    pub(crate) const fn learner(&self) -> Option<&Adaptation> {
        self.learner.as_ref()
    }

    /// Returns the reason why nothing is learnt.
    pub const fn frozen(&self) -> Frozen {
        self.blocked
    }

    /// Returns the time since something was learnt, s.
    pub(crate) const fn age_s(&self) -> f32 {
        self.age_s
    }

    /// Keeps the covariates that the compensator receives.
    pub(crate) fn take_covariates(&mut self, covariates: &Covariates) {
        self.covariates = *covariates;
    }

    /// Returns the gains in use.
    pub fn gains(&self) -> Gains<f32> {
        self.learner.as_ref().map(|learner| *learner.gains()).unwrap_or_default()
    }

    /// Returns the number of the gains in use, which changes with them.
    pub(crate) const fn number(&self) -> u32 {
        self.number
    }

    /// Processes a sample; `blocked` is a reason of the driver to learn nothing.
    pub(crate) fn step(&mut self, sample: &LearningSample, blocked: Option<Frozen>) {
        if self.learner.is_none() {
            return;
        }
        let sums = &mut self.sums;
        sums.samples += 1;
        sums.velocity_rad_s += sample.velocity_rad_s;
        sums.torque_nm += sample.torque_nm;
        sums.loop_flags |= sample.loop_flags;
        sums.flags |= sample.flags;
        if sums.samples >= self.samples {
            self.observe(sample, blocked);
        }
    }

    /// Makes an observation of the sums; `last` is their last sample.
    // Not inlined: every sample would make room on the stack for an observation.
    #[inline(never)]
    fn observe(&mut self, last: &LearningSample, blocked: Option<Frozen>) {
        let period_s = self.observation_s();
        let sums = core::mem::take(&mut self.sums);
        let share = 1.0 / f32::from(self.samples);
        let velocity_rad_s = share * sums.velocity_rad_s;
        let acceleration_rad_s2 =
            (velocity_rad_s - self.last_rad_s) * share * (1.0 / self.sample_s);
        self.last_rad_s = velocity_rad_s;
        let limited = sums.loop_flags.intersects(LIMITING) || sums.flags.intersects(LIMITING_MODEL);
        let blocked = blocked
            .or(limited.then_some(Frozen::Saturated))
            .or(sums.flags.intersects(self.needed).then_some(Frozen::Inputs));
        let covariates = &self.covariates;
        let present = |reading: &Reading<f32>| fresh(reading).unwrap_or(0.0);
        // The compensator reads sizes, too.
        let size = |reading: &Reading<f32>| present(reading).max(0.0);
        let is_position_missing = last.position_rad.is_nan();
        let sample = Sample {
            velocity_rad_s,
            acceleration_rad_s2,
            position_rad: if is_position_missing { 0.0 } else { last.position_rad },
            position_weight: if is_position_missing { 0.0 } else { 1.0 },
            radial_force_n: size(&covariates.radial_force_n),
            pressure_diff_mpa: size(&covariates.pressure_diff_mpa),
            temperature_c: present(&covariates.temperature_c),
            load_torque_nm: present(&covariates.load_torque_nm),
            auxiliary: present(&covariates.auxiliary),
            campaign_time_h: last.campaign_time_h,
            ..Sample::default()
        };
        let followed = FOLLOWED
            .map(|quantity| self.covariates.get_mut(quantity).and_then(|reading| fresh(reading)));
        let observation =
            Observation { sample, torque_nm: share * sums.torque_nm, followed, blocked };
        let Some(learner) = &mut self.learner else { return };
        let learnt_s = learner.learnt_s();
        if learner.step(&observation) {
            self.number = self.number.wrapping_add(1);
        }
        self.blocked = learner.frozen();
        self.age_s += period_s;
        if learner.learnt_s() > learnt_s {
            self.age_s = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::LawKind;

    /// Returns why a joint without sensors of side load and pressure learns nothing after some slow samples.
    fn frozen_without_seal_sensors(pressure_coulomb: f32) -> Frozen {
        let mut set = ParameterSet::default();
        set.friction.model.law = LawKind::ImprovedLugre;
        set.friction.model.set(ParameterId::PressureCoulomb, pressure_coulomb);
        let settings = DriveSettings { adapt: ON, ..DriveSettings::default() };
        let mut learner = LevelLearner::default();
        learner.restart(&set, &settings, 1e-3);
        let sample = LearningSample {
            velocity_rad_s: 0.0,
            position_rad: f32::NAN,
            torque_nm: 0.0,
            loop_flags: LoopFlags::empty(),
            flags: Flags::RADIAL_FORCE_STALE | Flags::PRESSURE_STALE,
            campaign_time_h: 0.0,
        };
        (0..10).for_each(|_| learner.step(&sample, None));
        learner.frozen()
    }

    #[test]
    fn step_without_seal_sensors_learns_unless_the_model_needs_them() {
        assert_eq!(frozen_without_seal_sensors(0.0), Frozen::Settling);
        assert_eq!(frozen_without_seal_sensors(2e-6), Frozen::Inputs);
    }
}
