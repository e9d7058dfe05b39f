//! What the bristles hold where a track begins.
//!
//! A joint at rest, or just leaving it, holds any torque between plus and minus the static level: what its past left there.
//! The log does not say; its first torque does, with a sensor's noise, and an error there lasts as long as
//! the joint stays in presliding, which may be the whole run. So the held torque of each such track is one
//! more unknown, and one that is of no interest. It is solved for given the parameters (the output is all but
//! linear in it), and its derivative column is projected out of the Jacobian, so that the standard errors
//! know it was not known. A track that begins sliding forgets its start within a few rows, and so does this.

use super::simulate::{Resolution, simulate};
use super::track::Track;
use crate::dual::Dual;
use compensator_core::{ParameterId, Parameters};

/// Below this share of the track's largest speed its first sample counts as at rest.
const AT_REST: f64 = 1e-3;

/// The start is forgotten where the bristle torque depends on it by less than this.
const FORGOTTEN: f64 = 1e-6;

/// Solutions for the held torque; the second one corrects for what is not linear.
const ITERATIONS: usize = 2;

/// The start of a track.
#[derive(Clone, Debug)]
pub struct InitialState {
    /// Torque the bristles hold, Nm.
    pub held: f64,
    /// Derivative of the torque by it, for the rows from the first until it is forgotten.
    pub memory: Vec<f64>,
}

/// Solves for the held torque of a track; `None` where the law has no bristles.
pub fn initial_state(
    parameters: &Parameters<f64>,
    track: &Track,
    resolution: Resolution,
) -> Option<InitialState> {
    let fastest = track.samples.iter().map(|s| s.velocity_rad_s.abs()).fold(0.0, f64::max);
    let slides = track.samples[0].velocity_rad_s.abs() > AT_REST * fastest;
    if !parameters.law.has_bristles() {
        return None;
    }
    // `max` with 0 also takes a NaN that a wild step of the fit brought.
    let level = parameters
        .get(ParameterId::StaticTorque)
        .max(parameters.get(ParameterId::CoulombTorque))
        .max(0.0);
    let dual = parameters.convert::<Dual<1>>();
    let held = if slides {
        let coulomb = parameters.get(ParameterId::CoulombTorque).max(0.0);
        coulomb.copysign(track.samples[0].velocity_rad_s)
    } else {
        track.torque[0].clamp(-level, level)
    };
    let mut start = InitialState { held, memory: Vec::new() };
    for _ in 0..ITERATIONS {
        let (mut products, mut squares) = (0.0, 0.0);
        start.memory.clear();
        let held = Dual::parameter(start.held, 0);
        simulate(&dual, track, Some(held), resolution, |row, torque, bristle| {
            let derivative = torque.gradient[0];
            let weighed = track.weight(row) * derivative;
            products += weighed * (track.torque[row] - torque.value);
            squares += weighed * derivative;
            start.memory.push(derivative);
            bristle.gradient[0].abs() > FORGOTTEN
        });
        if squares > 0.0 && products.is_finite() {
            start.held = (start.held + products / squares).clamp(-level, level);
        }
    }
    Some(start)
}
