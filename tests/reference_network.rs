//! The reference network of the cost, bit-identity and accuracy tests: three inputs, eight cells, random weights.
//!
//! The cost of a network does not depend on its weights, and its bits must agree for any weights. A test program includes this
//! file with `#[path]`.

#![allow(dead_code, reason = "each program uses a part")]

use compensator_core::network::{
    AugmentedLugre, CELLS, FactorBounds, InputRange, InputSource, JointNetwork, Lstm, Network,
    Readout, StrokeRange,
};
use compensator_core::{LawKind, ParameterId as Id, Parameters, Quantity, Real};

/// Number of inputs.
pub const INPUTS: usize = 3;

/// Returns the reference network.
pub fn network<T: Real>() -> Network<T, INPUTS, CELLS> {
    let bounds = [(0.2, 2.5), (0.2, 3.0), (0.02, 4.0)];
    let mut network = Network {
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
    // Xorshift (Marsaglia 2003): weights in -1..1 with 16 bits, exact in every number type.
    let mut generator = 0x9E37_79B9u32;
    let weights = core::iter::repeat_with(|| {
        generator ^= generator << 13;
        generator ^= generator >> 17;
        generator ^= generator << 5;
        T::from_f64(f64::from((generator >> 16) as u16 as i16) / 32768.0)
    });
    let is_whole = network.set_weights(weights);
    debug_assert!(is_whole);
    network
}

/// Returns the reference network for a driver.
///
/// Its inputs are the auxiliary covariate, the velocity and the torque held by the bristles. It is evaluated at
/// 128 Hz and knows strokes from 0.01 rad to 1 rad.
pub fn joint() -> JointNetwork {
    let feeds = [
        InputSource::Of(Quantity::Auxiliary),
        InputSource::Of(Quantity::Velocity),
        InputSource::Held,
    ];
    let period_s = 1.0 / 128.0;
    JointNetwork {
        feeds: feeds.into_iter().collect(),
        period_s,
        strokes: Some(StrokeRange { least: 0.01, most: 1.0, reversal: 5e-4, period_s }),
        network: network::<f32>().widened(),
    }
}

/// Returns the parameters of the law to which the factors apply.
pub fn parameters() -> Parameters<f32> {
    Parameters::<f32>::new(LawKind::LugreAsymmetric)
        .with(Id::CoulombTorque, 1.5)
        .with(Id::StaticTorque, 2.2)
        .with(Id::CoulombTorqueNegative, 1.25)
        .with(Id::StaticTorqueNegative, 1.75)
        .with(Id::StribeckVelocity, 0.1)
        .with(Id::BristleStiffness, 500.0)
        .with(Id::ViscousFriction, 0.08)
}

/// Returns the law for a sample period in s, or `None` if the number type cannot represent it.
pub fn law<T: Real<Setting = f32>>(period_s: f32) -> Option<AugmentedLugre<T>> {
    AugmentedLugre::of(&parameters().build::<T>(period_s).ok()?)
}
