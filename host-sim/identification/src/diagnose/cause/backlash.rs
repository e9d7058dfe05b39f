//! Play: after a reversal there is travel with little stiffness.

use super::definition::{Cause, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, Regressor};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::Extended;
use crate::diagnose::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};

/// See the module.
pub struct Backlash;

impl Cause for Backlash {
    fn name(&self) -> &'static str {
        "backlash"
    }

    fn meaning(&self) -> &'static str {
        "after a reversal there is travel with little stiffness"
    }

    fn effect(&self) -> &'static str {
        "little stiffness while a play is crossed."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::Backlash)
    }

    fn acts_on(&self) -> &'static [Id] {
        &[Id::BristleStiffness, Id::BristleDamping]
    }

    fn is_nonlinear(&self) -> bool {
        true
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        if !beside.spec.law.has_bristles() {
            return Vec::new();
        }
        let columns = [beside.log.velocity_name()];
        let parameters = &beside.at.parameters;
        let presliding = parameters.get(Id::StaticTorque).max(parameters.get(Id::CoulombTorque))
            / parameters.get(Id::BristleStiffness).max(1e-9);
        [0.5, 2.0, 6.0, 20.0]
            .map(|times| {
                let travel = times * presliding;
                let settings = vec![(Id::BacklashTravel, travel)];
                let by = Exact { kind: TermKind::Backlash, settings, derivative: None };
                let by = vec![Regressor::Exact(by)];
                Candidate::new(TermKind::Backlash, &columns, by)
                    .starting_at(&[(Id::BacklashTravel, InitialGuess::At(travel))])
                    .keeping(&[Id::BacklashStiffnessRatio])
            })
            .into()
    }

    fn evidence(&self, _: &[String], extended: &Extended) -> Option<Evidence> {
        Plane::new(
            "Just after a reversal",
            Over::SinceReversal(8.0 * extended.value(Id::BacklashTravel)),
            Seen::Along,
            "Where there is play, the joint resists less than a bristle model until the play is crossed.",
        )
        .into()
    }
}
