//! A friction model built for a sample period: one [`Sample`] in, one torque out.
//!
//! A [`FrictionModel`] is immutable and is replaced as a whole. Its [`ModelState`] holds the memory between
//! samples. This module combines a law ([`crate::law`]) with its terms ([`crate::term`]).
//!
//! The internal units let fixed point represent all values: pressure in MPa, campaign time in h. For a
//! prismatic joint, replace rad by m and Nm by N.

pub use crate::law::Law;
pub use crate::quantity::Sample;

use crate::effect::Effects;
use crate::law::{self, LugreAsymmetric};
use crate::network::Factors;
use crate::number::Real;
use crate::term::{self, Terms};

/// The state of a model between samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct ModelState<T: Real> {
    /// Torque of the bristle deflection, `y = sigma0 z`, Nm.
    pub bristle_torque_nm: T,
    /// Further state of the law.
    pub(crate) law: law::Memory<T>,
    /// State of the terms.
    pub(crate) terms: term::Memory<T>,
}

impl<T: Real> ModelState<T> {
    /// Returns a state with this bristle torque, Nm, and no other memory.
    pub fn holding(bristle_torque_nm: T) -> Self {
        Self { bristle_torque_nm, ..Self::default() }
    }

    /// Resets the state to rest and clears its memory.
    pub(crate) fn clear(&mut self) {
        self.bristle_torque_nm = T::zero();
        self.law = law::Memory::default();
        self.terms.clear();
    }

    /// Returns the state with this heat of the term `warm-up`.
    ///
    /// `heat` is the dissipated energy minus the losses, divided by the energy parameter of `warm-up`.
    #[must_use]
    pub fn with_heat(mut self, heat: T) -> Self {
        self.terms.set_heat(heat);
        self
    }
}

/// A friction model built for a sample period. See [`crate::parameters::Parameters::build`].
#[derive(Debug)]
pub struct FrictionModel<T: Real> {
    pub(crate) law: Law<T>,
    pub(crate) terms: Terms<T>,
}

impl<T: Real> Clone for FrictionModel<T> {
    fn clone(&self) -> Self {
        Self { law: self.law, terms: self.terms.clone() }
    }

    /// Out of line, because a current loop copies two models.
    #[inline(never)]
    fn clone_from(&mut self, from: &Self) {
        self.law = from.law;
        self.terms.clone_from(&from.terms);
    }
}

impl<T: Real> FrictionModel<T> {
    /// Returns the law without its terms.
    pub fn law(&self) -> &Law<T> {
        &self.law
    }

    /// Returns a copy for a sample period `ratio` times as long. See [`FrictionModel::rescale_period`].
    pub fn rescaled(&self, ratio: T) -> Self {
        let mut rescaled = self.clone();
        rescaled.rescale_period(self, ratio);
        rescaled
    }

    /// Updates `self` to `source` with a sample period `ratio` times as long. Logs with unevenly spaced samples
    /// need this.
    ///
    /// `self` must be a copy of `source`, or such a copy after earlier calls. The function writes only the values that
    /// depend on the period. `ratio` must be positive.
    pub fn rescale_period(&mut self, source: &Self, ratio: T) {
        self.law.rescale_period(&source.law, ratio);
        self.terms.rescale_period(&source.terms, ratio);
    }

    /// Returns true if the model has no terms.
    pub fn has_no_terms(&self) -> bool {
        self.terms.is_empty()
    }

    /// Returns the friction torque of this sample, Nm, and advances `state` by the model's sample period.
    ///
    /// A positive torque opposes motion in the positive direction. The result is defined for every bit pattern of the
    /// velocity. Other inputs must be finite; the [`crate::compensator::Compensator`] ensures this.
    #[inline]
    pub fn step(&self, state: &mut ModelState<T>, sample: &Sample<T>) -> T {
        if !self.terms.is_empty() {
            return self.step_with_terms(state, sample);
        }
        self.step_plain(state, sample)
    }

    /// Returns `state` with the bristle torque from which the next step returns `torque_nm`, as far as the level permits.
    ///
    /// A joint at rest holds any torque up to its static level. Only a measured torque indicates which one. A simulation
    /// that starts from zero instead is wrong until the joint leaves presliding. `sample` is the first sample, and
    /// `torque_nm` its measured torque, Nm. The other memory in `state` remains. A law without bristles returns `state`.
    #[must_use]
    pub fn state_for_torque(
        &self,
        state: ModelState<T>,
        sample: &Sample<T>,
        torque_nm: T,
    ) -> ModelState<T> {
        /// Torque above any level, Nm.
        const ANY_TORQUE_NM: f64 = 1e9;
        /// Number of bisections: one for each bit of an `f64` and some for the distance to the level.
        const BISECTIONS: usize = 64;
        let from = |bristle_torque_nm: T| ModelState { bristle_torque_nm, ..state };
        let mut at_rest = *sample;
        at_rest.velocity_rad_s = T::zero();
        let limited_by_step = |torque: T| {
            let mut after = from(torque);
            self.step(&mut after, &at_rest);
            after.bristle_torque_nm
        };
        let any_torque = T::from_f64(ANY_TORQUE_NM);
        let (mut least, mut most) = (limited_by_step(-any_torque), limited_by_step(any_torque));
        if most >= any_torque {
            return state;
        }
        for _ in 0..BISECTIONS {
            let middle = (least + most) * T::from_f64(0.5);
            if self.step(&mut from(middle), sample) < torque_nm {
                least = middle;
            } else {
                most = middle;
            }
        }
        from(most)
    }

