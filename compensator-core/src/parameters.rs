//! Parameters: what a person writes, what has been validated, what a model is built from.
//!
//! A parameter has three forms and there is a fourth thing that is none of them. *Written*: SI
//! values by name, a TOML file on the host, a record in flash ([`crate::record`]). *Validated*:
//! [`Parameters`] for which [`Parameters::validate`] returned `Ok`. *Built* for a sample period:
//! [`crate::model::Model`], immutable, swapped whole. And the *state*, which belongs to none of them.
//!
//! [`crate::parameter`] is the one list of all parameters, with unit, range and default; files, CAN objects,
//! fits and documentation are driven by it. [`LawKind`] and [`TermKind`] say which of them count.

mod build;
mod extremes;
mod validate;

pub use crate::envelope::Envelope;
pub use crate::law::{Choices, LawKind};
pub use crate::parameter as table;
pub use crate::parameter::{Info, ParameterId};
pub use crate::refusal::{Bound, Digits, ParameterError, check_ranges};
pub use build::WrongPeriod;

use crate::number::Real;
use crate::parameter::Values;
use crate::term::{MAX_TERMS, TermKind};
use heapless::Vec;

/// The terms of a model, in the order they act.
pub type TermList = Vec<TermKind, MAX_TERMS>;

/// A law, its terms and their values. `S` is `f32` for a driver, `f64` on the host, a dual number
/// where derivatives are wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters<S> {
    /// The law.
    pub law: LawKind,
    /// The terms, each kind at most once.
    pub terms: TermList,
    /// What the model may meet.
    pub envelope: Envelope,
    /// Choices about the law.
    pub choices: Choices,
    values: Values<S>,
}

impl<S: Real> Parameters<S> {
    /// A law with every parameter at its default.
    pub fn new(law: LawKind) -> Self {
        Self {
            law,
            terms: TermList::new(),
            envelope: Envelope::default(),
            choices: Choices::default(),
            values: Values::new(),
        }
    }

    /// Switches a term on. `false` if the list is full; a term that is there already stays once.
    /// A term the law has in it already (side load in the improved law, the offset in the atan law) is
    /// not added to it once more. Terms act in the order of the list; one that the others are to see acts first.
    pub fn add_term(&mut self, kind: TermKind) -> bool {
        if self.terms.contains(&kind) || self.law.includes(kind) {
            return true;
        }
        if self.terms.is_full() {
            return false;
        }
        let mut last = kind;
        if kind.acts_first() {
            // Moved on one by one: `rotate_right` brings a `memmove` of 1574 bytes into a driver's image.
            for term in &mut self.terms {
                core::mem::swap(term, &mut last);
            }
        }
        self.terms.push(last).is_ok()
    }

    /// The value of a parameter, in its unit.
    #[inline]
    pub fn get(&self, id: ParameterId) -> S {
        self.values.get(id)
    }

    /// Sets a parameter, in its unit. Nothing is checked until [`Parameters::validate`].
    pub fn set(&mut self, id: ParameterId, value: S) {
        self.values.set(id, value);
    }

    /// As [`Parameters::set`], for building in one expression.
    #[must_use]
    pub fn with(mut self, id: ParameterId, value: S) -> Self {
        self.set(id, value);
        self
    }

    /// The parameters that count: the law's, then each term's, none twice.
    pub fn active(&self) -> impl Iterator<Item = ParameterId> + '_ {
        ParameterId::ALL.iter().copied().filter(|id| {
            self.law.parameters().contains(id)
                || self.terms.iter().any(|term| term.parameters().contains(id))
        })
    }

    /// The same parameters in another number.
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
