//! Rate of the side load: a changing side load deflects the bristles.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView, Spacing};
use crate::extended::Extended;
use crate::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "radial_force_n";

/// Rate of the side load as a cause; see the module documentation.
pub struct RadialForceRate;

impl Cause for RadialForceRate {
    fn name(&self) -> &'static str {
        "radial-force-rate"
    }

    fn meaning(&self) -> &'static str {
        "a changing side load bends the bristles"
    }

    fn effect(&self) -> &'static str {
        "a changing side load bends the bristles."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::RadialForceRate)
    }

    fn acts_on(&self) -> &'static [Id] {
        &[Id::BristleStiffness, Id::BristleDamping]
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if !context.spec.law.has_bristles() || !context.log.varies(COLUMN) {
            return Vec::new();
        }
        let by = Exact {
            kind: TermKind::RadialForceRate,
            settings: Vec::new(),
            derivative: Some(Id::RadialForceRate),
        };
        let by = vec![Regressor::Exact(by)];
        vec![
            Candidate::new(TermKind::RadialForceRate, &[COLUMN], by)
                .starting_at(&[(Id::RadialForceRate, InitialGuess::Times(0, 1.0))]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "The changing side load",
            PlaneAxis::ChangePerTravel(COLUMN.into()),
            ResidualView::Plain,
            "A side load that changes while the joint hardly moves bends the bristles: the torque is off in \
             proportion, in both directions alike.",
        )
        .trimmed()
        .spaced(Spacing::NarrowAtZero)
        .into()
    }
}
