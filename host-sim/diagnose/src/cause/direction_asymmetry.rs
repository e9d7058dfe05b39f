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

    /// Beside a torque offset, the log may not determine the difference of the levels. The size is
    /// then the asymmetry of the viscous part.
    fn size(&self, extended: &Extended) -> Size {
        let level = extended.estimate(Id::CoulombAsymmetry).and_then(|e| e.std_error);
        extended.size(if level.is_some() { Id::CoulombAsymmetry } else { Id::ViscousAsymmetry })
    }

    fn in_words(&self, size: &Size, extended: &Extended) -> String {
        let viscous = extended.value(Id::ViscousAsymmetry);
        format!(
            "{}: {} of the level, {} of the viscous part",
            self.meaning(),
            size.in_words(),
            figure(viscous)
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
