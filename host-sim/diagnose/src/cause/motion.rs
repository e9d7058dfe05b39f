//! Causes of the motion alone: direction, offset, drag, inertia, gravity, the shape of the Stribeck curve, and a late channel.

use super::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, InitialGuess, Regressor, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView, Spacing};
use crate::extended::Extended;
use crate::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};
use joint_log::JointKind;
use joint_log::number::figure;

/// Levels and viscous part differ between the two directions.
///
/// Beside a torque offset, the log may not determine the difference of the levels, and a drive's losses may differ in the viscous
/// part alone. The size is that of the part that is larger in its standard errors.
pub(super) const DIRECTION_ASYMMETRY: Cause = Cause {
    meaning: "friction is larger in one direction than in the other",
    effect: "levels and viscous part differ by direction.",
    acts_on: LEVELS,
    candidates: |context| {
        let sign = |velocity: f64| if velocity == 0.0 { 0.0 } else { velocity.signum() };
        let by = vec![
            row(move |r| sign(r.sample.velocity_rad_s) * r.level),
            row(move |r| sign(r.sample.velocity_rad_s) * r.viscous),
        ];
        let columns = [context.log.velocity_name()];
        vec![Candidate::new(TermKind::DirectionAsymmetry, &columns, by).starting_at(&[
            (Id::CoulombAsymmetry, InitialGuess::first_times(1.0)),
            (Id::ViscousAsymmetry, InitialGuess::Times { regressor: 1, factor: 1.0 }),
        ])]
    },
    size: Some(|extended| extended.size(larger_asymmetry(extended))),
    words: |meaning, size, extended| {
        let (larger, other, other_part) = match larger_asymmetry(extended) {
            Id::ViscousAsymmetry => ("viscous part", Id::CoulombAsymmetry, "level"),
            _ => ("level", Id::ViscousAsymmetry, "viscous part"),
        };
        let (size, other) = (size.in_words(), figure(extended.value(other)));
        format!("{meaning}: {size} of the {larger}, {other} of the {other_part}")
    },
    evidence: |_, _| {
        Some(Evidence::ByDirection {
            view: ResidualView::Along,
            description: "If friction is larger in one direction, the two lines diverge; with the extension they coincide."
                .into(),
        })
    },
    ..Cause::new("direction-asymmetry", Remedy::Term(TermKind::DirectionAsymmetry))
};

/// Returns the part of the friction whose asymmetry is the larger one in standard errors.
fn larger_asymmetry(extended: &Extended) -> Id {
    let in_errors = |id: Id| {
        let error = extended.estimate(id).and_then(|e| e.std_error);
        error.map_or(0.0, |error| extended.value(id).abs() / error.max(f64::MIN_POSITIVE))
    };
    let is_viscous = in_errors(Id::ViscousAsymmetry) > in_errors(Id::CoulombAsymmetry);
    if is_viscous { Id::ViscousAsymmetry } else { Id::CoulombAsymmetry }
}

/// The torque reading has a constant zero error.
pub(super) const TORQUE_OFFSET: Cause = Cause {
    meaning: "the torque reading has a zero error; this is calibration, not friction",
    effect: "a constant.",
    candidates: |_| {
        vec![
            Candidate::single(TermKind::TorqueOffset, &[], row(|_| 1.0))
                .starting_at(&[(Id::TorqueOffset, InitialGuess::first_times(1.0))]),
        ]
    },
    evidence: |_, _| {
        Some(Evidence::ByDirection {
            view: ResidualView::Plain,
            description: "A zero error of the reading lifts both directions alike, at every speed."
                .into(),
        })
    },
    ..Cause::new("torque-offset", Remedy::CorrectColumn(Some(TermKind::TorqueOffset)))
};

/// The drag of the water grows with the square of the speed.
pub(super) const QUADRATIC_DRAG: Cause = Cause {
    meaning: "drag grows with the square of the speed",
    effect: "c v |v|, as in water.",
    acts_on: &[Id::ViscousFriction],
    least_size: |_| Some(0.0),
    candidates: |context| {
        if context.spec.law.parameters().contains(&Id::QuadraticFriction) {
            return Vec::new();
        }
        let drag = row(|r| r.sample.velocity_rad_s * r.sample.velocity_rad_s.abs());
        vec![
            Candidate::single(TermKind::QuadraticDrag, &[context.log.velocity_name()], drag)
                .starting_at(&[(Id::QuadraticDrag, InitialGuess::first_times(1.0))]),
        ]
    },
    evidence: |_, _| {
        Plane::new(
            "Friction and speed",
            PlaneAxis::Speed,
            ResidualView::Along,
            "Drag of water grows with the square of the speed; what a base model without it misses bends upwards.",
        )
        .into()
    },
    ..Cause::new("quadratic-drag", Remedy::Term(TermKind::QuadraticDrag))
};

