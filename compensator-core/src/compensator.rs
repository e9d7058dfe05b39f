//! The friction model made safe for a current loop.
//!
//! Each sample the compensator takes what the sensors say, each with its age, and gives the current
//! that cancels the friction. Whatever the inputs are, the output is finite, bounded and slew-limited:
//!
//! * **Guards**: NaN or out-of-envelope inputs are flagged and replaced by the last good value, which
//!   then ages. Older than `hold_s` it fades over `fade_s` to neutral, and the law to the plain one.
//! * **Velocity** near zero is blended towards the reference, since a measured one has no sign there.
//! * **Scale** is at most 1: over-compensation makes limit cycles (0.7-0.9 is usual in industry).
//! * **Limits** come after the last addition ([`Compensator::sum`]); each that acts is a [`Flags`] bit.
//! * **Disabled** is absent: the command comes out of the sum with the bits it went in with.

#[cfg_attr(not(feature = "terms"), path = "compensator/no_covariates.rs")]
mod covariates;
mod parameters;

pub use crate::configuration::CompensatorParameters;
pub use crate::flags::Flags;
pub use crate::quantity::{Inputs, Reading};

use crate::configuration::Configuration;
use crate::model::{Model, Sample, State};
use crate::network::Factors;
use crate::number::Real;
use crate::parameters::ParameterError;
use covariates::Covariates;
use parameters::Built;

/// What the compensator gives in one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output<T> {
    /// The model's friction torque, Nm, unscaled and unlimited.
    pub friction_torque_nm: T,
    /// Torque to add, Nm, after scale, torque limit and slew limit.
    pub compensation_torque_nm: T,
    /// The same as a current, A.
    pub feed_forward_current_a: T,
    /// What happened on the way.
    pub flags: Flags,
}

/// The last good value of a covariate.
#[derive(Clone, Copy, Debug)]
struct Held<T> {
    value: T,
    age_s: T,
}

/// How a covariate is guarded: what is legal, and its two flags.
struct Guard<T> {
    /// The middle of the legal range, and how far from it a value may be.
    middle: T,
    reach: T,
    invalid: Flags,
    stale: Flags,
}

impl<T: Real> Held<T> {
    fn never(built: &Built<T>) -> Self {
        Self { value: T::zero(), age_s: built.faded_s }
    }

    /// Takes a reading and returns how far the held value is to be trusted, 0..=1.
    #[inline(always)]
    fn take(
        &mut self,
        reading: Reading<T>,
        guard: &Guard<T>,
        built: &Built<T>,
        flags: &mut Flags,
    ) -> T {
        // Masks, so that no input makes a branch.
        let illegal = (reading.value - guard.middle).abs_gt_mask(guard.reach);
        let unheard = reading.age_s.negative_or_nan_mask();
        *flags |= guard.invalid.when(illegal & !unheard);
        self.value = T::select(illegal | unheard, self.value, reading.value);
        let age_s = T::select(illegal | unheard, self.age_s + built.period_s, reading.age_s);
        self.age_s = age_s.within_level(built.faded_s);
        *flags |= guard.stale.when(built.hold_s.lt_mask(self.age_s));
        // 1 up to hold_s, then a straight line to 0 at hold_s + fade_s.
        let faded = (self.age_s - built.hold_s).positive_part() * built.fade_per_s;
        (T::one() - faded).positive_part()
    }
}

/// The compensator of one joint: a model and all that makes it safe.
#[derive(Clone, Debug)]
pub struct Compensator<T: Real> {
    enabled: bool,
    model: Model<T>,
    built: Built<T>,
    state: State<T>,
    /// What a network last said of the law's levels; `None` for its constants.
    factors: Option<Factors<T>>,
    compensation_torque_nm: T,
    radial_force: Held<T>,
    pressure: Held<T>,
    covariates: Covariates<T>,
}

/// How far side load and pressure are to be believed, 0..=1.
#[cfg_attr(not(feature = "terms"), allow(dead_code))]
#[derive(Clone, Copy)]
struct SealTrust<T> {
    force: T,
    pressure: T,
}

