//! Temperature of the seal: the seal stiffens in the cold, so the friction levels fall with
//! temperature.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "temperature_c";

/// Temperature of the seal as a cause; see the module documentation.
pub struct TemperatureCoulomb;

impl Cause for TemperatureCoulomb {
    fn name(&self) -> &'static str {
        "temperature-coulomb"
    }

    fn meaning(&self) -> &'static str {
        "the friction level falls as the seal warms"
    }

    fn meaning_of(&self, size: f64) -> &'static str {
        if size < 0.0 { "the friction level rises as the seal warms" } else { self.meaning() }
    }

    fn effect(&self) -> &'static str {
        "levels fall as the seal warms."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::TemperatureCoulomb)
    }

    fn acts_on(&self) -> &'static [Id] {
        LEVELS
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if !context.log.varies(COLUMN) {
            return Vec::new();
        }
        // If the viscous part also depends on temperature, both terms share its reference
        // temperature.
        let mean = if context.has(TermKind::TemperatureViscous) {
            context.at.parameters.get(Id::TemperatureReference)
        } else {
            context.log.mean_temperature_c()
        };
        let by = vec![row(move |r| -r.level * (r.sample.temperature_c - mean))];
        vec![
            Candidate::new(TermKind::TemperatureCoulomb, &[COLUMN], by)
                .starting_at(&[
                    (Id::TemperatureCoulomb, InitialGuess::Times(0, 1.0)),
                    (Id::TemperatureReference, InitialGuess::At(mean)),
                ])
                .keeping(&[Id::TemperatureReference]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Friction level and temperature",
            PlaneAxis::Column(COLUMN.into()),
            ResidualView::Along,
            "Residual along the motion. Where the seal grips harder in the cold, what the base model misses \
             falls with temperature at every speed alike.",
        )
        .into()
    }

    fn next_experiment(&self, _: &[String]) -> Option<String> {
        Some(
            "Repeat slow and fast runs in both directions at two temperatures at least 10 K apart, in random order: temperature \
             changes the level at every speed, the film's viscosity in proportion to the speed, and run-in follows neither."
                .into(),
        )
    }
}
