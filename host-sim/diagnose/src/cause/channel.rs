//! Causes that follow a known column: side load, pressure, load torque and temperature.
//!
//! A load on the seal or the gear raises the friction levels in both directions. Temperature acts on the level, as a seal stiffens
//! in the cold, and on the viscous part, as a film thins with warmth.

use super::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor, Row, row};
use crate::evidence::{Plane, PlaneAxis, ResidualView, Spacing};
use crate::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};

const RADIAL_FORCE: &str = "radial_force_n";

const PRESSURE: &str = "pressure_diff_pa";

const LOAD_TORQUE: &str = "load_torque_nm";

const TEMPERATURE: &str = "temperature_c";

/// The side load presses the seal.
pub(super) const RADIAL_FORCE_COULOMB: Cause = Cause {
    meaning: "the side load presses the seal, so friction grows with it",
    meaning_of: |size| (size < 0.0).then_some("friction falls as the side load rises"),
    effect: "levels rise with the side load.",
    acts_on: LEVELS,
    covariate: Some(RADIAL_FORCE),
    candidates: |context| {
        let by = row(|r| r.added * r.sample.radial_force_n);
        let candidate = Candidate::single(TermKind::RadialForceCoulomb, &[RADIAL_FORCE], by)
            .starting_at(&[(Id::RadialForceCoulomb, InitialGuess::first_times(1.0))])
            .keeping(&[Id::RadialForceStaticExcess]);
        where_varying(context, RADIAL_FORCE, candidate)
    },
    evidence: |_, _| {
        Plane::new(
            "Friction and side load",
            PlaneAxis::Column(RADIAL_FORCE.into()),
            ResidualView::Along,
            "Where side load presses the seal, what the base model misses rises with it, in both directions alike.",
        )
        .into()
    },
    ..Cause::new("radial-force-coulomb", Remedy::Term(TermKind::RadialForceCoulomb))
};

/// Pressure preloads the seal.
pub(super) const PRESSURE_COULOMB: Cause = Cause {
    meaning: "pressure preloads the seal, so friction grows with it",
    meaning_of: |size| (size < 0.0).then_some("friction falls as the pressure rises"),
    effect: "levels rise with the pressure difference.",
    acts_on: LEVELS,
    covariate: Some(PRESSURE),
    candidates: |context| {
        let by = row(|r| r.added * r.sample.pressure_diff_mpa);
        let candidate = Candidate::single(TermKind::PressureCoulomb, &[PRESSURE], by)
            .starting_at(&[(Id::PressureCoulomb, InitialGuess::first_times(1e-6))])
            .keeping(&[Id::PressureStaticExcess]);
        where_varying(context, PRESSURE, candidate)
    },
    evidence: |_, _| {
        Plane::new(
            "Friction and pressure",
            PlaneAxis::Column(PRESSURE.into()),
            ResidualView::Along,
            "Where pressure presses the seal, what the base model misses rises with it, in both directions alike.",
        )
        .into()
    },
    ..Cause::new("pressure-coulomb", Remedy::Term(TermKind::PressureCoulomb))
};

/// The transmitted torque presses the gear, whatever its sign.
pub(super) const LOAD_TORQUE_COULOMB: Cause = Cause {
    meaning: "the transmitted torque loads the drive, so friction grows with it",
    effect: "levels rise with the transmitted torque.",
    acts_on: LEVELS,
    covariate: Some(LOAD_TORQUE),
    least_size: |_| Some(0.0),
    candidates: |context| {
        let by = row(|r| r.added * r.sample.load_torque_nm.abs());
        let candidate = Candidate::single(TermKind::LoadTorqueCoulomb, &[LOAD_TORQUE], by)
            .starting_at(&[(Id::LoadCoulomb, InitialGuess::first_times(1.0))]);
        where_varying(context, LOAD_TORQUE, candidate)
    },
    evidence: |_, _| {
        Plane::new(
            "Friction and transmitted torque",
            PlaneAxis::SizeOf(LOAD_TORQUE.into()),
            ResidualView::Along,
            "Where the load presses the gear, what the base model misses rises with its size, whatever its sign.",
        )
        .into()
    },
    ..Cause::new("load-torque-coulomb", Remedy::Term(TermKind::LoadTorqueCoulomb))
};

