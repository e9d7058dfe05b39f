//! How far load, pressure and terms can take a law's quantities within the declared envelope.
//!
//! What a law brings along and what each term says of itself ([`crate::term::bounds`]), put together.

use super::{ParameterId, Parameters};
use crate::number::Real;
use crate::term::TermKind;
use crate::term::bounds::Bounds;
use ParameterId as Id;

impl<S: Real> Parameters<S> {
    fn value(&self, id: Id) -> f64 {
        self.get(id).value()
    }

    /// The bounds of the law's own load and of every term of the model.
    #[inline(never)]
    pub(super) fn bounds(&self) -> Bounds {
        let acts = |kind: &&TermKind| {
            self.terms.contains(kind) || self.law.has_seal_load() && self.law.includes(**kind)
        };
        let mut bounds = Bounds::NONE;
        for kind in TermKind::ALL.iter().filter(acts) {
            kind.widen(&self.values, &self.envelope, &mut bounds);
        }
        bounds
    }

    /// The lowest level the step can divide by, Nm.
    pub(super) fn smallest_level(&self, bounds: &Bounds) -> f64 {
        let mut coulomb = self.value(Id::CoulombTorque);
        if self.law.parameters().contains(&Id::CoulombTorqueNegative) {
            coulomb = coulomb.min(self.value(Id::CoulombTorqueNegative));
        }
        let corners = bounds.corners(&self.envelope);
        let added = corners.iter().map(|added| added.coulomb).fold(0.0, f64::min);
        (coulomb + added) * bounds.level_factor.0
    }

    /// The highest static level, Nm: no bristle torque is larger.
    pub(super) fn largest_level(&self, bounds: &Bounds) -> f64 {
        let sides = [
            Id::CoulombTorque,
            Id::StaticTorque,
            Id::CoulombTorqueNegative,
            Id::StaticTorqueNegative,
        ];
        let own = self.law.parameters();
        let base = sides.iter().filter(|id| own.contains(id)).map(|id| self.value(*id));
        let corners = bounds.corners(&self.envelope);
        let added = corners.iter().map(|added| added.coulomb + added.excess.max(0.0));
        let sum = base.fold(0.0, f64::max) + added.fold(0.0, f64::max) + bounds.static_level;
        sum * bounds.level_factor.1
    }

    /// The largest magnitude of the viscous coefficient, Nm s/rad.
    pub(super) fn largest_viscous(&self, bounds: &Bounds) -> f64 {
        self.value(Id::ViscousFriction).abs() * bounds.viscous_factor
    }
}
