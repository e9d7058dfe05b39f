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
mod formula;
mod gravity_imbalance;
mod load_torque_coulomb;
mod position_ripple;
mod pressure_coulomb;
mod quadratic_drag;
mod radial_force_coulomb;
mod radial_force_rate;
mod stribeck_shape;
mod temperature_coulomb;
mod temperature_viscous;
mod time_drift;
mod torque_offset;
mod torque_ripple;
mod unknown;
mod unmodelled_inertia;
mod warm_up;

pub mod definition;

pub use definition::{Cause, Remedy};

use super::candidate::{Beside, Candidate};
use super::train_test::Follows;
use compensator_core::term::MAX_TERMS;
use compensator_core::{ParameterId, TermKind};
use std::ops::Deref;

/// Every cause, in the order candidates are weighed in.
pub const ALL: &[&dyn Cause] = &[
    &radial_force_coulomb::RadialForceCoulomb,
    &pressure_coulomb::PressureCoulomb,
    &load_torque_coulomb::LoadTorqueCoulomb,
    &temperature_viscous::TemperatureViscous,
    &temperature_coulomb::TemperatureCoulomb,
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
    &torque_ripple::TorqueRipple,
    &time_drift::TimeDrift,
    &warm_up::WarmUp,
    &unknown::Unknown,
];

/// The cause a term explains; none for a part of the rigid body that is known beforehand.
pub fn of_term(term: TermKind) -> Option<&'static dyn Cause> {
    ALL.iter().copied().find(|cause| cause.remedy().term() == Some(term))
}

/// The causes that act through a parameter of a law.
pub fn acting_through(id: ParameterId) -> impl Iterator<Item = &'static dyn Cause> {
    ALL.iter().copied().filter(move |cause| cause.acts_on().contains(&id))
}

/// A candidate and the cause it is of.
pub struct Suspect {
    /// The cause.
    pub cause: &'static dyn Cause,
    candidate: Candidate,
}

impl Deref for Suspect {
    type Target = Candidate;

    fn deref(&self) -> &Candidate {
        &self.candidate
    }
}

impl Suspect {
    /// What it says, whatever its settings.
    pub fn claim(&self) -> Claim {
        Claim::new(self.cause, self.candidate.follows.as_ref())
    }
}

/// What a suspect says, whatever its settings: a cause, and the column it follows (whether as a share of
/// the level), where it may follow any.
#[derive(Clone, Debug, PartialEq)]
pub struct Claim {
    /// The cause.
    pub cause: &'static dyn Cause,
    follows: Option<(String, bool)>,
}

impl Claim {
    /// The claim of a cause that follows this.
    pub fn new(cause: &'static dyn Cause, follows: Option<&Follows>) -> Self {
        Self { cause, follows: follows.map(|follows| (follows.column.clone(), follows.level)) }
    }
}

/// The candidates of all causes beside a model that has been fitted; none where it takes no more terms.
pub fn suspects(beside: &Beside) -> Vec<Suspect> {
    if beside.at.parameters.terms.len() >= MAX_TERMS {
        return Vec::new();
    }
    let in_the_model = |cause: &dyn Cause| cause.remedy().term().is_some_and(|t| beside.has(t));
    let open = ALL.iter().copied().filter(|cause| !in_the_model(*cause));
    open.flat_map(|cause| {
        let candidates = cause.candidates(beside).into_iter();
        candidates.map(move |candidate| Suspect { cause, candidate })
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_with_a_term_has_its_name() {
        for cause in ALL {
            if let Some(term) = cause.remedy().term() {
                assert_eq!(cause.name(), term.name());
                assert_eq!(of_term(term).map(|cause| cause.name()), Some(cause.name()));
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
        let through = |id| acting_through(id).map(|cause| cause.name()).collect::<Vec<_>>();
        assert_eq!(
            through(ParameterId::ViscousFriction),
            ["temperature-viscous", "quadratic-drag"]
        );
        assert!(through(ParameterId::TorqueOffset).is_empty());
    }
}
