//! Possible causes of a residual: one file per cause, and the list of all causes.
//!
//! A cause has a name, a meaning, a remedy, a size in words, and a plane in which it shows. The
//! remedy may be a term of the driver's model, a corrected column, or nothing. A cause is found in
//! one of three ways:
//!
//! - In a contest of hypotheses ([`super::contest`]), from where [`Cause::candidates`] take it into the driver's law.
//! - [`Cause::in_log`]: in the log, without a model.
//! - [`Cause::in_rest`]: in the remaining residual, if no cause is named.
//!
//! Finalists, summary and report use only this trait. A new cause needs one file, one row in [`ALL`], and its columns in the
//! contest.

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

use compensator_core::{ParameterId, TermKind};

/// All causes.
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
