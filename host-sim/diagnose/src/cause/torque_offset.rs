//! Torque offset: the torque reading has a constant zero error.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, ResidualView};
use crate::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

/// Torque offset as a cause; see the module documentation.
pub struct TorqueOffset;

impl Cause for TorqueOffset {
    fn name(&self) -> &'static str {
        "torque-offset"
    }

    fn meaning(&self) -> &'static str {
        "the torque reading has a zero error; this is calibration, not friction"
    }

    fn effect(&self) -> &'static str {
        "a constant."
    }

    fn remedy(&self) -> Remedy {
        Remedy::CorrectColumn(Some(TermKind::TorqueOffset))
    }

    fn candidates(&self, _: &FitContext) -> Vec<Candidate> {
        vec![
            Candidate::new(TermKind::TorqueOffset, &[], vec![row(|_| 1.0)])
                .starting_at(&[(Id::TorqueOffset, InitialGuess::Times(0, 1.0))]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Some(Evidence::ByDirection {
            view: ResidualView::Plain,
            description: "A zero error of the reading lifts both directions alike, at every speed."
                .into(),
        })
    }
}
