//! Causes that no term of the driver's model represents. They are named and never offered as a compensation.

use super::{Cause, Remedy};

/// An error of the encoder, once per turn or harmonic. It makes a ripple in the speed and in the acceleration.
pub(super) const ENCODER_ERROR: Cause = Cause {
    meaning: "the measured angle is wrong by a wave of itself, so that speed and acceleration have a ripple that the joint has \
              not; this is the encoder, not friction",
    effect: "a wave of the angle in speed and acceleration.",
    next_experiment: |_| {
        Some("Calibrate the encoder against a second one or at constant speed, and log the corrected angle.".into())
    },
    ..Cause::new("encoder-error", Remedy::CorrectColumn(None))
};

/// Torque of other joints' motion.
pub(super) const JOINT_COUPLING: Cause = Cause {
    meaning: "the motion of other joints adds a torque; this is the rigid body, not friction",
    effect: "velocities and accelerations of other joints, and products of two.",
    next_experiment: |_| {
        Some("Move this joint alone while the others stand still, or subtract the rigid-body model of the whole arm.".into())
    },
    ..Cause::new("joint-coupling", Remedy::RigidBody(None))
};

/// Mass that the joint carries.
pub(super) const PAYLOAD: Cause = Cause {
    meaning: "a column scales gravity or inertia, as the mass that the joint carries does; this is the rigid body, not friction",
    effect: "gravity or inertia in proportion to a column.",
    next_experiment: |columns| {
        let column = columns.first().map_or("COLUMN", String::as_str);
        Some(format!(
            "Diagnose one payload at a time (--where {column}=VALUE), or log the torque of the load as load_torque_nm and add \
             --rigid-body load."
        ))
    },
    ..Cause::new("payload", Remedy::RigidBody(None))
};
