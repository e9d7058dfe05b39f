//! The transmitted torque presses the gear: the levels rise with its size.

use super::definition::{Cause, LEVELS, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, row};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "load_torque_nm";

/// See the module.
pub struct LoadTorqueCoulomb;

impl Cause for LoadTorqueCoulomb {
    fn name(&self) -> &'static str {
        "load-torque-coulomb"
    }

    fn meaning(&self) -> &'static str {
        "the transmitted torque loads the drive, so friction grows with it"
    }

    fn effect(&self) -> &'static str {
        "levels rise with the transmitted torque."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::LoadTorqueCoulomb)
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
        let by = vec![row(|r| r.added * r.sample.load_torque_nm.abs())];
        vec![
            Candidate::new(TermKind::LoadTorqueCoulomb, &[COLUMN], by)
                .starting_at(&[(Id::LoadCoulomb, InitialGuess::Times(0, 1.0))]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Friction and transmitted torque",
            Over::SizeOf(COLUMN.into()),
            Seen::Along,
            "Where the load presses the gear, what the base model misses rises with its size, whatever its sign.",
        )
        .into()
    }
}
