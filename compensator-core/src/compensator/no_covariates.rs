//! What stands in for the covariates of terms where there are none: nothing, at no cost.

use super::{Built, SealTrust};
use crate::envelope::Envelope;
use crate::flags::Flags;
use crate::model::Model;
use crate::number::Real;
use crate::quantity::{Inputs, Sample};
use core::marker::PhantomData;

/// No covariates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Covariates<T>(PhantomData<T>);

impl<T: Real> Covariates<T> {
    pub(super) fn never(_: &Built<T>, _: &Envelope, _: f32) -> Self {
        Self(PhantomData)
    }

    #[inline(always)]
    pub(super) fn take(
        &mut self,
        _: &Inputs<T>,
        _: &Model<T>,
        _: &Built<T>,
        _: SealTrust<T>,
        _: &mut Sample<T>,
        _: &mut Flags,
    ) {
    }
}
