//! Replaces `lstm_network` without the feature `network`: types without values, so that no code of a network remains.

use super::Factors;
use crate::number::Real;
use crate::parameters::Parameters;
use crate::quantity::Inputs;
use crate::refusal::ParameterError;
use core::convert::Infallible;
use core::marker::PhantomData;

/// A network for a joint driver: there is none.
#[derive(Clone, Debug, PartialEq)]
pub enum JointNetwork {}

impl JointNetwork {
    /// Checks that a driver can run the network.
    ///
    /// # Errors
    /// None: there is no network.
    pub fn validate(&self) -> Result<(), ParameterError> {
        match *self {}
    }

    /// Checks that the factors of a network can apply to a model.
    ///
    /// # Errors
    /// None: there is no network.
    pub fn validate_with<T: Real>(_: &Parameters<T>) -> Result<(), ParameterError> {
        Ok(())
    }
}

/// State of a network between evaluations.
#[derive(Clone, Copy, Debug)]
pub struct NetworkState<T> {
    /// Factors of the last evaluation.
    pub factors: Factors<T>,
    /// Share of the network in the factors, from 0 (constant parameters) to 1.
    pub share: T,
    /// True if the last inputs were outside the ranges.
    pub is_outside: bool,
    /// Number of evaluations outside the ranges; saturates.
    pub outside_count: u32,
}

/// A running network: there is none.
#[derive(Clone, Debug)]
pub struct FactorSupplier<T>(Infallible, PhantomData<T>);

#[expect(missing_docs, reason = "as in `lstm_network`; no caller has a value")]
impl<T: Real<Setting = f32>> FactorSupplier<T> {
    pub fn build(from: &JointNetwork, _: f32) -> Result<Self, ParameterError> {
        match *from {}
    }
    pub fn every(&self, _: f32) -> Result<u32, ParameterError> {
        match self.0 {}
    }
    pub const fn period_s(&self) -> f32 {
        match self.0 {}
    }
    pub fn evaluate(&mut self, _: &Inputs<T>, _: T) -> Factors<T> {
        match self.0 {}
    }
    pub const fn state(&self) -> &NetworkState<T> {
        match self.0 {}
    }
    pub fn rest(&mut self) {
        match self.0 {}
    }
}
