//! Load torque: the transmitted torque presses the gear, so the friction levels rise with its
//! magnitude.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::Extended;
use crate::train_test::TrainTest;
use compensator_core::{ParameterId as Id, TermKind};

const COLUMN: &str = "load_torque_nm";

/// Load torque as a cause; see the module documentation.
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

    fn least_size(&self, _log: &TrainTest) -> Option<f64> {
        Some(0.0)
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if !context.log.varies(COLUMN) {
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
            PlaneAxis::SizeOf(COLUMN.into()),
            ResidualView::Along,
            "Where the load presses the gear, what the base model misses rises with its size, whatever its sign.",
        )
        .into()
    }
}
