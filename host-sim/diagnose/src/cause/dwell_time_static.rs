//! Contact ageing: the breakaway torque grows with the time at rest.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView, Spacing};
use crate::extended::Extended;
use crate::sensitivities::Exact;
use crate::train_test::TrainTest;
use compensator_core::{ParameterId as Id, TermKind};
use joint_log::number::significant;

/// Contact ageing as a cause; see the module documentation.
pub struct DwellTimeStatic;

impl Cause for DwellTimeStatic {
    fn name(&self) -> &'static str {
        "dwell-time-static"
    }

    fn meaning(&self) -> &'static str {
        "the breakaway torque grows with the time at rest"
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

    fn least_size(&self, _log: &TrainTest) -> Option<f64> {
        Some(0.0)
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if !context.spec.law.has_bristles() {
            return Vec::new();
        }
        let columns = [context.log.velocity_name()];
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
            PlaneAxis::RestBefore(travel),
            ResidualView::Along,
            format!(
                "Rows within {} {} after the joint has left rest. If contacts age, the resistance grows with the time at rest.",
                significant(travel, 2),
                extended.joint().position_unit()
            ),
        )
        .spaced(Spacing::Logarithmic)
        .into()
    }
}