impl<T: Real> Compensator<T> {
    /// Builds a compensator for a sample period in s. It starts disabled, at rest.
    ///
    /// # Errors
    /// As [`crate::Parameters::build`] and [`CompensatorParameters::validate`].
    pub fn build(configuration: &Configuration, period_s: f32) -> Result<Self, ParameterError>
    where
        T: Real<Setting = f32>,
    {
        configuration.compensator.validate()?;
        let model = configuration.model.build::<T>(period_s)?;
        let reference = configuration.model.get(crate::ParameterId::TemperatureReference);
        let built =
            Built::new(&configuration.compensator, &configuration.model.envelope, period_s)?;
        Ok(Self {
            enabled: false,
            state: State::default(),
            factors: None,
            compensation_torque_nm: T::zero(),
            radial_force: Held::never(&built),
            pressure: Held::never(&built),
            covariates: Covariates::never(&built, &configuration.model.envelope, reference),
            model,
            built,
        })
    }

    /// Switches the compensator on or off. Switched on it starts from rest and zero torque, so the
    /// slew limit brings the compensation in.
    pub fn set_enabled(&mut self, enabled: bool) {
        // Cleared when it goes off: a sample that is off costs next to nothing, so the dearest one is not dearer for it.
        if self.enabled && !enabled {
            self.state = State::default();
            self.compensation_torque_nm = T::zero();
        }
        self.enabled = enabled;
    }

    /// Whether the compensator is on.
    pub fn is_enabled(&self) -> bool {
        self.enabled
    }

    /// Takes the factors a network supplies ([`crate::network::Supplier`]), in force from the next sample until the next;
    /// `None` for the law's constants. A model other than `lugre-asymmetric` without terms takes no notice.
    pub fn supply(&mut self, factors: Option<Factors<T>>) {
        self.factors = factors;
    }

    /// Torque held by the bent bristles, Nm.
    pub fn bristle_torque_nm(&self) -> T {
        self.state.bristle_torque_nm
    }

    /// Takes one sample.
    #[inline]
    pub fn step(&mut self, inputs: &Inputs<T>) -> Output<T> {
        let zero = T::zero();
        if !self.enabled {
            return Output {
                friction_torque_nm: zero,
                compensation_torque_nm: zero,
                feed_forward_current_a: zero,
                flags: Flags::DISABLED,
            };
        }
        let mut flags = Flags::empty();
        let (velocity, trust) = self.blended_velocity(inputs, &mut flags);
        let mut sample = Sample { velocity_rad_s: velocity, ..Sample::default() };
        let seal_trust = self.guard_seal(inputs, &mut sample, &mut flags);
        self.covariates.take(inputs, &self.model, &self.built, seal_trust, &mut sample, &mut flags);

        let mut friction = match &self.factors {
            None => self.model.step(&mut self.state, &sample),
            Some(factors) => self.model.step_supplied(&mut self.state, &sample, factors),
        };
        // Validated parameters keep friction far below this.
        if friction.abs_gt_mask(self.built.not_finite).is_set() {
            friction = zero;
            self.state = State::default();
            flags |= Flags::MODEL_NOT_FINITE;
        }
        let built = &self.built;
        let wanted = friction * built.scale * trust;
        let limited = wanted.within_level(built.torque_limit);
        flags |= Flags::TORQUE_LIMITED.when(wanted.abs_gt_mask(built.torque_limit));
        let change = limited - self.compensation_torque_nm;
        let slewed = change.within_level(built.slew_step);
        flags |= Flags::SLEW_LIMITED.when(change.abs_gt_mask(built.slew_step));
        self.compensation_torque_nm = self.compensation_torque_nm + slewed;
        Output {
            friction_torque_nm: friction,
            compensation_torque_nm: self.compensation_torque_nm,
            feed_forward_current_a: self.compensation_torque_nm * built.current_per_torque,
            flags,
        }
    }

