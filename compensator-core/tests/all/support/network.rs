//! Factors of the reference network for fixed inputs, in any number type.

use compensator_core::Real;
#[path = "../../../../tests/reference_network.rs"]
mod reference;

use compensator_core::network::NetworkState;

/// Number of evaluations.
const EVALUATIONS: usize = 10_000;

/// Returns the factors of every evaluation. The inputs are equal in all number types.
pub fn factors<T: Real>() -> Vec<[f64; 3]> {
    let network = reference::network::<T>();
    let mut state = NetworkState::default();
    (0..EVALUATIONS)
        .map(|step| {
            let at = |period: usize| (step % period) as f64 / period as f64;
            let inputs = [4.0 * at(1024) - 1.0, at(128) - 0.5, 16.0 * at(256) - 8.0];
            // Rounded to 2^-12, which fixed point represents exactly.
            let rounded = inputs.map(|input| T::from_f64((input * 4096.0).round() / 4096.0));
            network.evaluate(&mut state, &rounded).to_array().map(Real::value)
        })
        .collect()
}
