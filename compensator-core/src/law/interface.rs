//! The trait that every friction law implements, and the types that its methods have.

pub(crate) use super::bristle::Bristles;
pub(crate) use super::written::{LawParameters, LawRange};
use crate::effect::NoEffect;
pub(crate) use crate::effect::{Effect, Effects};
pub(crate) use crate::number::Real;
pub(crate) use crate::parameter::ParameterId as Id;
pub(crate) use crate::quantity::Sample;
pub(crate) use crate::refusal::ParameterError;

/// Result of [`FrictionLaw::step`]: a torque, or a bristle step that the caller completes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Step<'a, T> {
    /// The step is complete. The value is the friction torque, Nm.
    Done(T),
    /// The caller must step these bristles with these levels, Nm. All laws that return this variant share the code of
    /// the bristle step.
    Bristles { bristles: &'a Bristles<T>, coulomb: T, static_level: T },
}

impl<'a, T: Real> Step<'a, T> {
    /// Requests a step of these bristles with their own levels.
    #[inline(always)]
    pub fn of(bristles: &'a Bristles<T>) -> Self {
        let Bristles { coulomb, static_level, .. } = *bristles;
        Self::Bristles { bristles, coulomb, static_level }
    }

    /// Completes the step and returns the friction torque, Nm.
    #[inline(always)]
    pub fn finish<E: Effect<T>>(self, held: &mut T, velocity: T, effect: &E) -> T {
        match self {
            Self::Done(torque) => torque,
            Self::Bristles { bristles, coulomb, static_level } => {
                bristles.step_between(held, velocity, effect, coulomb, static_level)
            }
        }
    }
}

/// Coefficients of a friction law for one sample period.
///
/// The state is stored separately. It consists of the bristle torque, which every model has (0 in a static law),
/// and an optional memory of the law. The state of a model contains the memory of every law. A law with a large
/// memory or many coefficients must therefore be behind a cargo feature, as the terms are.
pub(crate) trait FrictionLaw<T: Real>: Copy {
    /// Parameters of the law.
    const PARAMETERS: &'static [Id];

    /// True if the law itself models side load and pressure, so that it includes the terms for them.
    const HAS_SEAL_LOAD: bool = false;

    /// Memory between samples apart from the bristle torque; `()` if there is none.
    type Memory: Copy + Default;

    /// Computes the coefficients for a sample period in s. Accepts illegal values, because a fit may try them.
    fn build(written: &LawParameters<T::Setting>, period_s: T::Setting) -> Self;

    /// Sets the coefficients that depend on the sample period to those of `of` for a period `ratio` times as long. The
    /// others keep their values. Those of a static law do not depend on the period.
    fn rescale_period(&mut self, _: &Self, _: T) {}

    /// Multiplies the levels, those of the law's own load included, by `level`, and the viscous coefficients by
    /// `viscous`.
    fn scale_levels(&mut self, level: T, viscous: T);

    /// Returns the largest speed that the law evaluates, rad/s. A larger velocity is limited to it.
    fn velocity_limit(&self) -> T;

    /// Returns the bristle torque in fast sliding, Nm; 0 for a static law.
    fn sliding_torque(&self) -> T {
        T::zero()
    }

    /// Advances the bristle torque `held` (Nm) and the memory by one sample, or returns the bristles to step.
    ///
    /// `velocity` (rad/s) may have any bit pattern. It is limited to the velocity limit; NaN is treated as rest.
    fn step<E: Effect<T>>(
        &self,
        held: &mut T,
        memory: &mut Self::Memory,
        velocity: T,
        effect: &E,
    ) -> Step<'_, T>;

    /// As [`FrictionLaw::step`], in a model without terms. A law with a seal load must write its own, which includes it.
    #[inline(always)]
    fn step_alone(
        &self,
        held: &mut T,
        memory: &mut Self::Memory,
        sample: &Sample<T>,
    ) -> Step<'_, T> {
        const { assert!(!Self::HAS_SEAL_LOAD, "the effect of the seal load would be lost") };
        self.step(held, memory, sample.velocity_rad_s, &NoEffect)
    }

    /// Writes the effect of the law's own load into `effects`. Terms add to it.
    #[inline(always)]
    fn load(&self, _: &Sample<T>, _: &mut Effects<T>) {}

    /// Checks that the number type `N` can represent every product of the law within `range`.
    ///
    /// The caller has already checked the coefficients that equal a parameter. Returns the largest magnitude of the
    /// law's torque apart from its level and the linear viscous friction, Nm; 0 for a law that has no more.
    ///
    /// # Errors
    /// Names the product that `N` cannot represent.
    fn check<N: Real, S: Real>(_: &LawParameters<S>, _: &LawRange) -> Result<f32, ParameterError> {
        Ok(0.0)
    }
}
