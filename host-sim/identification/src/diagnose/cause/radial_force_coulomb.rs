//! Side load presses the seal: the levels rise with it.

use super::definition::{Cause, LEVELS, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, row};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "radial_force_n";

/// See the module.
pub struct RadialForceCoulomb;

impl Cause for RadialForceCoulomb {
    fn name(&self) -> &'static str {
        "radial-force-coulomb"
    }

    fn meaning(&self) -> &'static str {
        "the side load presses the seal, so friction grows with it"
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

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        if !beside.log.varies(COLUMN) {
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
            Over::Column(COLUMN.into()),
            Seen::Along,
            "Where side load presses the seal, what the base model misses rises with it, in both directions alike.",
        )
        .into()
    }
}
