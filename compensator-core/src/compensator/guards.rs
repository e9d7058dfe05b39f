//! Guards of the inputs: what an invalid or missing input is replaced by, and for how long.
//!
//! ```text
//! reading -> valid?  yes: used as it is, weight 1
//!                    no:  the last valid value; its weight is 1 up to `hold_s`, then falls to 0 over `fade_s`
//! ```
//! - A *velocity* is never held: measured and reference velocity replace each other, and without both the weight is 0.
//! - *Side load* and *pressure* are held and fade to 0. A jump of the side load is spread over several samples.
//! - The other covariates have the same guard, in `covariates`.
//!
//! A guard is entered only if a mask says so, because nearly every sample needs none. The masks and the guards have no
//! branch that depends on the value of an input.

use super::Compensator;
use super::parameters::BuiltParameters;
use crate::flags::Flags;
use crate::number::{Mask, Real};
use crate::quantity::{Inputs, Reading};

/// The last valid value of a covariate, and its age in s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held<T> {
    pub value: T,
    pub age_s: T,
}

/// Guard of a covariate: the valid range and the two flags.
pub(super) struct Guard<T> {
    /// Middle of the valid range.
    pub middle: T,
    /// Half the width of the valid range.
    pub half_width: T,
    pub invalid: Flags,
    pub stale: Flags,
}

impl<T: Real> Held<T> {
    /// Returns a value that was never measured: 0, with weight 0.
    pub(super) fn unmeasured(built: &BuiltParameters<T>) -> Self {
        Self { value: T::zero(), age_s: built.faded_s }
    }

    /// Updates the held value from a reading. Returns its weight, from 0 (expired) to 1 (fresh).
    #[inline(always)]
    pub(super) fn update(
        &mut self,
        reading: Reading<T>,
        guard: &Guard<T>,
        built: &BuiltParameters<T>,
        flags: &mut Flags,
    ) -> T {
        // Masks keep the code free of branches that depend on inputs.
        let is_invalid = (reading.value - guard.middle).abs_gt_mask(guard.half_width);
        let is_missing = reading.age_s.negative_or_nan_mask();
        *flags |= guard.invalid.when(is_invalid & !is_missing);
        self.value = T::select(is_invalid | is_missing, self.value, reading.value);
        let age_s = T::select(is_invalid | is_missing, self.age_s + built.period_s, reading.age_s);
        self.age_s = age_s.within_level(built.faded_s);
        *flags |= guard.stale.when(built.hold_s.lt_mask(self.age_s));
        self.weight(built)
    }

    /// Ages the held value by one sample period. Returns its weight, from 0 to 1.
    #[inline(always)]
    pub(super) fn age(&mut self, built: &BuiltParameters<T>) -> T {
        self.age_s = (self.age_s + built.period_s).within_level(built.faded_s);
        self.weight(built)
    }

    /// Returns the weight: 1 up to an age of `hold_s`, then linear to 0 at `hold_s + fade_s`.
    #[inline(always)]
    pub(super) fn weight(&self, built: &BuiltParameters<T>) -> T {
        let faded = (self.age_s - built.hold_s).positive_part() * built.fade_per_s;
        (T::one() - faded).positive_part()
    }
}

/// Weights of the held side load and pressure, from 0 (expired) to 1 (fresh).
#[cfg_attr(not(feature = "terms"), allow(dead_code))]
#[derive(Clone, Copy)]
pub(super) struct SealWeights<T> {
    pub force: T,
    pub pressure: T,
}

/// Side load and pressure after the guards, with their weights.
pub(super) struct Seal<T> {
    pub force_n: T,
    pub force_change_n: T,
    pub pressure_mpa: T,
    pub weight: SealWeights<T>,
}

/// Inputs of a sample after the guards.
pub(super) struct GuardedInputs<T> {
    pub velocity_rad_s: T,
    /// 1 if a valid velocity exists, otherwise 0.
    pub velocity_weight: T,
    pub seal: Seal<T>,
    pub flags: Flags,
}

/// Measured and reference velocity after the guards, rad/s.
pub(super) struct Velocities<T> {
    pub measured: T,
    pub reference: T,
    /// 1 if one of the two was valid, otherwise 0.
    pub weight: T,
}

