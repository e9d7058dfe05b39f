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
use crate::number::{Mask, Real};
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
        self.trust(built)
    }

    /// Ages by a sample, and returns how far it is to be trusted.
    #[inline(always)]
    fn wait(&mut self, built: &Built<T>) -> T {
        self.age_s = (self.age_s + built.period_s).within_level(built.faded_s);
        self.trust(built)
    }

    /// 1 up to `hold_s`, then a straight line to 0 at `hold_s + fade_s`.
    #[inline(always)]
    fn trust(&self, built: &Built<T>) -> T {
        let faded = (self.age_s - built.hold_s).positive_part() * built.fade_per_s;
        (T::one() - faded).positive_part()
    }
}

/// The compensator of one joint: a model and all that makes it safe.
#[derive(Clone, Debug)]
pub struct Compensator<T: Real> {
    enabled: bool,
    /// Whether [`Self::step`] may take the short way: it is on, and its model is its law alone, by its own constants.
    quick: bool,
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

/// Side load and pressure, as far as they are to be believed, and how far that is.
struct Seal<T> {
    force_n: T,
    force_change_n: T,
    pressure_mpa: T,
    trust: SealTrust<T>,
}

/// What is to be believed of a sample's inputs.
struct Believed<T> {
    velocity_rad_s: T,
    /// 1, or 0 where there is no velocity.
    velocity_trust: T,
    seal: Seal<T>,
    flags: Flags,
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
            quick: false,
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
            self.state.clear();
            self.compensation_torque_nm = T::zero();
        }
        self.enabled = enabled;
        self.choose_way();
    }

    fn choose_way(&mut self) {
        let supplied = self.factors.is_some() && self.model.takes_factors();
        self.quick = self.enabled && self.model.is_plain() && !supplied;
    }

    /// Whether the compensator is on.
    pub fn is_enabled(&self) -> bool {
        self.enabled
    }

    /// Takes the factors a network supplies ([`crate::network::Supplier`]), in force from the next sample until the next;
    /// `None` for the law's constants. A model other than `lugre-asymmetric` without terms takes no notice.
    pub fn supply(&mut self, factors: Option<Factors<T>>) {
        self.factors = factors;
        self.choose_way();
    }

    /// Torque held by the bent bristles, Nm.
    pub fn bristle_torque_nm(&self) -> T {
        self.state.bristle_torque_nm
    }

    /// Takes one sample.
    ///
    /// There are two ways with the same bits: a short one for readings of which nothing has to be replaced, aged or
    /// faded, taken by a law without terms; and the one that can do all of it. What each guard costs is in
    /// `tests/cost/table.md`. Inlined: an image calls it in one place, its current loop.
    #[inline(always)]
    pub fn step(&mut self, inputs: &Inputs<T>) -> Output<T> {
        if !self.quick {
            return self.step_more(inputs);
        }
        let read_change = inputs.radial_force_n.value - self.radial_force.value;
        let velocities = self.doubt_velocities(inputs);
        let seal = self.doubt_seal(inputs, read_change);
        // Each by itself: a structure that is written out of line would have to be in memory on the short way too.
        let (velocity, force, change, pressure, trust, flags);
        if (velocities | seal).is_set() {
            let believed = self.believe(inputs, velocities, seal);
            (velocity, trust) = (believed.velocity_rad_s, believed.velocity_trust);
            (force, pressure) = (believed.seal.force_n, believed.seal.pressure_mpa);
            (change, flags) = (believed.seal.force_change_n, believed.flags);
        } else {
            let seal = self.seal_as_read(inputs, read_change);
            let reference = inputs.velocity_reference_rad_s.value;
            velocity = self.blended(inputs.velocity_rad_s.value, reference);
            (force, pressure) = (seal.force_n, seal.pressure_mpa);
            (change, trust, flags) = (seal.force_change_n, T::one(), Flags::empty());
        }
        let sample = Sample {
            velocity_rad_s: velocity,
            radial_force_n: force,
            radial_force_change_n: change,
            pressure_diff_mpa: pressure,
            ..Sample::default()
        };
        let friction = self.model.step_plain(&mut self.state, &sample);
        self.finish_quickly(friction, trust, flags)
    }

    /// A sample of a compensator that is off, or of a model that is more than its law.
    #[inline(never)]
    fn step_more(&mut self, inputs: &Inputs<T>) -> Output<T> {
        if !self.enabled {
            let zero = T::zero();
            return Output {
                friction_torque_nm: zero,
                compensation_torque_nm: zero,
                feed_forward_current_a: zero,
                flags: Flags::DISABLED,
            };
        }
        let mut flags = Flags::empty();
        let (measured, reference, trust) = self.replaced_velocities(inputs, &mut flags);
        let seal = self.guarded_seal(inputs, &mut flags);
        let mut sample = Sample {
            velocity_rad_s: self.blended(measured, reference),
            radial_force_n: seal.force_n,
            radial_force_change_n: seal.force_change_n,
            pressure_diff_mpa: seal.pressure_mpa,
            ..Sample::default()
        };
        self.covariates.take(inputs, &self.model, &self.built, seal.trust, &mut sample, &mut flags);
        let friction = self.model.step_more(&mut self.state, &sample, self.factors.as_ref());
        self.finish(friction, trust, flags)
    }

    /// What is to be believed of the inputs. Masks say where something may be wrong with the velocities, and with side
    /// load and pressure.
    #[inline(never)]
    fn believe(&mut self, inputs: &Inputs<T>, velocities: Mask, seal: Mask) -> Believed<T> {
        let mut flags = Flags::empty();
        let measured = inputs.velocity_rad_s.value;
        let mut velocity = (measured, inputs.velocity_reference_rad_s.value, T::one());
        if velocities.is_set() {
            velocity = self.replaced_velocities(inputs, &mut flags);
        }
        let (measured, reference, velocity_trust) = velocity;
        let seal = if !seal.is_set() {
            let change = inputs.radial_force_n.value - self.radial_force.value;
            self.seal_as_read(inputs, change)
        } else if self.no_seal_sensors(inputs).is_set() {
            self.seal_unheard(&mut flags)
        } else {
            self.guarded_seal(inputs, &mut flags)
        };
        Believed { velocity_rad_s: self.blended(measured, reference), velocity_trust, seal, flags }
    }

    /// From the friction torque to what is added, where no limit acts; else by way of [`Self::finish`].
    #[inline(always)]
    fn finish_quickly(&mut self, friction: T, trust: T, flags: Flags) -> Output<T> {
        let built = &self.built;
        let wanted = friction * built.scale * trust;
        let change = wanted - self.compensation_torque_nm;
        let limited = friction.abs_gt_mask(built.not_finite)
            | wanted.past_level_mask(built.torque_limit)
            | change.past_level_mask(built.slew_step);
        if limited.is_set() {
            return self.finish(friction, trust, flags);
        }
        let compensation = self.compensation_torque_nm + change;
        self.compensation_torque_nm = compensation;
        Output {
            friction_torque_nm: friction,
            compensation_torque_nm: compensation,
            feed_forward_current_a: compensation * built.current_per_torque,
            flags,
        }
    }

    /// From the friction torque to what is added, under all limits.
    #[inline(never)]
    fn finish(&mut self, mut friction: T, trust: T, mut flags: Flags) -> Output<T> {
        // Validated parameters keep friction far below this.
        if friction.abs_gt_mask(self.built.not_finite).is_set() {
            friction = T::zero();
            self.state.clear();
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
    #[inline(always)]
    pub fn sum(&self, command_current_a: T, output: &Output<T>) -> (T, Flags) {
        if self.enabled {
            let built = &self.built;
            let sum = command_current_a + output.feed_forward_current_a;
            let limited = command_current_a.abs_gt_mask(built.not_finite)
                | sum.past_level_mask(built.current_limit);
            if !limited.is_set() {
                return (sum, output.flags);
            }
        }
        self.sum_limited(command_current_a, output)
    }

    /// The sum with everything that can happen to it.
    #[inline(never)]
    fn sum_limited(&self, command_current_a: T, output: &Output<T>) -> (T, Flags) {
        let mut flags = output.flags;
        let unsound = command_current_a.abs_gt_mask(self.built.not_finite);
        let command = T::select(unsound, T::zero(), command_current_a);
        flags |= Flags::COMMAND_INVALID.when(unsound);
        let sum = if self.enabled { command + output.feed_forward_current_a } else { command };
        let limited = sum.within_level(self.built.current_limit);
        flags |= Flags::CURRENT_LIMITED.when(sum.abs_gt_mask(self.built.current_limit));
        (limited, flags)
    }

    /// Whether a velocity is not to be taken as it is: NaN, beyond the envelope, or too old.
    #[inline(always)]
    fn doubt_velocity(&self, reading: &Reading<T>) -> Mask {
        reading.value.abs_gt_mask(self.built.velocity_limit)
            | reading.age_s.outside_mask(self.built.hold_s)
    }

    #[inline(always)]
    fn doubt_velocities(&self, inputs: &Inputs<T>) -> Mask {
        self.doubt_velocity(&inputs.velocity_rad_s)
            | self.doubt_velocity(&inputs.velocity_reference_rad_s)
    }

    /// The velocities, rad/s, each standing in for the other where that is not to be believed; and 1, or 0 where neither
    /// is.
    #[inline(always)]
    fn replaced_velocities(&self, inputs: &Inputs<T>, flags: &mut Flags) -> (T, T, T) {
        let (measured, reference) = (&inputs.velocity_rad_s, &inputs.velocity_reference_rad_s);
        let (no_measured, no_reference) =
            (self.doubt_velocity(measured), self.doubt_velocity(reference));
        *flags |= Flags::VELOCITY_INVALID.when(no_measured);
        *flags |= Flags::REFERENCE_INVALID.when(no_reference);
        // 0 for both: blending two equal velocities gives that one.
        let (zero, one) = (T::zero(), T::one());
        let alone = T::select(no_reference, zero, reference.value);
        let measured = T::select(no_measured, alone, measured.value);
        let reference = T::select(no_reference, measured, reference.value);
        (measured, reference, T::select(no_measured & no_reference, zero, one))
    }

    /// The reference near standstill, the measured velocity above, rad/s.
    #[inline(always)]
    fn blended(&self, measured: T, reference: T) -> T {
        let built = &self.built;
        // At and above the blend velocity there is nothing to multiply, so nothing for fixed point
        // to overflow.
        let speed = measured.abs();
        let blended = speed * built.blend_per_velocity;
        let weight = T::select(speed.lt_mask(built.blend_velocity), blended, T::one());
        reference + (measured - reference) * weight
    }

    /// Whether side load or pressure is not to be taken as it is: illegal, below 0 (which may pass and counts as 0),
    /// old, or a side load that is farther from the last than it goes in a sample.
    #[inline(always)]
    fn doubt_seal(&self, inputs: &Inputs<T>, change: T) -> Mask {
        let built = &self.built;
        let (force, pressure) = (&inputs.radial_force_n, &inputs.pressure_diff_mpa);
        force.value.outside_mask(built.radial_force_max)
            | pressure.value.outside_mask(built.pressure_max_mpa)
            | force.age_s.outside_mask(built.hold_s)
            | pressure.age_s.outside_mask(built.hold_s)
            | built.hold_s.lt_mask(self.radial_force.age_s)
            | change.past_level_mask(built.radial_force_step)
    }

    /// Takes side load and pressure as they are; `change` is the side load's since the last sample.
    #[inline(always)]
    fn seal_as_read(&mut self, inputs: &Inputs<T>, change: T) -> Seal<T> {
        let (force, pressure) = (&inputs.radial_force_n, &inputs.pressure_diff_mpa);
        self.radial_force = Held { value: force.value, age_s: force.age_s };
        self.pressure = Held { value: pressure.value, age_s: pressure.age_s };
        Seal {
            force_n: force.value,
            force_change_n: change,
            pressure_mpa: pressure.value,
            trust: SealTrust { force: T::one(), pressure: T::one() },
        }
    }

    /// Whether neither side load nor pressure has ever been heard of, as of a joint that has no such sensors.
    #[inline(always)]
    fn no_seal_sensors(&self, inputs: &Inputs<T>) -> Mask {
        let (force, pressure) = (&self.radial_force, &self.pressure);
        !(!inputs.radial_force_n.age_s.negative_or_nan_mask()
            | !inputs.pressure_diff_mpa.age_s.negative_or_nan_mask()
            | force.value.outside_mask(T::zero())
            | pressure.value.outside_mask(T::zero())
            | !self.built.hold_s.lt_mask(force.age_s)
            | !self.built.hold_s.lt_mask(pressure.age_s))
    }

    /// Waits on for both: what was never measured is 0.
    #[inline(always)]
    fn seal_unheard(&mut self, flags: &mut Flags) -> Seal<T> {
        *flags |= Flags::RADIAL_FORCE_STALE.union(Flags::PRESSURE_STALE);
        let (built, zero) = (&self.built, T::zero());
        let (force, pressure) = (self.radial_force.wait(built), self.pressure.wait(built));
        let trust = SealTrust { force, pressure };
        Seal { force_n: zero, force_change_n: zero, pressure_mpa: zero, trust }
    }

    /// Side load and pressure, replaced, aged and faded where they have to be.
    #[inline(always)]
    fn guarded_seal(&mut self, inputs: &Inputs<T>, flags: &mut Flags) -> Seal<T> {
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

        let pressure = Guard {
            middle: T::zero(),
            reach: built.pressure_max_mpa,
            invalid: Flags::PRESSURE_INVALID,
            stale: Flags::PRESSURE_STALE,
        };
        let pressure_trust = self.pressure.take(inputs.pressure_diff_mpa, &pressure, built, flags);
        // A sensor's zero error reads a little below 0 (a side load that little passes by the
        // rounding of its guard); the levels are proven from 0 upwards.
        Seal {
            force_n: (self.radial_force.value * force_trust).positive_part(),
            force_change_n: T::select(unknown, T::zero(), bounded),
            pressure_mpa: (self.pressure.value * pressure_trust).positive_part(),
            trust: SealTrust { force: force_trust, pressure: pressure_trust },
        }
    }
}

/// A size that is a limit; written as -0 it is 0, which limits too.
fn limit<T: Real>(size: f32) -> T {
    T::from_f64(f64::from(size).abs())
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod ways_tests;
