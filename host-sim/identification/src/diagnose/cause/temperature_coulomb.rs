//! The seal stiffens with cold: the friction levels fall with temperature.

use super::definition::{Cause, LEVELS, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, row};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "temperature_c";

/// See the module.
pub struct TemperatureCoulomb;

impl Cause for TemperatureCoulomb {
    fn name(&self) -> &'static str {
        "temperature-coulomb"
    }

    fn meaning(&self) -> &'static str {
        "the friction level falls as the seal warms"
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

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        if !beside.log.varies(COLUMN) {
            return Vec::new();
        }
        // A film that thins has its reference already, and both terms share it.
        let mean = if beside.has(TermKind::TemperatureViscous) {
            beside.at.parameters.get(Id::TemperatureReference)
        } else {
            beside.log.mean_temperature_c()
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
            Over::Column(COLUMN.into()),
            Seen::Along,
            "Residual along the motion. Where the seal grips harder in the cold, what the base model misses \
             falls with temperature at every speed alike.",
        )
        .into()
    }

    fn next_experiment(&self, _: &[String]) -> Option<String> {
        Some(
            "Repeat slow and fast runs both ways at two temperatures at least 10 K apart, in an order that is not that \
             of time: the level moves at every speed, a film's viscosity with the speed, and run-in with neither."
                .into(),
        )
    }
}
