//! What a compensator takes of a model: friction, the ripple of motor and gear, and gravity.
//!
//! A model of the complete drive torque has more parts. To add them to a torque command does harm, so a compensator leaves them out:
//!
//! - *Inertia* times the measured acceleration is positive feedback of the acceleration.
//! - *Offset*, *gain* on the known load and *delay* describe the log's torque column, not the joint.

use super::Parameters;
use crate::law::LawKind;
use crate::number::Real;
use crate::parameter::ParameterId as Id;
use crate::term::TermKind;

/// Terms that a compensator leaves out, each with the parameter that makes it zero.
const LEFT_OUT: [(TermKind, Id); 4] = [
    (TermKind::UnmodelledInertia, Id::Inertia),
    (TermKind::TorqueOffset, Id::TorqueOffset),
    (TermKind::LoadGain, Id::LoadGain),
    (TermKind::ChannelDelay, Id::ChannelDelay),
];

impl TermKind {
    /// Returns true if a compensator adds the torque of the term.
    pub fn is_compensated(self) -> bool {
        LEFT_OUT.iter().all(|(kind, _)| *kind != self)
    }
}

impl<S: Real> Parameters<S> {
    /// Returns the terms of the model that a compensator leaves out. The offset of the law `atan` counts as a term.
    pub fn left_out(&self) -> impl Iterator<Item = TermKind> + '_ {
        let has = |kind: &TermKind| self.terms.contains(kind) || self.law.includes(*kind);
        LEFT_OUT.iter().map(|(kind, _)| *kind).filter(has)
    }

    /// Returns the model with zero in place of the parts that a compensator leaves out. The list of terms stays, because gains
    /// ([`crate::adaptation`]) refer to their places.
    #[must_use]
    pub fn compensated(&self) -> Self {
        let mut compensated = self.clone();
        for (_, id) in LEFT_OUT {
            compensated.set(id, S::zero());
        }
        compensated
    }

    /// Removes the terms that a compensator leaves out, and sets the offset of the law `atan` to zero.
    pub fn remove_left_out(&mut self) {
        self.terms.retain(|kind| kind.is_compensated());
        if self.law == LawKind::Atan {
            self.set(Id::TorqueOffset, S::zero());
        }
    }
}
