//! The Stribeck curve falls with another exponent than 2.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView, Spacing};
use crate::extended::Extended;
use crate::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};

/// See the module.
pub struct StribeckShape;

impl Cause for StribeckShape {
    fn name(&self) -> &'static str {
        "stribeck-shape"
    }

    fn meaning(&self) -> &'static str {
        "the Stribeck curve falls with another exponent than 2"
    }

    fn effect(&self) -> &'static str {
        "another exponent than 2 in g(v)."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::StribeckShape)
    }

    fn acts_on(&self) -> &'static [Id] {
        &[Id::StribeckVelocity]
    }

    /// The curve of the laws has the exponent 2.
    fn no_effect_size(&self) -> f64 {
        2.0
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if !context.spec.law.has_stribeck_curve() {
            return Vec::new();
        }
        let columns = [context.log.velocity_name()];
        // An exponent of 2 is the table's own curve, without a derivative: a hair beside it there is one.
        [(1.0, 1.0, None), (3.0, 2.001, Some(Id::StribeckExponent))]
            .map(|(start, setting, derivative)| {
                let settings = vec![(Id::StribeckExponent, setting)];
                let by = Exact { kind: TermKind::StribeckShape, settings, derivative };
                let by = vec![Regressor::Exact(by)];
                Candidate::new(TermKind::StribeckShape, &columns, by)
                    .starting_at(&[(Id::StribeckExponent, InitialGuess::At(start))])
            })
            .into()
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Friction and speed, slow to fast",
            PlaneAxis::Speed,
            ResidualView::Along,
            "A Stribeck curve of the wrong exponent is above the log at some slow speeds and below it at others.",
        )
        .spaced(Spacing::Logarithmic)
        .into()
    }
}
