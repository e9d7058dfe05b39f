//! Extreme values of a law's quantities under load, pressure and terms, within the declared envelope.
//!
//! They combine the law's own values with the bounds that each term declares ([`crate::term::bounds`]).

use super::{ParameterId, Parameters};
use crate::number::Real;
use crate::term::TermKind;
use crate::term::bounds::Bounds;
use ParameterId as Id;

impl<S: Real> Parameters<S> {
    fn value(&self, id: Id) -> f32 {
        self.get(id).single()
    }

    /// Returns the combined bounds of the law's own load and of all terms of the model.
    #[inline(never)]
    pub(super) fn bounds(&self) -> Bounds {
        let is_active = |kind: &&TermKind| {
            self.terms.contains(kind) || self.law.has_seal_load() && self.law.includes(**kind)
        };
        let mut bounds = Bounds::NONE;
        for kind in TermKind::ALL.iter().filter(is_active) {
            kind.widen(&self.values, &self.envelope, &mut bounds);
        }
        bounds
    }

    /// Returns the smallest Coulomb level, Nm. It is the smallest possible divisor of a step.
    pub(super) fn smallest_level(&self, bounds: &Bounds) -> f32 {
        let mut coulomb = self.value(Id::CoulombTorque);
        if self.law.parameters().contains(&Id::CoulombTorqueNegative) {
            coulomb = coulomb.min(self.value(Id::CoulombTorqueNegative));
        }
        let corners = bounds.corners(&self.envelope);
        let added = corners.iter().map(|added| added.coulomb).fold(0.0, f32::min);
        (coulomb + added) * bounds.least_level_factor
    }

    /// Returns the largest static level, Nm. It limits the bristle torque.
    pub(super) fn largest_level(&self, bounds: &Bounds) -> f32 {
        let sides = [
            Id::CoulombTorque,
            Id::StaticTorque,
            Id::CoulombTorqueNegative,
            Id::StaticTorqueNegative,
        ];
        let law_parameters = self.law.parameters();
        let base = sides.iter().filter(|id| law_parameters.contains(id)).map(|id| self.value(*id));
        let corners = bounds.corners(&self.envelope);
        let added = corners.iter().map(|added| added.coulomb + added.excess.max(0.0));
        let sum = base.fold(0.0, f32::max) + added.fold(0.0, f32::max) + bounds.static_level;
        sum * bounds.largest_level_factor
    }

    /// Returns the largest magnitude of the viscous coefficient, Nm s/rad.
    pub(super) fn largest_viscous(&self, bounds: &Bounds) -> f32 {
        self.value(Id::ViscousFriction).abs() * bounds.viscous_factor
    }
}