    /// Same as [`FrictionModel::step`] for a model without terms ([`FrictionModel::has_no_terms`]).
    #[inline(always)]
    pub(crate) fn step_plain(&self, state: &mut ModelState<T>, sample: &Sample<T>) -> T {
        self.law.step_alone(&mut state.bristle_torque_nm, &mut state.law, sample)
    }

    /// Returns the law if the factors of a network affect the model: only `lugre-asymmetric` without terms takes them.
    #[inline(always)]
    pub(crate) fn law_taking_factors(&self) -> Option<&LugreAsymmetric<T>> {
        let Law::LugreAsymmetric(law) = &self.law else { return None };
        self.terms.is_empty().then_some(law)
    }

    /// Same as [`FrictionModel::step`], with the factors of a network. The model must have terms, or the given factors must
    /// affect it ([`Self::law_taking_factors`]).
    #[inline(always)]
    pub(crate) fn step_general(
        &self,
        state: &mut ModelState<T>,
        sample: &Sample<T>,
        factors: Option<&Factors<T>>,
    ) -> T {
        match (self.law_taking_factors(), factors) {
            (Some(law), Some(factors)) => {
                law.step_with_effect(&mut state.bristle_torque_nm, sample.velocity_rad_s, factors)
            }
            // A caller's model has terms here. Builds without the feature `terms` compile no code for them.
            _ if self.terms.is_empty() => T::zero(),
            _ => self.step_with_terms(state, sample),
        }
    }

    /// Same as [`FrictionModel::step`] for a model with terms.
    #[inline(never)]
    fn step_with_terms(&self, state: &mut ModelState<T>, sample: &Sample<T>) -> T {
        // The guard precedes the terms, because a NaN must not enter their memory.
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
    use crate::number::Fixed;
    use crate::{LawKind, ParameterId as Id, Parameters};

    fn state_for_torque_in<T: Real>(law: LawKind, velocity: f64, torque: f64) -> (f64, f64) {
        let parameters = Parameters::<T::Setting>::new(law)
            .with(Id::CoulombTorque, T::Setting::from_f64(1.5))
            .with(Id::StaticTorque, T::Setting::from_f64(2.0))
            .with(Id::ViscousFriction, T::Setting::from_f64(0.4));
        let model: FrictionModel<T> = parameters.build_unchecked(T::Setting::from_f64(1e-3));
        let sample = Sample { velocity_rad_s: T::from_f64(velocity), ..Sample::default() };
        let start = ModelState::default();
        let mut state = model.state_for_torque(start, &sample, T::from_f64(torque));
        let held = state.bristle_torque_nm.value();
        (held, model.step(&mut state, &sample).value())
    }

    #[test]
    fn state_for_torque_within_level_returns_torque_in_next_step() {
        for (velocity, torque) in [(0.0, 0.7), (0.0, -1.9), (1e-4, 0.3), (-2.0, -2.2)] {
            let (_, double) = state_for_torque_in::<f64>(LawKind::Lugre, velocity, torque);
            let (_, single) = state_for_torque_in::<f32>(LawKind::Lugre, velocity, torque);
            let (_, fixed) = state_for_torque_in::<Fixed>(LawKind::Lugre, velocity, torque);
            assert!((double - torque).abs() < 1e-12, "{velocity} {torque}: {double}");
            assert!((single - torque).abs() < 1e-6, "{velocity} {torque}: {single}");
            assert!((fixed - torque).abs() < 1e-5, "{velocity} {torque}: {fixed}");
        }
    }

    #[test]
    fn state_for_torque_beyond_level_returns_level() {
        for sign in [1.0, -1.0] {
            let (held, _) = state_for_torque_in::<f64>(LawKind::Lugre, 0.0, 9.0 * sign);
            assert!((held - 2.0 * sign).abs() < 1e-12, "{held}");
        }
    }

    #[test]
    fn state_for_torque_of_static_law_is_unchanged() {
        let (held, _) = state_for_torque_in::<f64>(LawKind::Stribeck, 0.5, 1.0);
        assert_eq!(held, 0.0);
    }

    #[test]
    fn model_state_of_law_is_one_number() {
        let law_size = size_of::<ModelState<f32>>() - size_of::<term::Memory<f32>>();
        assert_eq!(law_size, size_of::<f32>());
        #[cfg(not(feature = "terms"))]
        assert_eq!(size_of::<ModelState<f32>>(), size_of::<f32>());
    }
}
