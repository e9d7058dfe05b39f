//! Properties that hold for any weights, and the behaviour outside the trained input ranges.

use super::*;
use crate::number::Fixed;
use crate::parameters::{LawKind, ParameterId as Id, Parameters};
use std::vec::Vec;

const INPUTS: usize = 3;
const CELLS: usize = 8;
type Net<T> = Network<T, INPUTS, CELLS>;

/// Pseudo-random numbers in -1..1, identical on every machine.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        f64::from((self.0 >> 16) as u16 as i16) / 32768.0
    }
}

fn network(noise: &mut Noise, size: f64) -> Net<f64> {
    let mut network = Network {
        inputs: [
            InputRange::new(-1.0, 3.0, 0.0),
            InputRange::new(-0.2, 0.2, 0.0),
            InputRange::new(-1.0, 1.0, 0.0),
        ],
        lstm: Lstm::zero(),
        readout: Readout::zero(),
        bounds: [(0.3, 2.0), (0.3, 2.5), (0.05, 4.0)]
            .map(|(least, most)| FactorBounds { least, most }),
        slew: 0.1,
        fade: 0.05,
    };
    assert!(network.set_weights((0..Net::<f64>::WEIGHTS).map(|_| size * noise.next())));
    network
}

fn law<T: Real<Setting = f32>>() -> AugmentedLugre<T> {
    let parameters = Parameters::<f32>::new(LawKind::LugreAsymmetric)
        .with(Id::CoulombTorque, 1.5)
        .with(Id::StaticTorque, 2.2)
        .with(Id::CoulombTorqueNegative, 1.2)
        .with(Id::StaticTorqueNegative, 1.75)
        .with(Id::BristleStiffness, 1e4);
    AugmentedLugre::of(&parameters.build::<T>(1e-3).unwrap()).unwrap()
}

/// Returns a reading inside or outside the range, or NaN.
fn reading(noise: &mut Noise, step: usize) -> f64 {
    match step % 37 {
        11 => f64::NAN,
        23 => f64::INFINITY,
        29 => -1e30,
        _ => 3.0 * noise.next(),
    }
}

fn state_stays_bounded<T: Real<Setting = f32>>() {
    let law = law::<T>();
    let mut noise = Noise(0x2545_F491);
    for size in [0.0, 0.5, 5.0, 50.0] {
        let network = network(&mut noise, size).convert::<T>();
        network.validate().unwrap();
        let largest = law.largest_held_nm(network.bounds[1].most);
        let (mut state, mut held) = (NetworkState::default(), T::zero());
        for step in 0..4000 {
            let inputs = core::array::from_fn(|_| T::from_f64(reading(&mut noise, step)));
            let before = state.factors;
            let factors = network.evaluate(&mut state, &inputs);
            for ((factor, before), bounds) in
                factors.to_array().into_iter().zip(before.to_array()).zip(&network.bounds)
            {
                // The resolution of fixed point is 1e-6.
                assert!(factor.value() >= bounds.least.value() - 1e-5);
                assert!(
                    factor.value()
                        <= network.bounds[1].most.value().max(bounds.most.value()) + 1e-5
                );
                assert!((factor - before).value().abs() <= network.slew.value() + 1e-5);
            }
            for _ in 0..5 {
                let velocity = T::from_f64(4.0 * reading(&mut noise, step));
                let torque = law.step(&mut held, velocity, &factors);
                assert!(held.abs() <= largest, "{held:?} beyond {largest:?}");
                assert!(torque.value().is_finite());
            }
        }
        assert!(state.outside_count > 1000);
    }
}

#[test]
fn held_torque_with_any_weights_stays_within_largest_level() {
    state_stays_bounded::<f32>();
    state_stays_bounded::<Fixed>();
}

