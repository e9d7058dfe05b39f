//! What the bristles hold where a track begins.
//!
//! A joint at rest, or just leaving it, holds any torque between plus and minus the static level: what its past left there.
//! The log does not say; its first torque does, with a sensor's noise, and an error there lasts as long as
//! the joint stays in presliding, which may be the whole run. So the held torque of each such track is one
//! more unknown, and one that is of no interest. It is solved for given the parameters (the output is all but
//! linear in it), and its derivative column is projected out of the Jacobian, so that the standard errors
//! know it was not known. A track that begins sliding forgets its start within a few rows, and so does this.
//!
//! Where the rows of a joint at rest ask for more than the static level, the bristles hold the level: it is no unknown then, and moves with the
//! level's parameters. Taken for an unknown there, a robot's axis that begins at rest (measured) had derivatives by level and
//! stiffness of the wrong sign, and fits of it ended where they began.

use super::simulate::{Resolution, simulate};
use super::track::Track;
use crate::dual::Dual;
use compensator_core::{ParameterId, Parameters, Real};

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
    /// Derivative of the torque by it, for the rows from the first until it is forgotten; none where it is no unknown.
    pub memory: Vec<f64>,
    /// Where the bristles hold all they can: the sign.
    at_level: Option<f64>,
    /// Whether the track begins sliding.
    slides: bool,
}

impl InitialState {
    /// The held torque, Nm, with its derivatives by the parameters.
    pub fn held_by<T: Real<Setting = T>>(&self, parameters: &Parameters<T>) -> T {
        let all = |sign| T::from_f64(sign) * level(parameters, self.slides);
        self.at_level.map_or(T::from_f64(self.held), all)
    }
}

/// Coulomb levels a track may begin with. Of a breakaway 1.8 levels are what is printed of seals; with no bound but the static level a log that begins under
/// more torque than any law holds at rest would raise that to it, at a Stribeck velocity of nothing: 669 N on the positioning system, with 20 N of friction.
const MOST_HELD: f64 = 2.0;

/// The most a track begins with, Nm. One that slides holds no breakaway torque: beginning there it would show, in steady sliding too, how
/// soft the bristles are that come down from it.
fn level<T: Real<Setting = T>>(parameters: &Parameters<T>, slides: bool) -> T {
    // Written so that a NaN, which a wild step of the fit may bring, is no level.
    let larger = |a: T, b: T| if a.value() > b.value() { a } else { b };
    let coulomb = larger(parameters.get(ParameterId::CoulombTorque), T::zero());
    let has_static = parameters.law.parameters().contains(&ParameterId::StaticTorque);
    let held = if has_static && !slides {
        larger(parameters.get(ParameterId::StaticTorque), coulomb)
    } else {
        coulomb
    };
    let most = coulomb * T::from_f64(MOST_HELD);
    if held.value() > most.value() { most } else { held }
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
    let level = level(parameters, slides);
    let dual = parameters.convert::<Dual<1>>();
    let held = if slides {
        let coulomb = parameters.get(ParameterId::CoulombTorque).max(0.0);
        coulomb.copysign(track.samples[0].velocity_rad_s)
    } else {
        track.torque[0].clamp(-level, level)
    };
    let mut start = InitialState { held, memory: Vec::new(), at_level: None, slides };
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
    if start.held.abs() < level || level <= 0.0 {
        return Some(start);
    }
    start.at_level = Some(start.held.signum());
    start.memory.clear();
    Some(start)
}
