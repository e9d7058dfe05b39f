use super::super::reference;
use super::*;
use crate::number::Fixed;
use crate::parameters::LawKind;
use crate::parameters::Parameters;
use crate::quantity::Reading;

fn inputs<T: Real>(auxiliary: f64, velocity: f64) -> Inputs<T> {
    Inputs {
        velocity_rad_s: Reading::fresh(T::from_f64(velocity)),
        auxiliary: Reading::fresh(T::from_f64(auxiliary)),
        ..Inputs::missing()
    }
}

#[test]
fn widened_network_gives_bit_identical_factors() {
    fn run<T: Real<Setting = f32>>() {
        let small = reference::network::<T>();
        let mut joint = reference::joint();
        joint.strokes = None;
        let mut wide = FactorSupplier::<T>::build(&joint, 0.1).unwrap();
        let mut state = NetworkState::default();
        for step in 0..2000 {
            let at = |period: i32| f64::from(step % period) / f64::from(period);
            let [auxiliary, velocity, held] =
                [4.4 * at(331) - 1.2, at(128) - 0.5, 16.0 * at(77) - 8.0];
            let values = [auxiliary, velocity, held].map(T::from_f64);
            let expected = small.evaluate(&mut state, &values);
            let found = wide.evaluate(&inputs(auxiliary, velocity), T::from_f64(held));
            assert_eq!(found, expected);
            assert_eq!(wide.state().outside_count, state.outside_count);
        }
        assert!(state.outside_count > 50 && state.outside_count < 1000);
    }
    run::<f32>();
    run::<Fixed>();
}

#[test]
fn evaluate_with_missing_reading_or_unknown_stroke_counts_as_outside() {
    let mut joint = reference::joint();
    joint.strokes = None;
    let mut supplier = FactorSupplier::<f32>::build(&joint, 0.1).unwrap();
    let mut outside = |auxiliary: Reading<f32>| {
        supplier.rest();
        let before = supplier.state().outside_count;
        supplier.evaluate(&Inputs { auxiliary, ..inputs(0.0, 0.1) }, 1.0);
        supplier.state().outside_count - before
    };
    assert_eq!(outside(Reading { value: 1.0, age_s: 0.05 }), 0);
    assert_eq!(outside(Reading { value: 1.0, age_s: 0.2 }), 1);
    assert_eq!(outside(Reading { value: f32::NAN, age_s: 0.0 }), 1);
    assert_eq!(outside(Reading { value: 1.0, age_s: f32::NAN }), 1);
    assert_eq!(outside(Reading::missing()), 1);
    // With stroke tracking, a joint at rest has no known stroke.
    let mut watching = FactorSupplier::<f32>::build(&reference::joint(), 0.1).unwrap();
    for _ in 0..100 {
        watching.evaluate(&inputs(1.0, 0.0), 0.0);
    }
    assert_eq!(watching.state().outside_count, 100);
    assert_eq!(watching.state().factors.to_array(), [1.0; 3]);
}

#[test]
fn every_with_too_long_sample_period_returns_error() {
    let supplier = FactorSupplier::<f32>::build(&reference::joint(), 0.1).unwrap();
    assert_eq!(supplier.every(1.0 / 256.0).unwrap(), 2);
    assert_eq!(supplier.every(1e-3).unwrap(), 8);
    assert_eq!(supplier.every(1.0 / 128.0).unwrap(), 1);
    assert_eq!(supplier.every(0.02).unwrap_err().field, "network_period_s");
}

#[test]
fn validate_with_invalid_network_names_the_field() {
    let good = reference::joint();
    good.validate().unwrap();
    let refused = |change: &dyn Fn(&mut JointNetwork)| {
        let mut network = good.clone();
        change(&mut network);
        network.validate().unwrap_err().field
    };
    assert_eq!(refused(&|n| n.feeds.clear()), "network_inputs");
    assert_eq!(refused(&|n| n.period_s = f32::NAN), "network_period_s");
    assert_eq!(refused(&|n| n.strokes.as_mut().unwrap().most = 0.001), "network_stroke_most");
    assert_eq!(refused(&|n| n.network.slew = 2.0), "network_slew");
    // Fixed point represents values up to 2048.
    let mut wide = good.clone();
    wide.network.inputs[0].middle = 1e5;
    assert!(FactorSupplier::<f32>::build(&wide, 0.1).is_ok());
    let error = FactorSupplier::<Fixed>::build(&wide, 0.1).unwrap_err();
    assert_eq!(error.field, "network_input_middle");
    // Only `lugre-asymmetric` without terms accepts factors.
    assert!(JointNetwork::validate_with(&reference::parameters()).is_ok());
    let mut ripple = reference::parameters();
    ripple.add_term(crate::TermKind::TorqueOffset);
    for other in [Parameters::<f32>::new(LawKind::Lugre), ripple] {
        assert!(JointNetwork::validate_with(&other).is_err());
    }
}

#[test]
fn input_source_number_is_unique() {
    let sources: std::vec::Vec<InputSource> =
        (0..=255).filter_map(InputSource::from_number).collect();
    assert_eq!(sources.len(), 8);
    for source in sources {
        assert_eq!(InputSource::from_number(source.number().unwrap()), Some(source));
    }
    assert_eq!(InputSource::Of(Quantity::CampaignTime).number(), None);
}
