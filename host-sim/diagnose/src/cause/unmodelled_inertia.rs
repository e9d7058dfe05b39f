//! Unmodelled inertia: a torque proportional to acceleration, from mass outside the known rigid
//! body.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

/// Unmodelled inertia as a cause; see the module documentation.
pub struct UnmodelledInertia;

impl Cause for UnmodelledInertia {
    fn name(&self) -> &'static str {
        "unmodelled-inertia"
    }

    fn meaning(&self) -> &'static str {
        "a torque proportional to acceleration is left; this is the rigid body, not friction"
    }

    fn effect(&self) -> &'static str {
        "inertia times acceleration."
    }

    fn remedy(&self) -> Remedy {
        Remedy::RigidBody(Some(TermKind::UnmodelledInertia))
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        let columns = [context.log.velocity_name()];
        let by = vec![row(|r| r.sample.acceleration_rad_s2)];
        vec![
            Candidate::new(TermKind::UnmodelledInertia, &columns, by)
                .starting_at(&[(Id::Inertia, InitialGuess::Times(0, 1.0))]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Torque and acceleration",
            PlaneAxis::Acceleration,
            ResidualView::Plain,
            "A torque in proportion to acceleration is a rigid body, not friction.",
        )
        .trimmed()
        .into()
    }
}
