//! A changing side load bends the bristles.

use super::definition::{Cause, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, Regressor};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen, Spacing};
use crate::diagnose::extended::Extended;
use crate::diagnose::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "radial_force_n";

/// See the module.
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

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        if !beside.spec.law.has_bristles() || !beside.log.varies(COLUMN) {
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
            Over::ChangePerTravel(COLUMN.into()),
            Seen::Plain,
            "A side load that changes while the joint hardly moves bends the bristles: the torque is off in \
             proportion, whichever way it moves.",
        )
        .trimmed()
        .spaced(Spacing::NarrowAtZero)
        .into()
    }
}
