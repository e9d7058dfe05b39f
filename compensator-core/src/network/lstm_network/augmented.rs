//! LuGre with the factors of a network: the law `lugre-lstm` (the damper paper, eq. 4 and 12-13).

use super::Factors;
use crate::law::LugreAsymmetric;
use crate::model::FrictionModel;
use crate::number::Real;

/// The law `lugre-asymmetric` with factors, built for one sample period. Its state is the held torque, Nm.
#[derive(Clone, Copy, Debug)]
pub struct AugmentedLugre<T>(pub(super) LugreAsymmetric<T>);

impl<T: Real> AugmentedLugre<T> {
    /// Returns the law of a model. Returns `None` if the law is not `lugre-asymmetric` or if the model has terms,
    /// because terms and factors cannot be combined.
    pub fn of(model: &FrictionModel<T>) -> Option<Self> {
        model.law_taking_factors().copied().map(Self)
    }

    /// Advances the held torque (Nm) by one sample with these factors and returns the friction torque, Nm.
    /// Every bit pattern of `velocity_rad_s` is valid.
    #[inline]
    pub fn step(&self, held_nm: &mut T, velocity_rad_s: T, factors: &Factors<T>) -> T {
        self.0.step_with_effect(held_nm, velocity_rad_s, factors)
    }

    /// Returns the largest magnitude of the held torque, Nm, for a static factor of at most `most`.
    pub fn largest_held_nm(&self, most: T) -> T {
        self.0.positive.static_level.at_least(self.0.static_level_negative) * most
    }
}
