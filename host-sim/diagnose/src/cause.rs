//! Possible causes of a residual: one file per cause, and the list of all causes.
//!
//! A cause has a name, a meaning, a remedy, a size in words, and a plane in which it shows. The
//! remedy may be a term of the driver's model, a corrected column, or nothing. A cause is found in
//! one of three ways:
//!
//! - As [`Cause::candidates`], which are evaluated beside a fitted model and then fitted with all
//!   other parameters.
//! - [`Cause::in_log`]: in the log, without a model.
//! - [`Cause::in_rest`]: in the remaining residual, if no candidate passed.
//!
//! The search, the summary and the report use only this trait. A new cause therefore needs one file
//! and one row in [`ALL`]. Relations between causes are also properties of the cause: it may yield
//! to another one, or be considered after all others.

mod backlash;
mod channel_delay;
mod direction_asymmetry;
mod dwell_time_static;
mod followed;
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
mod without_term;

pub mod definition;

pub use definition::{Cause, Remedy};

use super::candidate::{Candidate, FitContext};
use super::train_test::FollowedColumn;
use compensator_core::term::MAX_TERMS;
use compensator_core::{ParameterId, TermKind};
use std::ops::Deref;

/// All causes, in the order in which their candidates are evaluated.
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
    &without_term::ENCODER_ERROR,
    &without_term::JOINT_COUPLING,
    &without_term::PAYLOAD,
    &unknown::Unknown,
];

/// Returns the cause that a term represents; `None` for a part of the rigid body that is known
/// beforehand.
pub fn of_term(term: TermKind) -> Option<&'static dyn Cause> {
    ALL.iter().copied().find(|cause| cause.remedy().term() == Some(term))
}

/// Returns the cause of this name.
pub fn named(name: &str) -> Option<&'static dyn Cause> {
    ALL.iter().copied().find(|cause| cause.name() == name)
}

/// Returns the causes that act through a parameter of a law.
pub fn acting_through(id: ParameterId) -> impl Iterator<Item = &'static dyn Cause> {
    ALL.iter().copied().filter(move |cause| cause.acts_on().contains(&id))
}

/// A candidate and its cause.
pub struct CauseCandidate {
    /// The cause.
    pub cause: &'static dyn Cause,
    candidate: Candidate,
}

impl Deref for CauseCandidate {
    type Target = Candidate;

    fn deref(&self) -> &Candidate {
        &self.candidate
    }
}

impl CauseCandidate {
    /// Returns the identity of the candidate, independent of its settings.
    pub fn claim(&self) -> CauseIdentity {
        CauseIdentity::new(self.cause, self.candidate.follows.as_ref())
    }
}

/// Identity of a candidate, independent of its settings.
///
/// It consists of the cause and, for a cause that may follow any column, of the column and whether
/// it scales the level.
#[derive(Clone, Debug, PartialEq)]
pub struct CauseIdentity {
    /// The cause.
    pub cause: &'static dyn Cause,
    follows: Option<(String, bool)>,
}

impl CauseIdentity {
    /// Creates the identity of a cause that follows this column.
    pub fn new(cause: &'static dyn Cause, follows: Option<&FollowedColumn>) -> Self {
        Self { cause, follows: follows.map(|follows| (follows.column.clone(), follows.level)) }
    }
}

/// Returns the candidates of all causes for a fitted model; empty if the model has the maximum number of terms.
pub fn cause_candidates(context: &FitContext) -> Vec<CauseCandidate> {
    if context.at.parameters.terms.len() >= MAX_TERMS {
        return Vec::new();
    }
    let in_the_model = |cause: &dyn Cause| cause.remedy().term().is_some_and(|t| context.has(t));
    let open = ALL.iter().copied().filter(|cause| !in_the_model(*cause));
    open.flat_map(|cause| {
        let candidates = cause.candidates(context).into_iter();
        candidates.map(move |candidate| CauseCandidate { cause, candidate })
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_with_term_have_name_of_term() {
        for cause in ALL {
            if let Some(term) = cause.remedy().term() {
                assert_eq!(cause.name(), term.name());
                assert_eq!(of_term(term).map(|cause| cause.name()), Some(cause.name()));
            }
        }
        assert!(of_term(TermKind::LoadGain).is_none());
    }

    #[test]
    fn meaning_of_size_follows_its_sign() {
        let of = |name: &str, size: f64| {
            let cause = ALL.iter().find(|cause| cause.name() == name).expect("a cause");
            cause.meaning_of(size)
        };
        for (name, positive, negative) in [
            ("time-drift", "rises", "falls"),
            ("pressure-coulomb", "grows", "falls"),
            ("radial-force-coulomb", "grows", "falls"),
            ("temperature-coulomb", "falls", "rises"),
            ("temperature-viscous", "falls", "rises"),
            ("warm-up", "falls", "rises"),
        ] {
            assert!(of(name, 0.25).contains(positive), "{name}: {}", of(name, 0.25));
            assert!(of(name, -0.25).contains(negative), "{name}: {}", of(name, -0.25));
        }
        assert_eq!(of("torque-offset", -1.0), of("torque-offset", 1.0));
    }

    #[test]
    fn cause_names_are_unique() {
        let mut names: Vec<&str> = ALL.iter().map(|cause| cause.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
    }

    #[test]
    fn acting_through_returns_causes_of_parameter() {
        let through = |id| acting_through(id).map(|cause| cause.name()).collect::<Vec<_>>();
        assert_eq!(
            through(ParameterId::ViscousFriction),
            ["temperature-viscous", "quadratic-drag"]
        );
        assert!(through(ParameterId::TorqueOffset).is_empty());
    }
}
