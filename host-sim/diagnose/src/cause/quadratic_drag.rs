//! Quadratic drag: the drag of the water grows with the square of the speed.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Row, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::Extended;
use crate::train_test::TrainTest;
use compensator_core::{ParameterId as Id, TermKind};

/// Quadratic drag as a cause; see the module documentation.
pub struct QuadraticDrag;

impl Cause for QuadraticDrag {
    fn name(&self) -> &'static str {
        "quadratic-drag"
    }

    fn meaning(&self) -> &'static str {
        "drag grows with the square of the speed"
    }

    fn effect(&self) -> &'static str {
        "c v |v|, as in water."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::QuadraticDrag)
    }

    fn acts_on(&self) -> &'static [Id] {
        &[Id::ViscousFriction]
    }

    fn least_size(&self, _log: &TrainTest) -> Option<f64> {
        Some(0.0)
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if context.spec.law.parameters().contains(&Id::QuadraticFriction) {
            return Vec::new();
        }
        let drag = |r: &Row| r.sample.velocity_rad_s * r.sample.velocity_rad_s.abs();
        let columns = [context.log.velocity_name()];
        vec![
            Candidate::new(TermKind::QuadraticDrag, &columns, vec![row(drag)])
                .starting_at(&[(Id::QuadraticDrag, InitialGuess::Times(0, 1.0))]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Friction and speed",
            PlaneAxis::Speed,
            ResidualView::Along,
            "Drag of water grows with the square of the speed; what a base model without it misses bends upwards.",
        )
        .into()
    }
}
