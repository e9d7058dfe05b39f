//! What a residual can be blamed on: a file for each cause, and the one list of them.
//!
//! A cause is more than a term of the driver's model. It has a name and a meaning, a remedy (which may be a
//! term, or to correct a column, or nothing), a size in words, and a plane in which it shows. It is found
//! in one of three ways: as [`Cause::candidates`] weighed beside a fitted model and fitted with everything
//! else; [`Cause::in_log`], in the log itself before there is a model; or [`Cause::in_rest`], in what is left
//! when no candidate passed. The search, the sentences and the report ask a cause for what they need and know
//! none by name, so a new one is its file and a row in [`ALL`]. How causes stand to each other (one yields to
//! another, one comes after all others) is a property of the cause, too.

mod backlash;
mod channel_delay;
mod direction_asymmetry;
mod dwell_time_static;
mod gravity_imbalance;
mod load_torque_coulomb;
mod position_ripple;
mod pressure_coulomb;
mod quadratic_drag;
mod radial_force_coulomb;
mod radial_force_rate;
mod stribeck_shape;
mod temperature_viscous;
mod time_drift;
mod torque_offset;
mod unknown;
mod unmodelled_inertia;

use super::candidate::{Beside, Candidate};
use super::evidence::Evidence;
use super::finding::{Extended, Finding, Size, Unexplained};
use super::log::Log;
use compensator_core::{ParameterId, TermKind};
use std::fmt;

/// Every cause, in the order candidates are weighed in.
pub const ALL: &[&dyn Cause] = &[
    &radial_force_coulomb::RadialForceCoulomb,
    &pressure_coulomb::PressureCoulomb,
    &load_torque_coulomb::LoadTorqueCoulomb,
    &temperature_viscous::TemperatureViscous,
    &direction_asymmetry::DirectionAsymmetry,
    &torque_offset::TorqueOffset,
    &quadratic_drag::QuadraticDrag,
    &unmodelled_inertia::UnmodelledInertia,
    &channel_delay::ChannelDelay,
    &stribeck_shape::StribeckShape,
    &radial_force_rate::RadialForceRate,
    &dwell_time_static::DwellTimeStatic,
    &backlash::Backlash,
    &gravity_imbalance::GravityImbalance,
    &position_ripple::PositionRipple,
    &time_drift::TimeDrift,
    &unknown::Unknown,
];

/// The friction levels of a law, in both directions.
const LEVELS: &[ParameterId] = &[
    ParameterId::CoulombTorque,
    ParameterId::StaticTorque,
    ParameterId::CoulombTorqueNegative,
    ParameterId::StaticTorqueNegative,
];

/// What is to be done about a cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// The driver's model takes this term: it is friction.
    Term(TermKind),
    /// A column of the log is to be corrected: it is the sensor or the logger. A term may stand in for the
    /// correction until that is done.
    CorrectColumn(Option<TermKind>),
    /// The rigid body is to be known better: the term is a part of it, not friction.
    RigidBody(TermKind),
}

impl Remedy {
    /// The term that takes the cause into the model, if there is one.
    pub fn term(self) -> Option<TermKind> {
        match self {
            Self::Term(term) | Self::RigidBody(term) => Some(term),
            Self::CorrectColumn(term) => term,
        }
    }
}

/// One thing a residual can be blamed on.
pub trait Cause: Sync {
    /// The name used in files and findings.
    fn name(&self) -> &'static str;

    /// What it means, as the beginning of a sentence.
    fn meaning(&self) -> &'static str;

    /// What it does to a model, for a list of models.
    fn effect(&self) -> &'static str;

    /// What is to be done about it.
    fn remedy(&self) -> Remedy;

    /// The parameters of a law it acts through.
    fn acts_on(&self) -> &'static [ParameterId] {
        &[]
    }

    /// The covariate this cause is the first to be thought of for.
    fn covariate(&self) -> Option<&'static str> {
        None
    }

    /// Whether it has a name for what happens; one that has not comes when no other explains it.
    fn is_named(&self) -> bool {
        true
    }

    /// Whether it enters the model so nonlinearly that its column at size 0 may say too little.
    fn is_nonlinear(&self) -> bool {
        false
    }

    /// Whether it is worth a fit even where it did not pass, if structure is left.
    fn is_underrated(&self) -> bool {
        self.is_nonlinear()
    }

    /// The cause that is named instead where a log of sliding cannot tell the two apart.
    fn yields_to(&self) -> Option<&'static dyn Cause> {
        None
    }

    /// The ways it may explain what a fitted model leaves over; none where its columns are not in the log.
    fn candidates(&self, _beside: &Beside) -> Vec<Candidate> {
        Vec::new()
    }

    /// The finding, where the log shows it without a model.
    fn in_log(&self, _log: &Log) -> Option<Finding> {
        None
    }

    /// The finding, where structure is left that no candidate explains.
    fn in_rest(&self, _rest: &Unexplained) -> Option<Finding> {
        None
    }

    /// How large it is in the extended model: the first parameter of its term, unless it knows better.
    fn size(&self, extended: &Extended) -> Size {
        let first = self.remedy().term().and_then(|term| term.parameters().first());
        first.map_or_else(Size::default, |id| extended.size(*id))
    }

    /// Of a periodic cause, its order with a standard error.
    fn order(&self, _extended: &Extended) -> Option<(f64, f64)> {
        None
    }

    /// Meaning and size in a sentence.
    fn in_words(&self, size: &Size, _extended: &Extended) -> String {
        format!("{}: {}", self.meaning(), size.in_words())
    }

    /// Where it shows.
    fn evidence(&self, _columns: &[String], _extended: &Extended) -> Option<Evidence> {
        None
    }

    /// What to measure next where it was found, following these columns; nothing, where the model decides.
    fn next_experiment(&self, _columns: &[String]) -> Option<String> {
        None
    }
}

impl PartialEq for dyn Cause {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl fmt::Debug for dyn Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The cause a term explains; none for a part of the rigid body that is known beforehand.
pub fn of_term(term: TermKind) -> Option<&'static dyn Cause> {
    ALL.iter().copied().find(|cause| cause.remedy().term() == Some(term))
}

/// The causes that act through a parameter of a law.
pub fn acting_through(id: ParameterId) -> impl Iterator<Item = &'static dyn Cause> {
    ALL.iter().copied().filter(move |cause| cause.acts_on().contains(&id))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_with_a_term_has_its_name() {
        for cause in ALL {
            if let Some(term) = cause.remedy().term() {
                assert_eq!(cause.name(), term.name());
                assert_eq!(of_term(term).map(Cause::name), Some(cause.name()));
            }
        }
        assert!(of_term(TermKind::LoadGain).is_none());
    }

    #[test]
    fn names_differ() {
        let mut names: Vec<&str> = ALL.iter().map(|cause| cause.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
    }

    #[test]
    fn causes_act_through_the_parameters_they_change() {
        let through = |id| acting_through(id).map(Cause::name).collect::<Vec<_>>();
        assert_eq!(
            through(ParameterId::ViscousFriction),
            ["temperature-viscous", "quadratic-drag"]
        );
        assert!(through(ParameterId::TorqueOffset).is_empty());
    }
}
