//! An imbalance adds a torque of the angle, whichever way it turns.

use super::definition::{Cause, Remedy};
use crate::data::JointKind;
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, row};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::{Extended, Size};
use compensator_core::{ParameterId as Id, TermKind};

/// See the module.
pub struct GravityImbalance;

impl Cause for GravityImbalance {
    fn name(&self) -> &'static str {
        "gravity-imbalance"
    }

    fn meaning(&self) -> &'static str {
        "an imbalance adds a torque of the angle, whichever way it turns"
    }

    fn effect(&self) -> &'static str {
        "sine and cosine of the position, whichever way it moves."
    }

    fn remedy(&self) -> Remedy {
        Remedy::RigidBody(TermKind::GravityImbalance)
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        let name = beside.log.position_name();
        // With a phase of its own in each run, nothing is heavy.
        let no_zero = beside.log.aligned_order.is_some();
        if no_zero || !beside.log.varies(name) || beside.log.train.joint != JointKind::Revolute {
            return Vec::new();
        }
        let by = vec![row(|r| r.sample.position_rad.sin()), row(|r| r.sample.position_rad.cos())];
        vec![Candidate::new(TermKind::GravityImbalance, &[name], by).starting_at(&[
            (Id::GravitySine, InitialGuess::Times(0, 1.0)),
            (Id::GravityCosine, InitialGuess::Times(1, 1.0)),
        ])]
    }

    fn size(&self, extended: &Extended) -> Size {
        extended.amplitude(Id::GravitySine, Id::GravityCosine)
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "The shaft's angle",
            Over::Turn,
            Seen::Plain,
            "An imbalance is one wave over the turn, whichever way the joint moves.",
        )
        .into()
    }
}
