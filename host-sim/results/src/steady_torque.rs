//! The torque of a law in steady sliding, which tables and lines of other controllers approximate.

use compensator_core::{ModelState, Parameters, Sample};

/// Sample period, s. It is long enough for every bristle to reach steady sliding.
const PERIOD_S: f64 = 1000.0;

/// Number of samples.
const STEPS: usize = 100;

/// Returns the torque, Nm or N, after the inputs of this sample were constant for a long time.
pub(crate) fn steady_torque(parameters: &Parameters<f64>, sample: &Sample<f64>) -> f64 {
    let model = parameters.build_unchecked::<f64>(PERIOD_S);
    let mut state = ModelState::default();
    (0..STEPS).fold(0.0, |_, _| model.step(&mut state, sample))
}
