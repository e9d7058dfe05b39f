//! Gains on the sizes of a model: its levels, its viscous friction, and each of its terms.
//!
//! A gain of 1 is the tuned set. Gains multiply coefficients, so the step of a model does not know them, and costs nothing
//! more. The same gains multiply the written parameters ([`Parameters::with_gains`]), so that what was learnt can be
//! checked, compared and saved as a set.

use crate::model::FrictionModel;
use crate::number::Real;
use crate::parameter::ParameterId;
use crate::parameters::Parameters;
use crate::term::MAX_TERMS;

/// Number of gains: levels, viscous friction, and one for each possible term.
pub const MAX_GAINS: usize = 2 + MAX_TERMS;

/// Gains on the sizes of a model; 1 is the tuned set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains<T> {
    /// Factor of the Coulomb and static levels, those of the law's own load included.
    pub level: T,
    /// Factor of the viscous coefficients.
    pub viscous: T,
    /// Factors of the terms, in the order of the list.
    pub terms: [T; MAX_TERMS],
}

impl<T: Real> Default for Gains<T> {
    fn default() -> Self {
        Self { level: T::one(), viscous: T::one(), terms: [T::one(); MAX_TERMS] }
    }
}

impl<T: Real> Gains<T> {
    /// Returns the gains in this order: level, viscous, terms.
    pub fn to_array(self) -> [T; MAX_GAINS] {
        let mut gains = [self.level; MAX_GAINS];
        gains[1] = self.viscous;
        gains[2..].copy_from_slice(&self.terms);
        gains
    }

    /// Creates gains from the array of [`Gains::to_array`].
    pub fn from_array(gains: &[T; MAX_GAINS]) -> Self {
        let mut terms = [gains[0]; MAX_TERMS];
        terms.copy_from_slice(&gains[2..]);
        Self { level: gains[0], viscous: gains[1], terms }
    }

    /// Converts the gains to another number type.
    pub fn convert<R: Real>(&self) -> Gains<R> {
        Gains::from_array(&self.to_array().map(|gain| R::from_f64(gain.value())))
    }
}

impl<T: Real> FrictionModel<T> {
    /// Sets the coefficients to those of `source` times the gains. The state of the model does not change.
    ///
    /// `self` must be a copy of `source`, or such a copy after earlier calls. A change of the gains is safe in every
    /// state: see [`crate::adaptation`].
    pub fn set_gains(&mut self, source: &Self, gains: &Gains<T>) {
        self.law.set_gains(&source.law, gains.level, gains.viscous);
        self.terms.set_gains(&source.terms, &gains.terms);
    }
}

impl<S: Real> Parameters<S> {
    /// Returns the parameters with every size times its gain. A model built from them has the coefficients of
    /// [`FrictionModel::set_gains`], up to rounding. In the exponential formula of the lookup table, the gain is on the
    /// rise at the last knot.
    #[must_use]
    pub fn with_gains(&self, gains: &Gains<S>) -> Self {
        let mut scaled = self.clone();
        self.law.levels().for_each(|id| scaled.scale(id, gains.level));
        self.law.viscous().for_each(|id| scaled.scale(id, gains.viscous));
        for (kind, gain) in self.terms.iter().zip(gains.terms) {
            kind.sizes().iter().for_each(|id| scaled.scale(*id, gain));
        }
        scaled
    }
    /// Multiplies a parameter. No parameter is a size of a law and of a term of the same model.
    #[inline(never)]
    fn scale(&mut self, id: ParameterId, gain: S) {
        self.set(id, self.get(id) * gain);
    }
}