/// The film thins as it warms.
pub(super) const TEMPERATURE_VISCOUS: Cause = Cause {
    meaning: "the viscous part falls as the film warms",
    meaning_of: |size| (size < 0.0).then_some("the viscous part rises with the temperature"),
    effect: "the viscous coefficient falls as the film warms.",
    acts_on: &[Id::ViscousFriction],
    covariate: Some(TEMPERATURE),
    candidates: |context| {
        let (term, other) = (TermKind::TemperatureViscous, TermKind::TemperatureCoulomb);
        of_temperature(context, term, Id::TemperatureViscosity, other, |r| r.viscous)
    },
    evidence: |_, _| {
        Plane::new(
            "Viscous part and temperature",
            PlaneAxis::Column(TEMPERATURE.into()),
            ResidualView::PerVelocity,
            "Residual over velocity, each row counting by the square of its speed. Where the film thins as \
             it warms, the coefficient that is missed falls with temperature.",
        )
        .into()
    },
    ..Cause::new("temperature-viscous", Remedy::Term(TermKind::TemperatureViscous))
};

/// The seal stiffens in the cold.
pub(super) const TEMPERATURE_COULOMB: Cause = Cause {
    meaning: "the friction level falls as the seal warms",
    meaning_of: |size| (size < 0.0).then_some("the friction level rises as the seal warms"),
    effect: "levels fall as the seal warms.",
    acts_on: LEVELS,
    candidates: |context| {
        let (term, other) = (TermKind::TemperatureCoulomb, TermKind::TemperatureViscous);
        of_temperature(context, term, Id::TemperatureCoulomb, other, |r| r.level)
    },
    evidence: |_, _| {
        Plane::new(
            "Friction level and temperature",
            PlaneAxis::Column(TEMPERATURE.into()),
            ResidualView::Along,
            "Residual along the motion. Where the seal grips harder in the cold, what the base model misses \
             falls with temperature at every speed alike.",
        )
        .into()
    },
    next_experiment: |_| {
        Some(
            "Repeat slow and fast runs in both directions at two temperatures at least 10 K apart, in random order: temperature \
             changes the level at every speed, the film's viscosity in proportion to the speed, and run-in follows neither."
                .into(),
        )
    },
    ..Cause::new("temperature-coulomb", Remedy::Term(TermKind::TemperatureCoulomb))
};

/// A changing side load deflects the bristles.
pub(super) const RADIAL_FORCE_RATE: Cause = Cause {
    meaning: "a changing side load bends the bristles",
    effect: "a changing side load bends the bristles.",
    acts_on: &[Id::BristleStiffness, Id::BristleDamping],
    candidates: |context| {
        let (kind, derivative) = (TermKind::RadialForceRate, Some(Id::RadialForceRate));
        let by = Regressor::Exact(Exact { kind, settings: Vec::new(), derivative });
        let candidate = Candidate::single(kind, &[RADIAL_FORCE], by)
            .starting_at(&[(Id::RadialForceRate, InitialGuess::first_times(1.0))]);
        match context.spec.law.has_bristles() {
            true => where_varying(context, RADIAL_FORCE, candidate),
            false => Vec::new(),
        }
    },
    evidence: |_, _| {
        Plane::new(
            "The changing side load",
            PlaneAxis::ChangePerTravel(RADIAL_FORCE.into()),
            ResidualView::Plain,
            "A side load that changes while the joint hardly moves bends the bristles: the torque is off in \
             proportion, in both directions alike.",
        )
        .trimmed()
        .spaced(Spacing::NarrowAtZero)
        .into()
    },
    ..Cause::new("radial-force-rate", Remedy::Term(TermKind::RadialForceRate))
};

/// Returns a candidate if its column varies in the log.
fn where_varying(context: &FitContext, column: &str, candidate: Candidate) -> Vec<Candidate> {
    if context.log.varies(column) { vec![candidate] } else { Vec::new() }
}

/// Returns the candidate of a part of the friction that falls in proportion to the temperature. If the model has the other term of
/// the temperature, both share its reference.
fn of_temperature(
    context: &FitContext,
    term: TermKind,
    coefficient: Id,
    other: TermKind,
    part: fn(&Row) -> f64,
) -> Vec<Candidate> {
    let mean = match context.has(other) {
        true => context.at.parameters.get(Id::TemperatureReference),
        false => context.log.mean_temperature_c(),
    };
    let by = row(move |r| -part(r) * (r.sample.temperature_c - mean));
    let candidate = Candidate::single(term, &[TEMPERATURE], by)
        .starting_at(&[
            (coefficient, InitialGuess::first_times(1.0)),
            (Id::TemperatureReference, InitialGuess::At(mean)),
        ])
        .keeping(&[Id::TemperatureReference]);
    where_varying(context, TEMPERATURE, candidate)
}
