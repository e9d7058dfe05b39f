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
use compensator_core::{FrictionModel, LawKind, ModelState, ParameterId, Parameters, Real};

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
    pub fn held_by<T: Real<Setting = T>>(&self, parameters: &Parameters<T>, track: &Track) -> T {
        let at_level = |sign| T::from_f64(sign) * level(parameters, track, self.slides);
        self.at_level.map_or(T::from_f64(self.held), at_level)
    }
}

/// Largest initial bristle torque, in Coulomb levels. Published breakaway torques of seals reach 1.8 levels. If only the
/// static level limited it, a log that starts under more torque than any law holds at rest would raise the static level
/// to that torque, at a vanishing Stribeck velocity.
const MAX_HELD_COULOMB_LEVELS: f64 = 2.0;

/// Returns the largest initial bristle torque, Nm. A sliding track does not start at the breakaway torque: the decay from it
/// would show the bristle stiffness even in steady sliding.
fn level<T: Real<Setting = T>>(parameters: &Parameters<T>, track: &Track, slides: bool) -> T {
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
    let held_or_most = if held.value() > most.value() { most } else { held };
    if slides || parameters.terms.is_empty() && parameters.law != LawKind::ImprovedLugre {
        return held_or_most;
    }
    // A load may take more than the whole level.
    larger(held_or_most + (loaded_level(parameters, track) - held), T::zero())
}

/// Returns the level at rest at the first sample of a track, Nm, with the terms' loads: a step of the core limits any bristle
/// torque to it.
fn loaded_level<T: Real<Setting = T>>(parameters: &Parameters<T>, track: &Track) -> T {
    /// Torque above any level, Nm.
    const ANY_TORQUE_NM: f64 = 1e9;
    let model: FrictionModel<T> = parameters.build_unchecked(T::from_f64(track.period_s));
    let mut state = ModelState::holding(T::from_f64(ANY_TORQUE_NM));
    let mut sample = track.samples[0].map(T::from_f64);
    sample.velocity_rad_s = T::zero();
    model.step(&mut state, &sample);
    state.bristle_torque_nm
}

/// Returns true if a track starts sliding: its first row is not at rest, and the track leaves presliding at all. A joint at
/// rest has a small reconstructed speed, and its largest speed is then no measure.
fn starts_sliding(parameters: &Parameters<f64>, track: &Track) -> bool {
    let speeds = || track.samples.iter().map(|sample| sample.velocity_rad_s.abs());
    let fastest = speeds().fold(0.0, f64::max);
    let deflection = parameters.get(ParameterId::CoulombTorque).max(0.0)
        / parameters.get(ParameterId::BristleStiffness).max(f64::MIN_POSITIVE);
    let travel = speeds().sum::<f64>() * track.period_s;
    track.samples[0].velocity_rad_s.abs() > MAX_REST_SPEED_RATIO * fastest && travel > deflection
}

/// Solves for the held torque of a track; `None` if the law has no bristles.
pub fn initial_state(
    parameters: &Parameters<f64>,
    track: &Track,
    resolution: Resolution,
) -> Option<InitialState> {
    if !parameters.law.has_bristles() {
        return None;
    }
    let slides = starts_sliding(parameters, track);
    let level = level(parameters, track, slides);
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

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{Sample, TermKind};

    #[test]
    fn initial_state_of_track_at_rest_holds_the_static_level() {
        let parameters = Parameters::<f64>::new(LawKind::Lugre)
            .with(ParameterId::CoulombTorque, 1.5)
            .with(ParameterId::StaticTorque, 2.2)
            .with(ParameterId::BristleStiffness, 800.0);
        // The reconstructed speed of a joint at rest is small and not zero.
        let sample = |row: usize| Sample {
            velocity_rad_s: if row.is_multiple_of(2) { 3e-7 } else { -2e-7 },
            ..Sample::default()
        };
        let track = Track::even((0..200).map(sample).collect(), vec![-2.1; 200], 0.01);
        let start = initial_state(&parameters, &track, Resolution::PLAIN).expect("bristles");
        assert!((start.held + 2.1).abs() < 1e-3, "{}", start.held);
    }

    #[test]
    fn initial_state_with_load_holds_the_loaded_level() {
        let mut parameters = Parameters::<f64>::new(LawKind::Lugre)
            .with(ParameterId::CoulombTorque, 1.0)
            .with(ParameterId::StaticTorque, 1.5)
            .with(ParameterId::BristleStiffness, 800.0)
            .with(ParameterId::PressureCoulomb, 3e-6);
        assert!(parameters.add_term(TermKind::PressureCoulomb));
        parameters.set(ParameterId::PressureCoulomb, 3e-6);
        let sample = Sample { pressure_diff_mpa: 0.2, ..Sample::default() };
        let track = Track::even(vec![sample; 100], vec![2.05; 100], 0.01);
        let start = initial_state(&parameters, &track, Resolution::PLAIN).expect("bristles");
        assert!((start.held - 2.05).abs() < 1e-6, "{}", start.held);
    }
}