    /// Adds the compensation to a commanded current (A) and limits the sum: the last addition and,
    /// after it, the limit. Disabled, the command passes with its bits unless the limit acts.
    #[inline]
    pub fn sum(&self, command_current_a: T, output: &Output<T>) -> (T, Flags) {
        let mut flags = output.flags;
        let unsound = command_current_a.abs_gt_mask(self.built.not_finite);
        let command = T::select(unsound, T::zero(), command_current_a);
        flags |= Flags::COMMAND_INVALID.when(unsound);
        let sum = if self.enabled { command + output.feed_forward_current_a } else { command };
        let limited = sum.within_level(self.built.current_limit);
        flags |= Flags::CURRENT_LIMITED.when(sum.abs_gt_mask(self.built.current_limit));
        (limited, flags)
    }

    /// The velocity to believe, rad/s, and 1, or 0 where there is none.
    #[inline(always)]
    fn blended_velocity(&self, inputs: &Inputs<T>, flags: &mut Flags) -> (T, T) {
        let built = &self.built;
        let unusable = |reading: &Reading<T>| {
            reading.value.abs_gt_mask(built.velocity_limit)
                | reading.age_s.negative_or_nan_mask()
                | built.hold_s.lt_mask(reading.age_s)
        };
        let (measured, reference) = (&inputs.velocity_rad_s, &inputs.velocity_reference_rad_s);
        let (no_measured, no_reference) = (unusable(measured), unusable(reference));
        *flags |= Flags::VELOCITY_INVALID.when(no_measured);
        *flags |= Flags::REFERENCE_INVALID.when(no_reference);
        // Each stands in for the other, and 0 for both: blending two equal velocities gives that one.
        let (zero, one) = (T::zero(), T::one());
        let alone = T::select(no_reference, zero, reference.value);
        let measured = T::select(no_measured, alone, measured.value);
        let reference = T::select(no_reference, measured, reference.value);
        // At and above the blend velocity there is nothing to multiply, so nothing for fixed point
        // to overflow.
        let speed = measured.abs();
        let blended = speed * built.blend_per_velocity;
        let weight = T::select(speed.lt_mask(built.blend_velocity), blended, one);
        let velocity = reference + (measured - reference) * weight;
        (velocity, T::select(no_measured & no_reference, zero, one))
    }

    #[inline(always)]
    fn guard_seal(
        &mut self,
        inputs: &Inputs<T>,
        sample: &mut Sample<T>,
        flags: &mut Flags,
    ) -> SealTrust<T> {
        let built = &self.built;
        let force = Guard {
            middle: built.radial_force_middle,
            reach: built.radial_force_middle,
            invalid: Flags::RADIAL_FORCE_INVALID,
            stale: Flags::RADIAL_FORCE_STALE,
        };
        // A change counts only between two trusted values: neither the first reading nor the fade
        // bends a bristle.
        let before = self.radial_force.value;
        let unknown = built.hold_s.lt_mask(self.radial_force.age_s);
        let force_trust = self.radial_force.take(inputs.radial_force_n, &force, built, flags);
        let change = self.radial_force.value - before;
        // Its frames are farther apart than samples: what changed between two of them did not within one sample.
        let bounded = change.within_level(built.radial_force_step);
        let sudden = change.abs_gt_mask(built.radial_force_step) & !unknown;
        self.radial_force.value = T::select(sudden, before + bounded, self.radial_force.value);
        sample.radial_force_n = (self.radial_force.value * force_trust).positive_part();
        sample.radial_force_change_n = T::select(unknown, T::zero(), bounded);

        let pressure = Guard {
            middle: T::zero(),
            reach: built.pressure_max_mpa,
            invalid: Flags::PRESSURE_INVALID,
            stale: Flags::PRESSURE_STALE,
        };
        let pressure_trust = self.pressure.take(inputs.pressure_diff_mpa, &pressure, built, flags);
        // A sensor's zero error reads a little below 0 (a side load that little passes by the
        // rounding of its guard); the levels are proven from 0 upwards.
        sample.pressure_diff_mpa = (self.pressure.value * pressure_trust).positive_part();
        SealTrust { force: force_trust, pressure: pressure_trust }
    }
}

/// A size that is a limit; written as -0 it is 0, which limits too.
fn limit<T: Real>(size: f32) -> T {
    T::from_f64(f64::from(size).abs())
}

#[cfg(test)]
mod tests;
