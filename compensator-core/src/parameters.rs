//! The parameters of a model: values, validation and build.
//!
//! Parameters have three forms:
//! - *Written*: SI values by name, in a TOML file on the host or in a record in flash ([`crate::record`]).
//! - *Validated*: [`Parameters`] for which [`Parameters::validate`] returned `Ok`.
//! - *Built* for a sample period: [`crate::model::FrictionModel`]. It is immutable and replaced as a whole.
//!
//! The state of a model is separate from all of them.
//!
//! [`crate::parameter`] lists all parameters with unit, range and default. Files, CAN objects, fits and
//! documentation use this list. [`LawKind`] and [`TermKind`] determine which parameters are active.

mod build;
mod compensated;
mod extremes;
mod validate;

pub use crate::envelope::Envelope;
pub use crate::law::{Choices, LawKind};
pub use crate::parameter as table;
pub use crate::parameter::{ParameterId, ParameterInfo};
pub use crate::refusal::{
    Bound, FieldRange, ParameterError, ShortNumber, Text, check_ranges, reason, refuse,
};

use crate::number::Real;
use crate::parameter::ParameterValues;
use crate::term::{MAX_TERMS, TermKind};
use heapless::Vec;

/// The terms of a model, in the order in which they act.
pub type TermList = Vec<TermKind, MAX_TERMS>;

/// A law, its terms and their parameter values.
///
/// `S` is `f32` in a driver, `f64` on the host, and a dual number if derivatives are needed.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters<S> {
    /// The law.
    pub law: LawKind,
    /// The terms, each kind at most once.
    pub terms: TermList,
    /// Operating envelope of the model.
    pub envelope: Envelope,
    /// Options of the law.
    pub choices: Choices,
    values: ParameterValues<S>,
}

impl<S: Real> Parameters<S> {
    /// Creates a law without terms, with every parameter at its default.
    pub fn new(law: LawKind) -> Self {
        Self {
            law,
            terms: TermList::new(),
            envelope: Envelope::default(),
            choices: Choices::default(),
            values: ParameterValues::new(),
        }
    }

    /// Adds a term. Returns false if the list is full.
    ///
    /// A term that is already in the list is not added again. Neither is a term that the law includes, such as
    /// side load in the improved law or the offset in the atan law. The term is appended to the list, or
    /// inserted at its start if the other terms depend on it ([`TermKind::is_applied_first`]).
    pub fn add_term(&mut self, kind: TermKind) -> bool {
        if self.terms.contains(&kind) || self.law.includes(kind) {
            return true;
        }
        if self.terms.is_full() {
            return false;
        }
        let mut last = kind;
        if kind.is_applied_first() {
            // Shifted one by one, because `rotate_right` would add `memmove` to the image of a driver.
            for term in &mut self.terms {
                core::mem::swap(term, &mut last);
            }
        }
        self.terms.push(last).is_ok()
    }

    /// Returns the value of a parameter, in its unit.
    #[inline]
    pub fn get(&self, id: ParameterId) -> S {
        self.values.get(id)
    }

    /// Sets a parameter, in its unit. [`Parameters::validate`] checks the value.
    pub fn set(&mut self, id: ParameterId, value: S) {
        self.values.set(id, value);
    }

    /// As [`Parameters::set`], for use in an expression.
    #[must_use]
    pub fn with(mut self, id: ParameterId, value: S) -> Self {
        self.set(id, value);
        self
    }

    /// Returns the parameters of the law and of the terms, ordered by number, each once.
    pub fn active(&self) -> impl Iterator<Item = ParameterId> + '_ {
        ParameterId::ALL.iter().copied().filter(|id| {
            self.law.parameters().contains(id)
                || self.terms.iter().any(|term| term.parameters().contains(id))
        })
    }

    /// Converts the parameters to another number type.
    pub fn convert<R: Real>(&self) -> Parameters<R> {
        Parameters {
            law: self.law,
            terms: self.terms.clone(),
            envelope: self.envelope,
            choices: self.choices,
            values: self.values.convert(),
        }
    }
}
