//! A torque in proportion to acceleration: mass that is not in the known rigid body.

use super::definition::{Cause, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, row};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::Extended;
use compensator_core::{ParameterId as Id, TermKind};

/// See the module.
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
        Remedy::RigidBody(TermKind::UnmodelledInertia)
    }

    fn is_imitated(&self) -> bool {
        true
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        let columns = [beside.log.velocity_name()];
        let by = vec![row(|r| r.sample.acceleration_rad_s2)];
        vec![
            Candidate::new(TermKind::UnmodelledInertia, &columns, by)
                .starting_at(&[(Id::Inertia, InitialGuess::Times(0, 1.0))]),
        ]
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Torque and acceleration",
            Over::Acceleration,
            Seen::Plain,
            "A torque in proportion to acceleration is a rigid body, not friction.",
        )
        .trimmed()
        .into()
    }
}
