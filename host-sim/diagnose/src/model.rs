//! A fitted model: a base law, its terms, and their values.

use super::train_test::{FollowedColumn, TrainTest};
use compensator_core::{ParameterId, Parameters};
use friction_fit::spec::Spec;
use friction_fit::{Outcome, Predicted, Resolution, predict};

/// A fitted model.
#[derive(Clone, Debug)]
pub struct FittedModel {
    /// Law, terms and rigid body.
    pub spec: Spec,
    /// Parameter values.
    pub parameters: Parameters<f64>,
    /// Parameters that the fit determined.
    pub free: Vec<ParameterId>,
    /// Parameters that the fit kept constant.
    pub fixed: Vec<ParameterId>,
    /// Time resolution of the simulation.
    pub resolution: Resolution,
    /// Column that one of its terms follows, for a term that may follow any column.
    pub follows: Option<FollowedColumn>,
}

/// Largest ratio by which one step of a linear fit changes a positive parameter.
const MAX_CHANGE: f64 = 3.0;

/// Returns the value of a parameter after the change of a linear fit, within its bounds.
pub fn changed(id: ParameterId, value: f64, change: f64) -> f64 {
    let info = id.info();
    let mut next = value + change;
    if value > 0.0 && info.lower >= 0.0 {
        next = next.clamp(value / MAX_CHANGE, value * MAX_CHANGE);
    }
    next.clamp(info.lower, info.upper)
}

impl FittedModel {
    /// Returns the model of an outcome that was fitted from a start.
    pub fn of(outcome: &Outcome, start: &Self) -> Self {
        let free = outcome.estimates.iter().filter(|estimate| estimate.std_error.is_some());
        Self {
            parameters: outcome.parameters.clone(),
            free: free.map(|estimate| estimate.id).collect(),
            resolution: outcome.resolution,
            ..start.clone()
        }
    }

    /// Returns the prediction of the held-out rows.
    pub fn on_test(&self, log: &TrainTest) -> Predicted {
        let log = log.following(self.follows.as_ref());
        predict(&self.parameters, log.test_rows(), self.resolution)
    }
}
