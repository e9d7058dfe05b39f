//! Replaces `covariates` in builds without the feature `terms`: the same interface, no data and no cost.

use super::BuiltParameters;
use super::guards::SealWeights;
use crate::envelope::Envelope;
use crate::flags::Flags;
use crate::model::FrictionModel;
use crate::number::Real;
use crate::quantity::{Inputs, Sample};
use core::marker::PhantomData;

/// An empty set of covariates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Covariates<T>(PhantomData<T>);

impl<T: Real> Covariates<T> {
    pub(super) fn unmeasured(_: &BuiltParameters<T>, _: &Envelope, _: f32) -> Self {
        Self(PhantomData)
    }

    #[inline(always)]
    pub(super) fn update(
        &mut self,
        _: &Inputs<T>,
        _: &FrictionModel<T>,
        _: &BuiltParameters<T>,
        _: SealWeights<T>,
        _: &mut Sample<T>,
        _: &mut Flags,
    ) {
    }
}
