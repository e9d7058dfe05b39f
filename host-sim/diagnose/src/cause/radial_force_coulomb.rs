//! Side load: it presses the seal, so the friction levels rise with it.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "radial_force_n";

/// Side load as a cause; see the module documentation.
pub struct RadialForceCoulomb;

impl Cause for RadialForceCoulomb {
    fn name(&self) -> &'static str {
        "radial-force-coulomb"
    }

    fn meaning(&self) -> &'static str {
        "the side load presses the seal, so friction grows with it"
    }

    fn meaning_of(&self, size: f64) -> &'static str {
        if size < 0.0 { "friction falls as the side load rises" } else { self.meaning() }
    }

    fn effect(&self) -> &'static str {
        "levels rise with the side load."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::RadialForceCoulomb)
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
        let by = vec![row(|r| r.added * r.sample.radial_force_n)];
        vec![
            Candidate::new(TermKind::RadialForceCoulomb, &[COLUMN], by)
                .starting_at(&[(Id::RadialForceCoulomb, InitialGuess::Times(0, 1.0))])
                .keeping(&[Id::RadialForceStaticExcess]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Friction and side load",
            PlaneAxis::Column(COLUMN.into()),
            ResidualView::Along,
            "Where side load presses the seal, what the base model misses rises with it, in both directions alike.",
        )
        .into()
    }
}
