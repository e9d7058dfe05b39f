//! Drag of the water grows with the square of the speed.

use super::definition::{Cause, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, Row, row};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

/// See the module.
pub struct QuadraticDrag;

impl Cause for QuadraticDrag {
    fn name(&self) -> &'static str {
        "quadratic-drag"
    }

    fn meaning(&self) -> &'static str {
        "drag grows with the square of the speed"
    }

    fn effect(&self) -> &'static str {
        "c v |v|, as of water."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::QuadraticDrag)
    }

    fn acts_on(&self) -> &'static [Id] {
        &[Id::ViscousFriction]
    }

    fn is_imitated(&self) -> bool {
        true
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        if beside.spec.law.parameters().contains(&Id::QuadraticFriction) {
            return Vec::new();
        }
        let drag = |r: &Row| r.sample.velocity_rad_s * r.sample.velocity_rad_s.abs();
        let columns = [beside.log.velocity_name()];
        vec![
            Candidate::new(TermKind::QuadraticDrag, &columns, vec![row(drag)])
                .starting_at(&[(Id::QuadraticDrag, InitialGuess::Times(0, 1.0))]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Friction and speed",
            Over::Speed,
            Seen::Along,
            "Drag of water grows with the square of the speed; what a base model without it misses bends upwards.",
        )
        .into()
    }
}
