//! What every term has to say: the list of questions, none of which it may leave open.

use super::bounds::Bounds;
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId, Values};
use crate::quantity::{Quantity, Sample};
use crate::refusal::ParameterError;

/// Most coefficients a term is built of.
pub(crate) const COEFFICIENTS: usize = 4;

/// A term, built for a sample period: its coefficients. What it remembers is kept apart.
pub(crate) trait Term<T: Real>: Copy + Default {
    /// The parameters that belong to it.
    const PARAMETERS: &'static [ParameterId];

    /// The quantity it does nothing without; `None` where velocity, acceleration or time, which every log
    /// has, is all it needs, or where what it follows is a choice.
    const READS: Option<Quantity>;

    /// Whether it goes before all others, because they are to see what it does.
    const ACTS_FIRST: bool = false;

    /// What it remembers between samples; `()` for most.
    type Memory: Copy + Default;

    /// Builds it for a sample period in s; from illegal values too, as a fit passes through them.
    fn build(values: &Values<T::Setting>, period_s: T::Setting) -> Self;

    /// The same for a sample period `ratio` times as long.
    fn rescale_period(&self, ratio: T) -> Self;

    /// Lets it act on one sample.
    fn act(&self, sample: &Sample<T>, memory: &mut Self::Memory, effects: &mut Effects<T>);

    /// The coefficients that must be held to a share of their value, the rest 0.
    fn coefficients(&self) -> [T; COEFFICIENTS];

    /// The largest magnitude any product of [`Term::act`] can reach within the envelope, apart from
    /// those with what [`Term::widen`] tells of.
    fn largest_product(&self, envelope: &Envelope) -> f64;

    /// Widens the bounds of a law's quantities by what it does to them within the envelope.
    fn widen<S: Real>(values: &Values<S>, envelope: &Envelope, bounds: &mut Bounds);

    /// Checks what the ranges of its parameters leave open.
    ///
    /// # Errors
    /// Names the parameter, its value, the bound it broke and why.
    fn validate<S: Real>(values: &Values<S>, envelope: &Envelope) -> Result<(), ParameterError>;

    /// Checks what depends on the sample period, s.
    ///
    /// # Errors
    /// As [`Term::validate`].
    fn validate_period<S: Real>(_: &Values<S>, _period_s: f64) -> Result<(), ParameterError> {
        Ok(())
    }
}
