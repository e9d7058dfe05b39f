//! The trait that every term implements, and the types that its methods have.

pub(crate) use super::bounds::Bounds;
pub(crate) use crate::effect::Effects;
pub(crate) use crate::envelope::Envelope;
pub(crate) use crate::number::Real;
pub(crate) use crate::parameter::{ParameterId as Id, ParameterValues};
pub(crate) use crate::quantity::{Quantity, Sample};
pub(crate) use crate::refusal::{Bound, ParameterError, refuse};
pub(crate) use crate::text;

/// Maximum number of coefficients that a term reports for the range check.
pub(crate) const COEFFICIENTS: usize = 4;

/// Coefficients of a term for one sample period. Its memory is stored separately.
pub(crate) trait Term<T: Real>: Copy + Default {
    /// Parameters of the term.
    const PARAMETERS: &'static [Id];

    /// Parameters that scale with a gain on the term: its effect is proportional to them, or nearly so. Empty if the
    /// term has no size.
    const SIZES: &'static [Id] = &[];

    /// Quantity that the term requires.
    ///
    /// `None` if it needs only velocity, acceleration or time, which every log has, or if a parameter selects
    /// its column.
    const READS: Option<Quantity> = None;

    /// True if the term acts before all others, because they depend on its effect.
    const IS_APPLIED_FIRST: bool = false;

    /// Memory between samples; `()` if there is none.
    type Memory: Copy + Default;

    /// Computes the coefficients for a sample period in s. Accepts illegal values, because a fit may try them.
    fn build(values: &ParameterValues<T::Setting>, period_s: T::Setting) -> Self;

    /// Returns the coefficients for a sample period `ratio` times as long. Most do not depend on the period.
    fn rescale_period(&self, _: T) -> Self {
        *self
    }

    /// Sets the coefficients of [`Term::SIZES`] to those of `of` times `gain`. The others are equal already.
    fn set_gain(&mut self, _of: &Self, _gain: T) {}

    /// Writes the effect of the term in one sample to `effects`, and updates its memory.
    fn act(&self, sample: &Sample<T>, memory: &mut Self::Memory, effects: &mut Effects<T>);

    /// Returns the coefficients that the number type must represent with a small relative error, filled with 0.
    fn coefficients(&self) -> [T; COEFFICIENTS];

    /// Returns the largest magnitude of any product in [`Term::act`] within the envelope. Products that
    /// [`Term::widen`] covers are excluded.
    fn largest_product(&self, envelope: &Envelope) -> f32;

    /// Widens the bounds of a law's quantities by the effect of the term within the envelope.
    fn widen<S: Real>(values: &ParameterValues<S>, envelope: &Envelope, bounds: &mut Bounds);

    /// Checks the conditions that the ranges of the single parameters do not cover.
    ///
    /// # Errors
    /// Returns the parameter, its value, the violated bound and the reason for the bound.
    fn validate<S: Real>(_: &ParameterValues<S>, _: &Envelope) -> Result<(), ParameterError> {
        Ok(())
    }

    /// Checks the conditions that depend on the sample period, s.
    ///
    /// # Errors
    /// As [`Term::validate`].
    fn validate_period<S: Real>(
        _: &ParameterValues<S>,
        _period_s: f32,
    ) -> Result<(), ParameterError> {
        Ok(())
    }
}
