//! What every law has to say: the list of questions, none of which it may leave open.

use super::bristle::Bristles;
use super::written::{Range, Written};
use crate::effect::{Effect, Effects, NoEffect};
use crate::number::Real;
use crate::parameter::ParameterId;
use crate::quantity::Sample;
use crate::refusal::ParameterError;

/// How a law takes a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Step<'a, T> {
    /// It has done so, and this is the friction torque, Nm.
    Done(T),
    /// These bristles are to be stepped, between these levels: the Coulomb and the static one, Nm. The
    /// laws that do it this way share the code of the step.
    Bristles(&'a Bristles<T>, T, T),
}

impl<'a, T: Real> Step<'a, T> {
    /// These bristles are to be stepped between the levels they were built with.
    #[inline(always)]
    pub fn of(bristles: &'a Bristles<T>) -> Self {
        Self::Bristles(bristles, bristles.coulomb, bristles.static_level)
    }

    /// The friction torque, Nm, after what is still to be done.
    #[inline(always)]
    pub fn finish<E: Effect<T>>(self, held: &mut T, velocity: T, effect: &E) -> T {
        match self {
            Self::Done(torque) => torque,
            Self::Bristles(bristles, coulomb, static_level) => {
                bristles.step_between(held, velocity, effect, coulomb, static_level)
            }
        }
    }
}

/// A law, built for a sample period: its coefficients and weights. What it remembers is kept apart: the
/// torque held by bent bristles, which every model has (a static law leaves it at 0), and a memory of its
/// own where it needs more. A memory or weights of many numbers belong behind a cargo feature, as terms are:
/// the state of a model has room for those of every law.
pub(crate) trait FrictionLaw<T: Real>: Copy {
    /// The parameters that belong to it.
    const PARAMETERS: &'static [ParameterId];

    /// Whether its own parameters hold how side load and pressure act, and the terms that do so are part of it.
    const HAS_SEAL_LOAD: bool = false;

    /// What it remembers between samples besides the held torque; `()` for all that have no more.
    type Memory: Copy + Default;

    /// Builds it for a sample period in s; from illegal values too, as a fit passes through them.
    fn build(written: &Written<T::Setting>, period_s: T::Setting) -> Self;

    /// Becomes `of` for a sample period `ratio` times as long.
    fn rescale_period(&mut self, of: &Self, ratio: T);

    /// The speed velocity is limited to, rad/s.
    fn velocity_limit(&self) -> T;

    /// The held torque of a joint that slides fast, Nm; 0 of a law that holds none.
    fn sliding_torque(&self) -> T;

    /// Advances the held torque (Nm) and the memory by one sample, or says which bristles are to do so.
    /// `velocity` may be any bit pattern: beyond the limit it is limited, NaN counts as rest.
    fn step<E: Effect<T>>(
        &self,
        held: &mut T,
        memory: &mut Self::Memory,
        velocity: T,
        effect: &E,
    ) -> Step<'_, T>;

    /// The same in a model without terms.
    #[inline(always)]
    fn step_alone(
        &self,
        held: &mut T,
        memory: &mut Self::Memory,
        sample: &Sample<T>,
    ) -> Step<'_, T> {
        self.step(held, memory, sample.velocity_rad_s, &NoEffect)
    }

    /// What the law's own load does in this sample, for terms to add to.
    #[inline(always)]
    fn load(&self, _: &Sample<T>, _: &mut Effects<T>) {}

    /// Refuses what the number `N` has no room for within the range; the coefficients that are parameters
    /// as they stand have been checked. Returns the largest torque besides level and viscous part, Nm.
    ///
    /// # Errors
    /// Names the product that is too large.
    fn check<N: Real, S: Real>(written: &Written<S>, range: &Range) -> Result<f64, ParameterError>;
}
