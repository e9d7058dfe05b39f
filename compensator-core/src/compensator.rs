//! The friction compensator: a friction model with input guards and output limits for a current loop.
//!
//! In each sample, the compensator reads the sensor values with their ages. It returns the current that
//! cancels the friction. The output is finite, bounded and slew-limited for every input:
//!
//! * **Guards**: An input that is NaN or outside the envelope is flagged and replaced by the last valid value.
//!   The replacement ages. After `hold_s` it fades to its neutral value over `fade_s`.
//! * **Velocity**: Near zero, the velocity is blended towards the reference, because the sign of a measured
//!   velocity is not reliable there.
//! * **Scale**: The scale is at most 1, because over-compensation causes limit cycles. Industry uses 0.7-0.9.
//! * **Limits**: The current limit acts after the last addition ([`Compensator::sum`]). Each active limit sets a
//!   [`Flags`] bit.
//! * **Disabled**: A disabled compensator adds nothing. The bits of a valid command within the limit do not change.

#[cfg_attr(not(feature = "terms"), path = "compensator/no_covariates.rs")]
mod covariates;
mod guards;
mod parameters;

pub use crate::configuration::CompensatorParameters;
pub use crate::flags::Flags;
pub use crate::quantity::{Inputs, Reading};

use crate::adaptation::Gains;
use crate::configuration::Configuration;
use crate::model::{FrictionModel, ModelState, Sample};
use crate::network::Factors;
use crate::number::Real;
use crate::parameters::ParameterError;
use covariates::Covariates;
use guards::Held;
use parameters::BuiltParameters;

/// Result of one compensator sample. All values are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompensatorOutput<T> {
    /// The model's friction torque, Nm, unscaled and unlimited.
    pub friction_torque_nm: T,
    /// Torque to add, Nm, after scale, torque limit and slew limit.
    pub compensation_torque_nm: T,
    /// Current that produces `compensation_torque_nm`, A.
    pub feed_forward_current_a: T,
    /// Guards and limits that acted in this sample.
    pub flags: Flags,
}

/// The compensator of one joint: the model, the input guards and the output limits.
#[derive(Clone, Debug)]
pub struct Compensator<T: Real> {
    enabled: bool,
    /// True if [`Self::step`] may take the fast path. The compensator is then enabled, its model has no terms, and no
    /// network factors apply.
    is_fast_path: bool,
    model: FrictionModel<T>,
    /// The tuned set, from which gains are applied.
    base: FrictionModel<T>,
    built: BuiltParameters<T>,
    state: ModelState<T>,
    /// Factors that a network last supplied; `None` if the law's constants apply.
    factors: Option<Factors<T>>,
    compensation_torque_nm: T,
    radial_force: Held<T>,
    pressure: Held<T>,
    covariates: Covariates<T>,
}

impl<T: Real> Compensator<T> {
    /// Builds a compensator for a sample period, s. The compensator is disabled and at rest. It adds no inertia, offset, gain or
    /// delay of the model ([`crate::Parameters::left_out`] lists them).
    ///
    /// # Errors
    /// Returns the errors of [`crate::Parameters::build`] and [`CompensatorParameters::validate`], and an error if the
    /// number type cannot represent a coefficient.
    pub fn build(configuration: &Configuration, period_s: f32) -> Result<Self, ParameterError>
    where
        T: Real<Setting = f32>,
    {
        configuration.compensator.validate()?;
        configuration.model.validate()?;
        let compensated = configuration.model.compensated();
        let model = compensated.build::<T>(period_s)?;
        let reference = configuration.model.get(crate::ParameterId::TemperatureReference);
        let built = BuiltParameters::new(
            &configuration.compensator,
            &configuration.model.envelope,
            period_s,
        )?;
        Ok(Self {
            enabled: false,
            is_fast_path: false,
            state: ModelState::default(),
            factors: None,
            compensation_torque_nm: T::zero(),
            radial_force: Held::unmeasured(&built),
            pressure: Held::unmeasured(&built),
            covariates: Covariates::unmeasured(&built, &configuration.model.envelope, reference),
            // Built anew: a copy of its fields would take more code.
            base: compensated.build_unchecked(period_s),
            model,
            built,
        })
    }

    /// Enables or disables the compensator. When enabled, it starts from rest and zero torque. The slew limit
    /// then ramps the compensation up.
    pub fn set_enabled(&mut self, enabled: bool) {
        // The state is cleared when the compensator is disabled. Disabled samples are cheap, so clearing does not
        // raise the worst-case cost.
        if self.enabled && !enabled {
            self.state.clear();
            self.compensation_torque_nm = T::zero();
        }
        self.enabled = enabled;
        self.select_path();
    }