/// Mass outside the known rigid body.
pub(super) const UNMODELLED_INERTIA: Cause = Cause {
    meaning: "a torque proportional to acceleration is left; this is the rigid body, not friction",
    effect: "inertia times acceleration.",
    candidates: |context| {
        let by = row(|r| r.sample.acceleration_rad_s2);
        vec![
            Candidate::single(TermKind::UnmodelledInertia, &[context.log.velocity_name()], by)
                .starting_at(&[(Id::Inertia, InitialGuess::first_times(1.0))]),
        ]
    },
    evidence: |_, _| {
        Plane::new(
            "Torque and acceleration",
            PlaneAxis::Acceleration,
            ResidualView::Plain,
            "A torque in proportion to acceleration is a rigid body, not friction.",
        )
        .trimmed()
        .into()
    },
    ..Cause::new("unmodelled-inertia", Remedy::RigidBody(Some(TermKind::UnmodelledInertia)))
};

/// Torque and velocity are logged at different times. It is a correction of a hypothesis in the contest, and no candidate.
pub(super) const CHANNEL_DELAY: Cause = Cause {
    meaning: "torque and velocity are logged at different times; this is the logger, not friction",
    effect: "a delayed velocity.",
    evidence: |_, _| {
        Plane::new(
            "The rate of the torque",
            PlaneAxis::TorqueRate,
            ResidualView::Plain,
            "Where the channels are logged at different times, the residual is the rate of the torque times the \
             delay: a line that falls.",
        )
        .spaced(Spacing::NarrowAtZero)
        .into()
    },
    ..Cause::new("channel-delay", Remedy::CorrectColumn(Some(TermKind::ChannelDelay)))
};

/// The Stribeck curve falls with another exponent than 2, which that of the laws has.
pub(super) const STRIBECK_SHAPE: Cause = Cause {
    meaning: "the Stribeck curve falls with another exponent than 2",
    effect: "another exponent than 2 in g(v).",
    acts_on: &[Id::StribeckVelocity],
    no_effect_size: 2.0,
    candidates: |context| {
        if !context.spec.law.has_stribeck_curve() {
            return Vec::new();
        }
        let columns = [context.log.velocity_name()];
        // An exponent of 2 is the table's own curve, without a derivative: a hair beside it there is one.
        [(1.0, 1.0, None), (3.0, 2.001, Some(Id::StribeckExponent))]
            .map(|(start, setting, derivative)| {
                let settings = vec![(Id::StribeckExponent, setting)];
                let by = Exact { kind: TermKind::StribeckShape, settings, derivative };
                Candidate::single(TermKind::StribeckShape, &columns, Regressor::Exact(by))
                    .starting_at(&[(Id::StribeckExponent, InitialGuess::At(start))])
            })
            .into()
    },
    evidence: |_, _| {
        Plane::new(
            "Friction and speed, slow to fast",
            PlaneAxis::Speed,
            ResidualView::Along,
            "A Stribeck curve of the wrong exponent is above the log at some slow speeds and below it at others.",
        )
        .spaced(Spacing::Logarithmic)
        .into()
    },
    ..Cause::new("stribeck-shape", Remedy::Term(TermKind::StribeckShape))
};

/// An imbalance adds a torque of the angle, independent of the direction.
pub(super) const GRAVITY_IMBALANCE: Cause = Cause {
    meaning: "an imbalance adds a torque that depends on the angle, in both directions alike",
    effect: "sine and cosine of the position, in both directions alike.",
    candidates: |context| {
        let name = context.log.position_name();
        // A ripple whose phase differs between runs is not caused by gravity.
        let no_zero = context.log.aligned_order.is_some();
        if no_zero || !context.log.varies(name) || context.log.train.joint != JointKind::Revolute {
            return Vec::new();
        }
        let by = vec![row(|r| r.sample.position_rad.sin()), row(|r| r.sample.position_rad.cos())];
        vec![Candidate::new(TermKind::GravityImbalance, &[name], by).starting_at(&[
            (Id::GravitySine, InitialGuess::first_times(1.0)),
            (Id::GravityCosine, InitialGuess::Times { regressor: 1, factor: 1.0 }),
        ])]
    },
    size: Some(|extended| extended.amplitude(Id::GravitySine, Id::GravityCosine)),
    evidence: |_, _| {
        Plane::new(
            "The shaft's angle",
            PlaneAxis::Turn,
            ResidualView::Plain,
            "An imbalance is one wave per turn, in both directions alike.",
        )
        .into()
    },
    ..Cause::new("gravity-imbalance", Remedy::RigidBody(Some(TermKind::GravityImbalance)))
};