impl<T: Real> Compensator<T> {
    /// Guards the inputs. Each mask is set if the velocities, or side load and pressure, need a guard.
    #[inline(never)]
    pub(super) fn guard_inputs(
        &mut self,
        inputs: &Inputs<T>,
        velocities: Mask,
        seal: Mask,
    ) -> GuardedInputs<T> {
        let mut flags = Flags::empty();
        let velocities = if velocities.is_set() {
            self.replaced_velocities(inputs, &mut flags)
        } else {
            Velocities {
                measured: inputs.velocity_rad_s.value,
                reference: inputs.velocity_reference_rad_s.value,
                weight: T::one(),
            }
        };
        let seal = if !seal.is_set() {
            let change = inputs.radial_force_n.value - self.radial_force.value;
            self.accept_seal(inputs, change)
        } else if self.no_seal_sensors_mask(inputs).is_set() {
            self.seal_inputs_missing(&mut flags)
        } else {
            self.guarded_seal(inputs, &mut flags)
        };
        GuardedInputs {
            velocity_rad_s: self.blended(velocities.measured, velocities.reference),
            velocity_weight: velocities.weight,
            seal,
            flags,
        }
    }

    /// Guards the inputs if a mask says that they need it.
    #[inline(always)]
    pub(super) fn guard_if_needed(&mut self, inputs: &Inputs<T>) -> GuardedInputs<T> {
        let change = inputs.radial_force_n.value - self.radial_force.value;
        let velocities = self.velocities_guard_mask(inputs);
        let seal = self.seal_guard_mask(inputs, change);
        if (velocities | seal).is_set() {
            return self.guard_inputs(inputs, velocities, seal);
        }
        let reference = inputs.velocity_reference_rad_s.value;
        GuardedInputs {
            velocity_rad_s: self.blended(inputs.velocity_rad_s.value, reference),
            velocity_weight: T::one(),
            seal: self.accept_seal(inputs, change),
            flags: Flags::empty(),
        }
    }

    /// Sets the mask if a velocity is NaN, outside the envelope or too old.
    #[inline(always)]
    pub(super) fn velocity_guard_mask(&self, reading: &Reading<T>) -> Mask {
        reading.value.abs_gt_mask(self.built.velocity_limit)
            | reading.age_s.outside_mask(self.built.hold_s)
    }

    /// Sets the mask if the measured or the reference velocity needs a guard.
    #[inline(always)]
    pub(super) fn velocities_guard_mask(&self, inputs: &Inputs<T>) -> Mask {
        self.velocity_guard_mask(&inputs.velocity_rad_s)
            | self.velocity_guard_mask(&inputs.velocity_reference_rad_s)
    }

    /// Returns the velocities; a valid one replaces an invalid one.
    #[inline(always)]
    pub(super) fn replaced_velocities(
        &self,
        inputs: &Inputs<T>,
        flags: &mut Flags,
    ) -> Velocities<T> {
        let (measured, reference) = (&inputs.velocity_rad_s, &inputs.velocity_reference_rad_s);
        let (measured_invalid, reference_invalid) =
            (self.velocity_guard_mask(measured), self.velocity_guard_mask(reference));
        *flags |= Flags::VELOCITY_INVALID.when(measured_invalid);
        *flags |= Flags::REFERENCE_INVALID.when(reference_invalid);
        // If one velocity replaces the other, both are equal. Blending equal velocities returns that value.
        let (zero, one) = (T::zero(), T::one());
        let substitute = T::select(reference_invalid, zero, reference.value);
        let measured = T::select(measured_invalid, substitute, measured.value);
        let reference = T::select(reference_invalid, measured, reference.value);
        let weight = T::select(measured_invalid & reference_invalid, zero, one);
        Velocities { measured, reference, weight }
    }

    /// Returns the blend of reference (near standstill) and measured velocity (above the blend velocity), rad/s.
    #[inline(always)]
    pub(super) fn blended(&self, measured: T, reference: T) -> T {
        let built = &self.built;
        // At and above the blend velocity the weight is 1. The product may exceed the fixed-point range there, and
        // is discarded.
        let speed = measured.abs();
        let blended = speed * built.blend_per_velocity;
        let weight = T::select(speed.lt_mask(built.blend_velocity), blended, T::one());
        reference + (measured - reference) * weight
    }

