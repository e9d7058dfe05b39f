//! Causes that no term of the driver's model represents. They are named and never offered as a compensation.

use super::definition::{Cause, Remedy};

/// A cause without a term.
pub struct WithoutTerm {
    name: &'static str,
    meaning: &'static str,
    effect: &'static str,
    remedy: Remedy,
    /// Returns the next experiment for these columns.
    next_experiment: fn(&[String]) -> String,
}

/// An error of the encoder, once per turn or harmonic. It makes a ripple in the speed and in the acceleration.
pub static ENCODER_ERROR: WithoutTerm = WithoutTerm {
    name: "encoder-error",
    meaning: "the measured angle is wrong by a wave of itself, so that speed and acceleration have a ripple that the joint has \
              not; this is the encoder, not friction",
    effect: "a wave of the angle in speed and acceleration.",
    remedy: Remedy::CorrectColumn(None),
    next_experiment: |_| {
        "Calibrate the encoder against a second one or at constant speed, and log the corrected angle.".into()
    },
};

/// Torque of other joints' motion.
pub static JOINT_COUPLING: WithoutTerm = WithoutTerm {
    name: "joint-coupling",
    meaning: "the motion of other joints adds a torque; this is the rigid body, not friction",
    effect: "velocities and accelerations of other joints, and products of two.",
    remedy: Remedy::RigidBody(None),
    next_experiment: |_| {
        "Move this joint alone while the others stand still, or subtract the rigid-body model of the whole arm.".into()
    },
};

/// Mass that the joint carries.
pub static PAYLOAD: WithoutTerm = WithoutTerm {
    name: "payload",
    meaning: "a column scales gravity or inertia, as the mass that the joint carries does; this is the rigid body, not friction",
    effect: "gravity or inertia in proportion to a column.",
    remedy: Remedy::RigidBody(None),
    next_experiment: |columns| {
        let column = columns.first().map_or("COLUMN", String::as_str);
        format!(
            "Diagnose one payload at a time (--where {column}=VALUE), or log the torque of the load as load_torque_nm and add \
             --rigid-body load."
        )
    },
};

impl Cause for WithoutTerm {
    fn name(&self) -> &'static str {
        self.name
    }

    fn meaning(&self) -> &'static str {
        self.meaning
    }

    fn effect(&self) -> &'static str {
        self.effect
    }

    fn remedy(&self) -> Remedy {
        self.remedy
    }

    fn next_experiment(&self, columns: &[String]) -> Option<String> {
        Some((self.next_experiment)(columns))
    }
}
