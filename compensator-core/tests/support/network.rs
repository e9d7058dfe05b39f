//! A network of given weights on given inputs, in any number.

use compensator_core::Real;
use compensator_core::network::{FactorBounds, InputRange, Lstm, Network, NetworkState, Readout};

/// Evaluations of a run.
const EVALUATIONS: usize = 10_000;

/// The factors of every evaluation, the inputs the same in every number.
pub fn factors<T: Real>() -> Vec<[f64; 3]> {
    let bounds = [(0.2, 2.5), (0.2, 3.0), (0.02, 4.0)];
    let mut network: Network<T, 3, 8> = Network {
        inputs: [(-1.0, 3.0), (-0.5, 0.5), (-8.0, 8.0)]
            .map(|(least, most)| InputRange::new(least, most, 0.0)),
        lstm: Lstm::zero(),
        readout: Readout::zero(),
        bounds: bounds.map(|(least, most)| FactorBounds {
            least: T::from_f64(least),
            most: T::from_f64(most),
        }),
        slew: T::from_f64(0.5),
        fade: T::from_f64(0.03125),
    };
    // Of the size training leaves: up to 1, in steps that every number holds exactly.
    let weight = |index: usize| ((index * 2_654_435_761 % 65_536) as f64 - 32_768.0) / 32_768.0;
    assert!(network.set_weights((0..).map(|index| T::from_f64(weight(index)))));
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
