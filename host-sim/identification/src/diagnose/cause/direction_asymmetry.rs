//! One direction rubs harder than the other: levels and viscous part differ by direction.

use super::definition::{Cause, LEVELS, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, row};
use crate::diagnose::evidence::{Evidence, Seen};
use crate::diagnose::extended::{Extended, Size};
use crate::number::figure;
use compensator_core::{ParameterId as Id, TermKind};

/// See the module.
pub struct DirectionAsymmetry;

impl Cause for DirectionAsymmetry {
    fn name(&self) -> &'static str {
        "direction-asymmetry"
    }

    fn meaning(&self) -> &'static str {
        "one direction rubs harder than the other"
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

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        let sign = |velocity: f64| if velocity == 0.0 { 0.0 } else { velocity.signum() };
        let by = vec![
            row(move |r| sign(r.sample.velocity_rad_s) * r.level),
            row(move |r| sign(r.sample.velocity_rad_s) * r.viscous),
        ];
        let columns = [beside.log.velocity_name()];
        vec![Candidate::new(TermKind::DirectionAsymmetry, &columns, by).starting_at(&[
            (Id::CoulombAsymmetry, InitialGuess::Times(0, 1.0)),
            (Id::ViscousAsymmetry, InitialGuess::Times(1, 1.0)),
        ])]
    }

    /// Beside an offset, a difference of the levels may not be determined; then the viscous part is.
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
            seen: Seen::Along,
            says: "Where one direction rubs harder, the two lines part; a model that knows it brings them together."
                .into(),
        })
    }
}
