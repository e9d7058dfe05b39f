//! LuGre under a network's factors: the law `lugre-lstm` (the damper paper, eq. 4 and 12-13).

use super::Factors;
use crate::law::{Law, LugreAsymmetric};
use crate::model::Model;
use crate::number::Real;

/// A `lugre-asymmetric`, built for a sample period, that takes factors; its state is the held torque, Nm.
#[derive(Clone, Copy, Debug)]
pub struct AugmentedLugre<T>(pub LugreAsymmetric<T>);

impl<T: Real> AugmentedLugre<T> {
    /// The law of a model; `None` if it is another than `lugre-asymmetric`, or has terms, which would have to act
    /// beside the factors.
    pub fn of(model: &Model<T>) -> Option<Self> {
        match model.law() {
            Law::LugreAsymmetric(law) if model.is_plain() => Some(Self(*law)),
            _ => None,
        }
    }

    /// Advances the held torque (Nm) by one sample under these factors and returns the friction torque, Nm.
    /// Defined for every bit pattern of `velocity_rad_s`.
    #[inline]
    pub fn step(&self, held_nm: &mut T, velocity_rad_s: T, factors: &Factors<T>) -> T {
        self.0.step_under(held_nm, velocity_rad_s, factors)
    }

    /// The largest magnitude of the held torque under factors of which the static one is at most `most`, Nm.
    pub fn largest_held_nm(&self, most: T) -> T {
        self.0.positive.static_level.at_least(self.0.static_level_negative) * most
    }
}
