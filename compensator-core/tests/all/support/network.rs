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
            // Multiples of 2^-8, which fixed point represents exactly. They repeat, but the state of the network does not.
            let share = |period: usize| (step % period) as f64 / period as f64;
            let inputs = [4.0 * share(1024) - 1.0, share(128) - 0.5, 16.0 * share(256) - 8.0];
            network.evaluate(&mut state, &inputs.map(T::from_f64)).to_array().map(Real::value)
        })
        .collect()
}
