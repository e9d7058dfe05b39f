//! The film thins as it warms: the viscous part falls with temperature.

use super::definition::{Cause, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, row};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "temperature_c";

/// See the module.
pub struct TemperatureViscous;

impl Cause for TemperatureViscous {
    fn name(&self) -> &'static str {
        "temperature-viscous"
    }

    fn meaning(&self) -> &'static str {
        "the viscous part falls as the film warms"
    }

    fn effect(&self) -> &'static str {
        "the viscous coefficient falls as the film warms."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::TemperatureViscous)
    }

    fn acts_on(&self) -> &'static [Id] {
        &[Id::ViscousFriction]
    }

    fn covariate(&self) -> Option<&'static str> {
        Some(COLUMN)
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        if !beside.log.varies(COLUMN) {
            return Vec::new();
        }
        // The level's fall has its reference already, and both terms share it.
        let mean = if beside.has(TermKind::TemperatureCoulomb) {
            beside.at.parameters.get(Id::TemperatureReference)
        } else {
            beside.log.mean_temperature_c()
        };
        let by = vec![row(move |r| -r.viscous * (r.sample.temperature_c - mean))];
        vec![
            Candidate::new(TermKind::TemperatureViscous, &[COLUMN], by)
                .starting_at(&[
                    (Id::TemperatureViscosity, InitialGuess::Times(0, 1.0)),
                    (Id::TemperatureReference, InitialGuess::At(mean)),
                ])
                .keeping(&[Id::TemperatureReference]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Viscous part and temperature",
            Over::Column(COLUMN.into()),
            Seen::PerVelocity,
            "Residual over velocity, each row counting by the square of its speed. Where the film thins as \
             it warms, the coefficient that is missed falls with temperature.",
        )
        .into()
    }
}
