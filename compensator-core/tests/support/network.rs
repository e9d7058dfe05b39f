//! The reference network on given inputs, in any number.

use compensator_core::Real;
use compensator_core::network::{NetworkState, reference};

/// Evaluations of a run.
const EVALUATIONS: usize = 10_000;

/// The factors of every evaluation, the inputs the same in every number.
pub fn factors<T: Real>() -> Vec<[f64; 3]> {
    let network = reference::network::<T>();
    let mut state = NetworkState::default();
    (0..EVALUATIONS)
        .map(|step| {
            let at = |period: usize| (step % period) as f64 / period as f64;
            let inputs = [4.0 * at(1024) - 1.0, at(128) - 0.5, 16.0 * at(256) - 8.0];
            // To 2^-12, which fixed point holds too; the last one at times outside.
            let held = inputs.map(|input| T::from_f64((input * 4096.0).round() / 4096.0));
            network.evaluate(&mut state, &held).to_array().map(Real::value)
        })
        .collect()
}