    /// Sets the mask if side load or pressure needs a guard.
    ///
    /// A guard is needed if a value is invalid, negative or too old, or if the side load changed by more than
    /// `radial_force_step`. `change` is the change of the side load since the last sample, N.
    #[inline(always)]
    pub(super) fn seal_guard_mask(&self, inputs: &Inputs<T>, change: T) -> Mask {
        let built = &self.built;
        let (force, pressure) = (&inputs.radial_force_n, &inputs.pressure_diff_mpa);
        force.value.outside_mask(built.radial_force_max)
            | pressure.value.outside_mask(built.pressure_max_mpa)
            | force.age_s.outside_mask(built.hold_s)
            | pressure.age_s.outside_mask(built.hold_s)
            | built.hold_s.lt_mask(self.radial_force.age_s)
            | change.past_level_mask(built.radial_force_step)
    }

    /// Accepts side load and pressure without a guard. `change` is the change of the side load since the last
    /// sample, N.
    #[inline(always)]
    pub(super) fn accept_seal(&mut self, inputs: &Inputs<T>, change: T) -> Seal<T> {
        let (force, pressure) = (&inputs.radial_force_n, &inputs.pressure_diff_mpa);
        self.radial_force = Held { value: force.value, age_s: force.age_s };
        self.pressure = Held { value: pressure.value, age_s: pressure.age_s };
        Seal {
            force_n: force.value,
            force_change_n: change,
            pressure_mpa: pressure.value,
            weight: SealWeights { force: T::one(), pressure: T::one() },
        }
    }

    /// Sets the mask if neither side load nor pressure was ever received: the joint has no such sensors.
    #[inline(always)]
    pub(super) fn no_seal_sensors_mask(&self, inputs: &Inputs<T>) -> Mask {
        let (force, pressure) = (&self.radial_force, &self.pressure);
        !(!inputs.radial_force_n.age_s.negative_or_nan_mask()
            | !inputs.pressure_diff_mpa.age_s.negative_or_nan_mask()
            | force.value.outside_mask(T::zero())
            | pressure.value.outside_mask(T::zero())
            | !self.built.hold_s.lt_mask(force.age_s)
            | !self.built.hold_s.lt_mask(pressure.age_s))
    }

    /// Ages the missing side load and pressure. Returns 0 for both.
    #[inline(always)]
    pub(super) fn seal_inputs_missing(&mut self, flags: &mut Flags) -> Seal<T> {
        *flags |= Flags::RADIAL_FORCE_STALE.union(Flags::PRESSURE_STALE);
        let (built, zero) = (&self.built, T::zero());
        let (force, pressure) = (self.radial_force.age(built), self.pressure.age(built));
        let weight = SealWeights { force, pressure };
        Seal { force_n: zero, force_change_n: zero, pressure_mpa: zero, weight }
    }

    /// Returns side load and pressure, replaced, aged and faded where necessary.
    #[inline(always)]
    pub(super) fn guarded_seal(&mut self, inputs: &Inputs<T>, flags: &mut Flags) -> Seal<T> {
        let built = &self.built;
        let force = Guard {
            middle: built.radial_force_middle,
            half_width: built.radial_force_middle,
            invalid: Flags::RADIAL_FORCE_INVALID,
            stale: Flags::RADIAL_FORCE_STALE,
        };
        // A change counts only between two valid values. Neither the first reading nor the fade deflects a bristle.
        let before = self.radial_force.value;
        let is_expired = built.hold_s.lt_mask(self.radial_force.age_s);
        let force_weight = self.radial_force.update(inputs.radial_force_n, &force, built, flags);
        let change = self.radial_force.value - before;
        // Frames arrive less often than samples. A change between two frames is therefore spread over several samples.
        let bounded = change.within_level(built.radial_force_step);
        let is_too_fast = change.abs_gt_mask(built.radial_force_step) & !is_expired;
        self.radial_force.value = T::select(is_too_fast, before + bounded, self.radial_force.value);

        let pressure = Guard {
            middle: T::zero(),
            half_width: built.pressure_max_mpa,
            invalid: Flags::PRESSURE_INVALID,
            stale: Flags::PRESSURE_STALE,
        };
        let pressure_weight =
            self.pressure.update(inputs.pressure_diff_mpa, &pressure, built, flags);
        // A sensor's zero error can give a small negative value, and rounding in the guard can let a negative side load
        // pass. The levels are proven from 0 upwards.
        Seal {
            force_n: (self.radial_force.value * force_weight).positive_part(),
            force_change_n: T::select(is_expired, T::zero(), bounded),
            pressure_mpa: (self.pressure.value * pressure_weight).positive_part(),
            weight: SealWeights { force: force_weight, pressure: pressure_weight },
        }
    }
}
