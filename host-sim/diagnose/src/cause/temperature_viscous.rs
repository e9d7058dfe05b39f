//! Temperature of the film: the film thins as it warms, so the viscous part falls with temperature.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "temperature_c";

/// Temperature of the film as a cause; see the module documentation.
pub struct TemperatureViscous;

impl Cause for TemperatureViscous {
    fn name(&self) -> &'static str {
        "temperature-viscous"
    }

    fn meaning(&self) -> &'static str {
        "the viscous part falls as the film warms"
    }

    fn meaning_of(&self, size: f64) -> &'static str {
        if size < 0.0 { "the viscous part rises with the temperature" } else { self.meaning() }
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

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if !context.log.varies(COLUMN) {
            return Vec::new();
        }
        // If the friction level also depends on temperature, both terms share its reference
        // temperature.
        let mean = if context.has(TermKind::TemperatureCoulomb) {
            context.at.parameters.get(Id::TemperatureReference)
        } else {
            context.log.mean_temperature_c()
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
            PlaneAxis::Column(COLUMN.into()),
            ResidualView::PerVelocity,
            "Residual over velocity, each row counting by the square of its speed. Where the film thins as \
             it warms, the coefficient that is missed falls with temperature.",
        )
        .into()
    }
}
