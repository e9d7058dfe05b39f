//! Pressure: it preloads the seal, so the friction levels rise with the pressure difference.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "pressure_diff_pa";

/// Pressure as a cause; see the module documentation.
pub struct PressureCoulomb;

impl Cause for PressureCoulomb {
    fn name(&self) -> &'static str {
        "pressure-coulomb"
    }

    fn meaning(&self) -> &'static str {
        "pressure preloads the seal, so friction grows with it"
    }

    fn meaning_of(&self, size: f64) -> &'static str {
        if size < 0.0 { "friction falls as the pressure rises" } else { self.meaning() }
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

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if !context.log.varies(COLUMN) {
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
            PlaneAxis::Column(COLUMN.into()),
            ResidualView::Along,
            "Where pressure presses the seal, what the base model misses rises with it, in both directions alike.",
        )
        .into()
    }
}