#[test]
fn evaluate_outside_ranges_fades_to_constants_and_back() {
    let network = network(&mut Noise(7), 1.0);
    let mut state = NetworkState::default();
    let inside = [1.0, 0.1, -0.5];
    for _ in 0..200 {
        network.evaluate(&mut state, &inside);
    }
    assert!(!state.is_outside && state.outside_count == 0);
    let initial = state.factors;
    assert!(initial.to_array().iter().any(|factor| (factor - 1.0).abs() > 0.05), "{initial:?}");
    for (evaluation, outside) in [[3.1, 0.1, 0.0], [1.0, f64::NAN, 0.0], [1.0, 0.1, 1.01]]
        .into_iter()
        .cycle()
        .take(30)
        .enumerate()
    {
        let before = state.factors;
        network.evaluate(&mut state, &outside);
        assert!(state.is_outside);
        assert_eq!(state.outside_count, evaluation as u32 + 1);
        for (now, before) in state.factors.to_array().into_iter().zip(before.to_array()) {
            assert!((now - before).abs() <= network.slew + 1e-12, "a jump");
        }
    }
    let constant =
        |factors: Factors<f64>| factors.to_array().iter().all(|f| (f - 1.0).abs() < 1e-9);
    assert!(constant(state.factors), "{:?}", state.factors);
    for _ in 0..300 {
        network.evaluate(&mut state, &inside);
    }
    assert!(!state.is_outside && state.outside_count == 30);
    for (now, before) in state.factors.to_array().into_iter().zip(initial.to_array()) {
        assert!((now - before).abs() < 1e-6);
    }
}

#[test]
fn unit_factors_leave_law_bit_identical() {
    let law = law::<f32>();
    let (mut held, mut plain) = (0.0f32, 0.0f32);
    let mut noise = Noise(3);
    for _ in 0..2000 {
        let velocity = noise.next() as f32;
        let torque = law.step(&mut held, velocity, &Factors::default());
        let same = law.0.step_with_effect(&mut plain, velocity, &crate::effect::NoEffect);
        assert_eq!((torque.to_bits(), held.to_bits()), (same.to_bits(), plain.to_bits()));
    }
}

#[test]
fn set_weights_restores_weights_in_order() {
    let network = network(&mut Noise(5), 1.0);
    let mut weights = Vec::new();
    network.for_each_weight(|weight| weights.push(weight));
    assert_eq!(weights.len(), Net::<f64>::WEIGHTS);
    let mut other = network.clone();
    assert!(other.set_weights(weights.iter().map(|weight| weight + 1.0)));
    assert!(other.set_weights(weights.iter().copied()));
    let mut again = Vec::new();
    other.for_each_weight(|weight| again.push(weight));
    assert_eq!(weights, again);
    assert!(!other.set_weights(weights.into_iter().skip(1)));
}

#[test]
fn validate_with_invalid_network_names_the_field() {
    let good = network(&mut Noise(9), 1.0);
    good.validate().unwrap();
    let refused = |change: &dyn Fn(&mut Net<f64>)| {
        let mut network = good.clone();
        change(&mut network);
        network.validate().unwrap_err().field
    };
    assert_eq!(refused(&|n| n.lstm.cells[3].recurrent[2][1] = f64::NAN), "network_weights");
    assert_eq!(refused(&|n| n.readout.bias[2] = 2000.0), "network_weights");
    assert_eq!(refused(&|n| n.inputs[0].per_unit = 0.0), "network_input_per_unit");
    assert_eq!(refused(&|n| n.inputs[0].middle = f64::NAN), "network_input_middle");
    assert_eq!(refused(&|n| n.bounds[0].least = 0.0), "network_factor_least");
    assert_eq!(refused(&|n| n.bounds[0].least = 1.5), "network_factor_least");
    assert_eq!(refused(&|n| n.bounds[2].most = 0.5), "network_factor_most");
    assert_eq!(refused(&|n| n.slew = 0.0), "network_slew");
    assert_eq!(refused(&|n| n.fade = f64::NAN), "network_fade");
}
