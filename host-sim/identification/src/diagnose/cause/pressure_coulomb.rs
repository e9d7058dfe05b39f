//! Pressure preloads the seal: the levels rise with it.

use super::definition::{Cause, LEVELS, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, row};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "pressure_diff_pa";

/// See the module.
pub struct PressureCoulomb;

impl Cause for PressureCoulomb {
    fn name(&self) -> &'static str {
        "pressure-coulomb"
    }

    fn meaning(&self) -> &'static str {
        "pressure preloads the seal, so friction grows with it"
    }

    fn effect(&self) -> &'static str {
        "levels rise with the pressure difference."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::PressureCoulomb)
    }

    fn acts_on(&self) -> &'static [Id] {
        LEVELS
    }

    fn covariate(&self) -> Option<&'static str> {
        Some(COLUMN)
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        if !beside.log.varies(COLUMN) {
            return Vec::new();
        }
        let by = vec![row(|r| r.added * r.sample.pressure_diff_mpa)];
        vec![
            Candidate::new(TermKind::PressureCoulomb, &[COLUMN], by)
                .starting_at(&[(Id::PressureCoulomb, InitialGuess::Times(0, 1e-6))])
                .keeping(&[Id::PressureStaticExcess]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Friction and pressure",
            Over::Column(COLUMN.into()),
            Seen::Along,
            "Where pressure presses the seal, what the base model misses rises with it, in both directions alike.",
        )
        .into()
    }
}
