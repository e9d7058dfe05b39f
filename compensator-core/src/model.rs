//! A friction model built for a sample period: one [`Sample`] in, one torque out.
//!
//! [`Model`] is immutable and swapped whole; [`State`] is what it remembers. The laws and terms it
//! is made of are in [`crate::law`] and [`crate::term`]; this module only puts them together.
//!
//! Units inside are chosen so that fixed point can hold them: pressure in MPa, campaign time in
//! hours. For a prismatic joint read m for rad and N for Nm throughout.

pub use crate::law::Law;
pub use crate::quantity::Sample;

use crate::effect::Effects;
use crate::law;
use crate::network::Factors;
use crate::number::Real;
use crate::term::{self, Terms};

/// What a model remembers between samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct State<T: Real> {
    /// Torque held by the bent bristles, `y = sigma0 z`, Nm.
    pub bristle_torque_nm: T,
    /// What the law remembers besides.
    pub(crate) law: law::Memory<T>,
    /// What its terms remember.
    pub(crate) terms: term::Memory<T>,
}

impl<T: Real> State<T> {
    /// A model that holds this bristle torque, Nm.
    pub fn holding(bristle_torque_nm: T) -> Self {
        Self { bristle_torque_nm, ..Self::default() }
    }

    /// Back to rest, remembering nothing.
    pub(crate) fn clear(&mut self) {
        self.bristle_torque_nm = T::zero();
        self.law = law::Memory::default();
        self.terms.clear();
    }

    /// The same, warm from what was dissipated before: `heat` is that energy, less what was lost since,
    /// over the energy of the term `warm-up`.
    #[must_use]
    pub fn warmed(mut self, heat: T) -> Self {
        self.terms.set_heat(heat);
        self
    }
}

/// A friction model built for a sample period; see [`crate::parameters::Parameters::build`].
#[derive(Clone, Debug)]
pub struct Model<T: Real> {
    pub(crate) law: Law<T>,
    pub(crate) terms: Terms<T>,
}

impl<T: Real> Model<T> {
    /// The law without its terms.
    pub fn law(&self) -> &Law<T> {
        &self.law
    }

    /// A copy for a sample period `ratio` times as long; see [`Model::rescale_period`].
    pub fn rescaled(&self, ratio: T) -> Self {
        let mut rescaled = self.clone();
        rescaled.rescale_period(self, ratio);
        rescaled
    }

    /// Becomes `of` for a sample period `ratio` times as long: for logs whose samples are unevenly
    /// spaced. `self` is to be a copy of `of`, or what an earlier call made of one; only what the period
    /// enters is written. `ratio` is positive.
    pub fn rescale_period(&mut self, of: &Self, ratio: T) {
        self.law.rescale_period(&of.law, ratio);
        self.terms.rescale_period(&of.terms, ratio);
    }

    /// Whether the model is its law alone.
    pub fn is_plain(&self) -> bool {
        self.terms.is_empty()
    }

    /// Friction torque in this sample, Nm, positive where it has to be driven towards positive
    /// velocity; advances `state` by the sample period the model was built for.
    ///
    /// Defined for every bit pattern of the velocity. Other inputs are to be finite: the
    /// [`crate::compensator::Compensator`] sees to that.
    #[inline]
    pub fn step(&self, state: &mut State<T>, sample: &Sample<T>) -> T {
        if !self.terms.is_empty() {
            return self.step_with_terms(state, sample);
        }
        self.step_plain(state, sample)
    }

    /// The same of a model that is its law alone ([`Model::is_plain`]).
    #[inline(always)]
    pub(crate) fn step_plain(&self, state: &mut State<T>, sample: &Sample<T>) -> T {
        self.law.step_alone(&mut state.bristle_torque_nm, &mut state.law, sample)
    }

    /// The same under a network's factors, which are for `lugre-asymmetric` without terms; of another model, nothing.
    #[inline(never)]
    pub fn step_supplied(
        &self,
        state: &mut State<T>,
        sample: &Sample<T>,
        factors: &Factors<T>,
    ) -> T {
        match &self.law {
            Law::LugreAsymmetric(law) if self.terms.is_empty() => {
                law.step_under(&mut state.bristle_torque_nm, sample.velocity_rad_s, factors)
            }
            _ => self.step(state, sample),
        }
    }

    /// Whether a network's factors change what it gives; see [`Model::step_supplied`].
    pub(crate) fn takes_factors(&self) -> bool {
        self.terms.is_empty() && matches!(self.law, Law::LugreAsymmetric(_))
    }

    /// The same as [`Model::step_supplied`] or [`Model::step`], of a model that has terms or takes the factors given.
    #[inline(always)]
    pub(crate) fn step_more(
        &self,
        state: &mut State<T>,
        sample: &Sample<T>,
        factors: Option<&Factors<T>>,
    ) -> T {
        match (&self.law, factors) {
            (Law::LugreAsymmetric(law), Some(factors)) if self.terms.is_empty() => {
                law.step_under(&mut state.bristle_torque_nm, sample.velocity_rad_s, factors)
            }
            // Who calls this has terms; without the feature nobody has, and nothing is compiled for them.
            _ if self.terms.is_empty() => T::zero(),
            _ => self.step_with_terms(state, sample),
        }
    }

    #[inline(never)]
    fn step_with_terms(&self, state: &mut State<T>, sample: &Sample<T>) -> T {
        // Guarded before the terms see it: what is not a number must not enter their memory.
        let velocity = sample.velocity_rad_s.or_zero_if_nan().within(self.law.velocity_limit());
        let mut effects = Effects::none(velocity, state.bristle_torque_nm);
        self.law.load(sample, &mut effects);
        self.terms.act(sample, &mut state.terms, &mut effects);
        let (held, velocity) = (&mut state.bristle_torque_nm, effects.velocity);
        let friction = self.law.step(held, &mut state.law, velocity, &effects);
        state.terms.take_power(friction * velocity);
        friction + effects.torque
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_that_remembers_no_more_than_its_bristles_carries_one_number() {
        let own = size_of::<State<f32>>() - size_of::<term::Memory<f32>>();
        assert_eq!(own, size_of::<f32>());
        #[cfg(not(feature = "terms"))]
        assert_eq!(size_of::<State<f32>>(), size_of::<f32>());
    }
}
