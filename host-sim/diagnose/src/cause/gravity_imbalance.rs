//! Gravity imbalance: an imbalance adds a torque that depends on the angle, independent of the
//! direction.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::{Extended, Size};
use compensator_core::{ParameterId as Id, TermKind};
use joint_log::JointKind;

/// Gravity imbalance as a cause; see the module documentation.
pub struct GravityImbalance;

impl Cause for GravityImbalance {
    fn name(&self) -> &'static str {
        "gravity-imbalance"
    }

    fn meaning(&self) -> &'static str {
        "an imbalance adds a torque that depends on the angle, in both directions alike"
    }

    fn effect(&self) -> &'static str {
        "sine and cosine of the position, in both directions alike."
    }

    fn remedy(&self) -> Remedy {
        Remedy::RigidBody(Some(TermKind::GravityImbalance))
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        let name = context.log.position_name();
        // A ripple whose phase differs between runs is not caused by gravity.
        let no_zero = context.log.aligned_order.is_some();
        if no_zero || !context.log.varies(name) || context.log.train.joint != JointKind::Revolute {
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
            PlaneAxis::Turn,
            ResidualView::Plain,
            "An imbalance is one wave per turn, in both directions alike.",
        )
        .into()
    }
}