    /// Selects between the fast path and the general path of [`Self::step`].
    fn select_path(&mut self) {
        let has_factors = self.factors.is_some() && self.model.law_taking_factors().is_some();
        self.is_fast_path = self.enabled && self.model.has_no_terms() && !has_factors;
    }

    /// Returns true if the compensator is enabled.
    pub fn is_enabled(&self) -> bool {
        self.enabled
    }

    /// Sets the factors that a network supplies ([`crate::network::FactorSupplier`]). They apply from the next sample
    /// until the next call. `None` selects the law's constants.
    ///
    /// Factors apply only to `lugre-asymmetric` without terms. Other models ignore them.
    pub fn supply(&mut self, factors: Option<Factors<T>>) {
        self.factors = factors;
        self.select_path();
    }

    /// Becomes a copy of another compensator, without its tuned set. [`Compensator::replace_base`] copies that, so that a
    /// current loop can do it in another period.
    pub fn replace(&mut self, from: &Self) {
        // Whole: a new field does not compile until it is copied here.
        let Self {
            enabled,
            is_fast_path,
            model,
            base: _,
            built,
            state,
            factors,
            compensation_torque_nm,
            radial_force,
            pressure,
            covariates,
        } = from;
        self.enabled = *enabled;
        self.is_fast_path = *is_fast_path;
        self.model.clone_from(model);
        self.built.clone_from(built);
        self.state = *state;
        self.factors = *factors;
        self.compensation_torque_nm = *compensation_torque_nm;
        self.radial_force.clone_from(radial_force);
        self.pressure.clone_from(pressure);
        self.covariates.clone_from(covariates);
    }

    /// Takes the tuned set of another compensator, to which later gains apply.
    pub fn replace_base(&mut self, from: &Self) {
        self.base.clone_from(&from.base);
    }

    /// Sets the gains on the sizes of the model ([`crate::adaptation`]) from the next sample on. The state stays.
    pub fn set_gains(&mut self, gains: &Gains<T>) {
        self.model.set_gains(&self.base, gains);
    }

    /// Returns the torque of the bristle deflection, Nm.
    pub fn bristle_torque_nm(&self) -> T {
        self.state.bristle_torque_nm
    }

    /// Computes the compensation for one sample.
    ///
    /// A fast path serves laws without terms whose readings need no guard. A general path handles all other cases. Both
    /// paths give identical bits. `tests/emulator/core-cost.tsv` bounds the instructions of both.
    ///
    /// The function is inlined because an image calls it once, in its current loop.
    #[inline(always)]
    pub fn step(&mut self, inputs: &Inputs<T>) -> CompensatorOutput<T> {
        if !self.is_fast_path {
            return self.step_general(inputs);
        }
        let force_change = inputs.radial_force_n.value - self.radial_force.value;
        let velocities = self.velocities_guard_mask(inputs);
        let seal = self.seal_guard_mask(inputs, force_change);
        // Separate variables: a structure filled by a call that is not inlined would use memory on the fast path too.
        let (velocity, force, change, pressure, weight, flags);
        if (velocities | seal).is_set() {
            let guarded = self.guard_inputs(inputs, velocities, seal);
            (velocity, weight) = (guarded.velocity_rad_s, guarded.velocity_weight);
            (force, pressure) = (guarded.seal.force_n, guarded.seal.pressure_mpa);
            (change, flags) = (guarded.seal.force_change_n, guarded.flags);
        } else {
            let seal = self.accept_seal(inputs, force_change);
            let reference = inputs.velocity_reference_rad_s.value;
            velocity = self.blended(inputs.velocity_rad_s.value, reference);
            (force, pressure) = (seal.force_n, seal.pressure_mpa);
            (change, weight, flags) = (seal.force_change_n, T::one(), Flags::empty());
        }
        let sample = Sample {
            velocity_rad_s: velocity,
            radial_force_n: force,
            radial_force_change_n: change,
            pressure_diff_mpa: pressure,
            ..Sample::default()
        };
        let friction = self.model.step_plain(&mut self.state, &sample);
        self.finish_unlimited(friction, weight, flags)
    }

