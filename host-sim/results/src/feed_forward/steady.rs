//! The torque of a fitted model in steady sliding, with its standard error.

use crate::steady_torque::steady_torque;
use compensator_core::{ParameterId, Parameters, Sample};
use friction_fit::{Estimate, Outcome};

/// Step of a parameter for the derivative, as a share of its value and of its standard error.
const STEP_SHARE: f64 = 0.01;

/// Returns the torque that drives the joint at a constant velocity, Nm: friction and offset, without gravity.
pub fn torque_without_gravity(parameters: &Parameters<f64>, velocity_rad_s: f64) -> f64 {
    let sample = Sample { velocity_rad_s, position_weight: 0.0, ..Sample::default() };
    steady_torque(parameters, &sample)
}

/// A fitted model in the form that a driver runs, with the covariance of its parameters.
pub struct SteadyModel {
    /// The parameters.
    pub parameters: Parameters<f64>,
    /// Fitted parameters with their standard errors.
    free: Vec<(ParameterId, f64)>,
    /// Row by row.
    correlation: Vec<f64>,
}

/// A value with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimated {
    /// The value.
    pub value: f64,
    /// Its standard error, in the same unit.
    pub std_error: f64,
}

impl SteadyModel {
    pub fn new(fit: &Outcome) -> Self {
        let form = fit.for_driver();
        let with_error = |estimate: &Estimate| Some((estimate.id, estimate.std_error?));
        let free: Vec<(ParameterId, f64)> = form.estimates.iter().filter_map(with_error).collect();
        // The correlation is that of the fit to the rows alone. The passive form may have one parameter less.
        let count = free.len();
        let has_correlation = fit.correlation.nrows() == count && fit.driver_form.is_none();
        let entry = |i, j| match has_correlation {
            true => fit.correlation[(i, j)],
            false => f64::from(u8::from(i == j)),
        };
        let correlation = pairs(count).map(|(i, j)| entry(i, j)).collect();
        Self { parameters: form.parameters, free, correlation }
    }

    /// Returns the torque at a velocity, Nm.
    pub fn torque(&self, velocity_rad_s: f64) -> Estimated {
        let value = torque_without_gravity(&self.parameters, velocity_rad_s);
        let effects: Vec<f64> =
            self.free.iter().map(|(id, error)| self.effect(*id, *error, velocity_rad_s)).collect();
        let products = pairs(effects.len()).zip(&self.correlation);
        let variance: f64 =
            products.map(|((i, j), correlation)| effects[i] * correlation * effects[j]).sum();
        Estimated { value, std_error: variance.max(0.0).sqrt() }
    }

    /// Returns the change of the torque by one standard error of a parameter, Nm.
    fn effect(&self, id: ParameterId, std_error: f64, velocity_rad_s: f64) -> f64 {
        let value = self.parameters.get(id);
        // An error far above the value has no meaning as a step, because the torque is not linear in it.
        let scale = if value == 0.0 { std_error } else { std_error.min(value.abs()) };
        let step = STEP_SHARE * scale;
        if !(step > 0.0 && step.is_finite()) {
            return 0.0;
        }
        let at = |value| {
            torque_without_gravity(&self.parameters.clone().with(id, value), velocity_rad_s)
        };
        let slope = (at(value + step) - at(value - step)) / (2.0 * step);
        if slope.abs() < f64::EPSILON { 0.0 } else { slope * std_error }
    }
}

/// Returns the places of a square matrix, row by row.
fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |i| (0..count).map(move |j| (i, j)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ParameterId as Id;
    use compensator_core::{LawKind, TermKind};

    fn parameters(law: LawKind) -> Parameters<f64> {
        let mut parameters = Parameters::new(law)
            .with(Id::CoulombTorque, 0.5)
            .with(Id::StaticTorque, 0.8)
            .with(Id::StribeckVelocity, 0.2)
            .with(Id::ViscousFriction, 0.1);
        assert!(parameters.add_term(TermKind::TorqueOffset));
        assert!(parameters.add_term(TermKind::GravityImbalance));
        parameters.with(Id::TorqueOffset, 0.05).with(Id::GravityCosine, 3.0)
    }

    #[test]
    fn steady_torque_of_bristles_is_level_with_offset_and_without_gravity() {
        let parameters = parameters(LawKind::Lugre);
        for velocity in [-3.0f64, -0.2, 1e-4, 0.05, 2.0] {
            let level = 0.5 + 0.3 * (-(velocity / 0.2).powi(2)).exp();
            let expected = level * velocity.signum() + 0.1 * velocity + 0.05;
            let torque = torque_without_gravity(&parameters, velocity);
            assert!((torque - expected).abs() < 1e-4, "{velocity}: {torque} {expected}");
        }
    }

    #[test]
    fn torque_of_independent_parameters_adds_their_variances() {
        let model = SteadyModel {
            parameters: parameters(LawKind::Linear),
            free: vec![(Id::CoulombTorque, 0.03), (Id::ViscousFriction, 0.02)],
            correlation: vec![1.0, 0.0, 0.0, 1.0],
        };
        for velocity in [-2.0f64, 0.5] {
            let error = model.torque(velocity).std_error;
            let expected = (0.03f64.powi(2) + (0.02 * velocity).powi(2)).sqrt();
            assert!((error - expected).abs() < 1e-9, "{velocity}: {error} {expected}");
        }
    }

    #[test]
    fn torque_of_correlated_parameters_has_covariance() {
        let model = SteadyModel {
            parameters: parameters(LawKind::Linear),
            free: vec![(Id::CoulombTorque, 0.03), (Id::ViscousFriction, 0.03)],
            correlation: vec![1.0, -1.0, -1.0, 1.0],
        };
        // At 1 rad/s the errors cancel; at -1 rad/s as well, because both reverse.
        assert!(model.torque(1.0).std_error < 1e-9 && model.torque(-1.0).std_error < 1e-9);
        assert!((model.torque(3.0).std_error - 0.06).abs() < 1e-9);
    }
}
