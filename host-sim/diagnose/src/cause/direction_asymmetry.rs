//! Direction asymmetry: friction levels and viscous part differ between the two directions.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, ResidualView};
use crate::extended::{Extended, Size};
use compensator_core::{ParameterId as Id, TermKind};
use joint_log::number::figure;

/// Direction asymmetry as a cause; see the module documentation.
pub struct DirectionAsymmetry;

impl Cause for DirectionAsymmetry {
    fn name(&self) -> &'static str {
        "direction-asymmetry"
    }

    fn meaning(&self) -> &'static str {
        "friction is larger in one direction than in the other"
    }

    fn effect(&self) -> &'static str {
        "levels and viscous part differ by direction."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::DirectionAsymmetry)
    }

    fn acts_on(&self) -> &'static [Id] {
        LEVELS
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        let sign = |velocity: f64| if velocity == 0.0 { 0.0 } else { velocity.signum() };
        let by = vec![
            row(move |r| sign(r.sample.velocity_rad_s) * r.level),
            row(move |r| sign(r.sample.velocity_rad_s) * r.viscous),
        ];
        let columns = [context.log.velocity_name()];
        vec![Candidate::new(TermKind::DirectionAsymmetry, &columns, by).starting_at(&[
            (Id::CoulombAsymmetry, InitialGuess::Times(0, 1.0)),
            (Id::ViscousAsymmetry, InitialGuess::Times(1, 1.0)),
        ])]
    }

    /// Beside a torque offset, the log may not determine the difference of the levels, and a drive's losses may differ in the
    /// viscous part alone. The size is that of the part that is larger in its standard errors.
    fn size(&self, extended: &Extended) -> Size {
        extended.size(larger(extended))
    }

    fn in_words(&self, size: &Size, extended: &Extended) -> String {
        let (own, other, parts) = match larger(extended) {
            Id::ViscousAsymmetry => ("viscous part", Id::CoulombAsymmetry, "level"),
            _ => ("level", Id::ViscousAsymmetry, "viscous part"),
        };
        format!(
            "{}: {} of the {own}, {} of the {parts}",
            self.meaning(),
            size.in_words(),
            figure(extended.value(other))
        )
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Some(Evidence::ByDirection {
            view: ResidualView::Along,
            description: "If friction is larger in one direction, the two lines diverge; with the extension they coincide."
                .into(),
        })
    }
}

/// Returns the part of the friction whose asymmetry is the larger one in standard errors.
fn larger(extended: &Extended) -> Id {
    let in_errors = |id: Id| {
        let error = extended.estimate(id).and_then(|e| e.std_error);
        error.map_or(0.0, |error| extended.value(id).abs() / error.max(f64::MIN_POSITIVE))
    };
    let is_viscous = in_errors(Id::ViscousAsymmetry) > in_errors(Id::CoulombAsymmetry);
    if is_viscous { Id::ViscousAsymmetry } else { Id::CoulombAsymmetry }
}
