//! Bristle torque at the start of a track.
//!
//! A joint at rest holds any torque between plus and minus the static level, depending on its past. Only the first
//! measured torque indicates this value, with the sensor's noise, and an error persists as long as the joint stays in
//! presliding. The held torque of each such track is therefore a nuisance parameter. It is solved for given the other
//! parameters (the output is almost linear in it), and its derivative column is projected out of the Jacobian, so that
//! the standard errors include its uncertainty. For a track that starts sliding, the initial state decays within a few
//! rows.
//!
//! If the rows of a joint at rest require more than the static level, the bristles hold the level. The held torque then
//! depends on the level's parameters and is not a nuisance parameter. Otherwise the derivatives by level and stiffness
//! would have the wrong sign.

use super::simulate::{Resolution, simulate};
use super::track::Track;
use crate::dual::Dual;
use compensator_core::{ParameterId, Parameters, Real};

/// Speed below which the first sample counts as at rest, as a share of the track's largest speed.
const MAX_REST_SPEED_RATIO: f64 = 1e-3;

/// Derivative of the bristle torque by its initial value below which the initial value is negligible.
const NEGLIGIBLE_MEMORY: f64 = 1e-6;

/// Number of Gauss-Newton steps for the held torque; the second one corrects the nonlinearity.
const ITERATIONS: usize = 2;

/// Initial state of a track.
#[derive(Clone, Debug)]
pub struct InitialState {
    /// Initial bristle torque, Nm.
    pub held: f64,
    /// Derivative of the torque by `held`, for the first rows until it is negligible. Empty if `held` is not a nuisance
    /// parameter.
    pub memory: Vec<f64>,
    /// Sign of the bristle torque if it is at the level.
    at_level: Option<f64>,
    /// True if the track starts sliding.
    slides: bool,
}

impl InitialState {
    /// Returns the held torque, Nm, with its derivatives by the parameters.
    pub fn held_by<T: Real<Setting = T>>(&self, parameters: &Parameters<T>) -> T {
        let at_level = |sign| T::from_f64(sign) * level(parameters, self.slides);
        self.at_level.map_or(T::from_f64(self.held), at_level)
    }
}

/// Largest initial bristle torque, in Coulomb levels. Published breakaway torques of seals reach 1.8 levels. If only the
/// static level limited it, a log that starts under more torque than any law holds at rest would raise the static level
/// to that torque, at a vanishing Stribeck velocity.
const MAX_HELD_COULOMB_LEVELS: f64 = 2.0;

/// Returns the largest initial bristle torque, Nm. A sliding track does not start at the breakaway torque: the decay from it
/// would show the bristle stiffness even in steady sliding.
fn level<T: Real<Setting = T>>(parameters: &Parameters<T>, slides: bool) -> T {
    // NaN, which a diverging step of the fit may produce, must not become a level.
    let larger = |a: T, b: T| if a.value() > b.value() { a } else { b };
    let coulomb = larger(parameters.get(ParameterId::CoulombTorque), T::zero());
    let has_static = parameters.law.parameters().contains(&ParameterId::StaticTorque);
    let held = if has_static && !slides {
        larger(parameters.get(ParameterId::StaticTorque), coulomb)
    } else {
        coulomb
    };
    let most = coulomb * T::from_f64(MAX_HELD_COULOMB_LEVELS);
    if held.value() > most.value() { most } else { held }
}

/// Solves for the held torque of a track; `None` if the law has no bristles.
pub fn initial_state(
    parameters: &Parameters<f64>,
    track: &Track,
    resolution: Resolution,
) -> Option<InitialState> {
    let fastest = track.samples.iter().map(|s| s.velocity_rad_s.abs()).fold(0.0, f64::max);
    let slides = track.samples[0].velocity_rad_s.abs() > MAX_REST_SPEED_RATIO * fastest;
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
            bristle.gradient[0].abs() > NEGLIGIBLE_MEMORY
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