    /// Computes a sample of a disabled compensator, or of a model with terms or network factors.
    #[inline(never)]
    fn step_general(&mut self, inputs: &Inputs<T>) -> CompensatorOutput<T> {
        // Also while disabled: side load and pressure are then valid in the first enabled sample, which is the longest.
        let guarded = self.guard_if_needed(inputs);
        if !self.enabled {
            let zero = T::zero();
            return CompensatorOutput {
                friction_torque_nm: zero,
                compensation_torque_nm: zero,
                feed_forward_current_a: zero,
                flags: Flags::DISABLED,
            };
        }
        let (weight, seal, mut flags) = (guarded.velocity_weight, guarded.seal, guarded.flags);
        let mut sample = Sample {
            velocity_rad_s: guarded.velocity_rad_s,
            radial_force_n: seal.force_n,
            radial_force_change_n: seal.force_change_n,
            pressure_diff_mpa: seal.pressure_mpa,
            ..Sample::default()
        };
        self.covariates.update(
            inputs,
            &self.model,
            &self.built,
            seal.weight,
            &mut sample,
            &mut flags,
        );
        let friction = self.model.step_general(&mut self.state, &sample, self.factors.as_ref());
        self.finish_limited(friction, weight, flags)
    }

    /// Converts the friction torque, Nm, to the output. Calls [`Self::finish_limited`] if a limit acts.
    #[inline(always)]
    fn finish_unlimited(&mut self, friction: T, weight: T, flags: Flags) -> CompensatorOutput<T> {
        let built = &self.built;
        let requested = friction * built.scale * weight;
        let change = requested - self.compensation_torque_nm;
        let limited = friction.abs_gt_mask(built.not_finite)
            | requested.past_level_mask(built.torque_limit)
            | change.past_level_mask(built.slew_step);
        if limited.is_set() {
            return self.finish_limited(friction, weight, flags);
        }
        let compensation = self.compensation_torque_nm + change;
        self.compensation_torque_nm = compensation;
        CompensatorOutput {
            friction_torque_nm: friction,
            compensation_torque_nm: compensation,
            feed_forward_current_a: compensation * built.current_per_torque,
            flags,
        }
    }

    /// Converts the friction torque, Nm, to the output under all limits.
    #[inline(never)]
    fn finish_limited(
        &mut self,
        mut friction: T,
        weight: T,
        mut flags: Flags,
    ) -> CompensatorOutput<T> {
        // Validated parameters keep the friction far below this bound.
        if friction.abs_gt_mask(self.built.not_finite).is_set() {
            friction = T::zero();
            self.state.clear();
            flags |= Flags::MODEL_NOT_FINITE;
        }
        let built = &self.built;
        let requested = friction * built.scale * weight;
        let limited = requested.within_level(built.torque_limit);
        flags |= Flags::TORQUE_LIMITED.when(requested.abs_gt_mask(built.torque_limit));
        let change = limited - self.compensation_torque_nm;
        let slewed = change.within_level(built.slew_step);
        flags |= Flags::SLEW_LIMITED.when(change.abs_gt_mask(built.slew_step));
        self.compensation_torque_nm = self.compensation_torque_nm + slewed;
        CompensatorOutput {
            friction_torque_nm: friction,
            compensation_torque_nm: self.compensation_torque_nm,
            feed_forward_current_a: self.compensation_torque_nm * built.current_per_torque,
            flags,
        }
    }

    /// Adds the compensation to a commanded current, A, and limits the sum. Returns the sum, A, and the flags.
    ///
    /// If the compensator is disabled, the bits of a valid command within the limit do not change. A command that is
    /// not finite counts as 0.
    #[inline(always)]
    pub fn sum(&self, command_current_a: T, output: &CompensatorOutput<T>) -> (T, Flags) {
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

    /// Adds and limits as [`Self::sum`], and handles an invalid command and an active limit.
    #[inline(never)]
    fn sum_limited(&self, command_current_a: T, output: &CompensatorOutput<T>) -> (T, Flags) {
        let mut flags = output.flags;
        let is_invalid = command_current_a.abs_gt_mask(self.built.not_finite);
        let command = T::select(is_invalid, T::zero(), command_current_a);
        flags |= Flags::COMMAND_INVALID.when(is_invalid);
        let sum = if self.enabled { command + output.feed_forward_current_a } else { command };
        let limited = sum.within_level(self.built.current_limit);
        flags |= Flags::CURRENT_LIMITED.when(sum.abs_gt_mask(self.built.current_limit));
        (limited, flags)
    }
}

/// Converts a limit to the number type. A limit of -0 becomes 0.
fn limit<T: Real>(size: f32) -> T {
    T::from_f64(f64::from(size).abs())
}

#[cfg(test)]
mod fast_path_tests;
#[cfg(test)]
mod tests;
