//! Contacts age: the longer a joint rests, the higher it breaks away.

use super::definition::{Cause, LEVELS, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, Regressor};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen, Spacing};
use crate::diagnose::extended::Extended;
use crate::diagnose::sensitivities::Exact;
use crate::number::significant;
use compensator_core::{ParameterId as Id, TermKind};

/// See the module.
pub struct DwellTimeStatic;

impl Cause for DwellTimeStatic {
    fn name(&self) -> &'static str {
        "dwell-time-static"
    }

    fn meaning(&self) -> &'static str {
        "the longer the joint rests, the higher it breaks away"
    }

    fn effect(&self) -> &'static str {
        "the static level grows with the time at rest."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::DwellTimeStatic)
    }

    fn acts_on(&self) -> &'static [Id] {
        LEVELS
    }

    fn is_nonlinear(&self) -> bool {
        true
    }

    fn is_imitated(&self) -> bool {
        true
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        if !beside.spec.law.has_bristles() {
            return Vec::new();
        }
        let columns = [beside.log.velocity_name()];
        [0.03, 0.3, 3.0]
            .map(|dwell_time| {
                let settings = vec![(Id::DwellTime, dwell_time)];
                let kind = TermKind::DwellTimeStatic;
                let by = Exact { kind, settings, derivative: Some(Id::DwellGain) };
                Candidate::new(kind, &columns, vec![Regressor::Exact(by)])
                    .starting_at(&[
                        (Id::DwellTime, InitialGuess::At(dwell_time)),
                        (Id::DwellGain, InitialGuess::Times(0, 1.0)),
                    ])
                    .keeping(&[Id::DwellTravel])
            })
            .into()
    }

    fn evidence(&self, _: &[String], extended: &Extended) -> Option<Evidence> {
        let travel = extended.value(Id::DwellTravel);
        Plane::new(
            "Just after breaking away",
            Over::RestBefore(travel),
            Seen::Along,
            format!(
                "Rows within {} {} after the joint has left rest. Where contacts age, the longer it rested the more it resists.",
                significant(travel, 2),
                extended.joint().position_unit()
            ),
        )
        .spaced(Spacing::Logarithmic)
        .into()
    }
}
