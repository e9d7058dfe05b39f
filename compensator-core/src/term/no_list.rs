//! Replaces `list` without the feature `terms`: no terms, no memory and no cost.

use super::{MAX_TERMS, TermKind};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::ParameterValues;
use crate::quantity::Sample;
use crate::refusal::{Bound, ParameterError, refuse};
use crate::text;
use core::marker::PhantomData;
use heapless::Vec;

/// Empty list of terms.
#[derive(Clone, Debug)]
pub(crate) struct Terms<T>(PhantomData<T>);

/// Empty memory.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Memory<T>(PhantomData<T>);

impl<T: Real> Memory<T> {
    #[inline(always)]
    pub(crate) fn take_power(&mut self, _: T) {}

    pub(crate) fn clear(&mut self) {}

    pub(crate) fn set_heat(&mut self, _: T) {}
}

impl<T: Real> Terms<T> {
    pub(crate) fn build(
        _: &Vec<TermKind, MAX_TERMS>,
        _: &ParameterValues<T::Setting>,
        _: T::Setting,
    ) -> Self {
        Self(PhantomData)
    }

    pub(crate) fn rescale_period(&mut self, _: &Self, _: T) {}

    pub(crate) fn set_gains(&mut self, _: &Self, _: &[T; MAX_TERMS]) {}

    #[inline(always)]
    pub(crate) fn act(&self, _: &Sample<T>, _: &mut Memory<T>, _: &mut Effects<T>) {}

    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        true
    }
}

/// Returns an error for the first term in the list, because no terms are compiled.
#[allow(clippy::extra_unused_type_parameters)]
pub(crate) fn check<T: Real, S: Real<Setting = S>>(
    kinds: &Vec<TermKind, MAX_TERMS>,
    _: &ParameterValues<S>,
    _: &Envelope,
    _: S,
) -> Result<(), ParameterError> {
    match kinds.first() {
        None => Ok(()),
        Some(kind) => {
            refuse(kind.text(), 1.0, Bound::AtMost(0.0), text!("built without the feature `terms`"))
        }
    }
}
