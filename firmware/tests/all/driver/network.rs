//! Tests of a network on the driver: its record over the bus and in flash, its factors in the law, its input
//! guard.

use super::bench::{Bench, Flash, NODE};
use super::{STATE_REFUSED, frame};
use crate::reference_network as reference;
use compensator_core::can::{Message, MotionFrame, SurroundingsFrame, SyncFrame};
use compensator_core::compensator::Reading;
use compensator_core::configuration::Configuration;
use compensator_core::network::record as network_record;
use compensator_core::network::{Network, NetworkState, StrokeTracker};
use compensator_core::{Compensator, Fixed, Flags, Inputs, Real, record};
use firmware::control::Covariates;
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::records::NetworkObject as Object;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;
use firmware::parameter_set::ParameterSet;

fn supplied() -> ParameterSet {
    let mut set = ParameterSet::default();
    set.friction.model = reference::parameters();
    set.network = Some(reference::joint());
    set
}

/// Sends the set to the driver as records, as a tool does.
fn send(bench: &mut Bench, set: &ParameterSet) -> Result<(), u32> {
    bench.write(index::COMMIT, 5, &record::emit(&set.friction))?;
    bench.write(index::COMMIT, 7, &network_record::emit(set.network.as_ref()))?;
    bench.write(index::COMMIT, 3, &set.crc().to_le_bytes())
}

fn float(bench: &mut Bench, sub_index: u8) -> f32 {
    f32::from_bits(bench.number(index::NETWORK, sub_index))
}

#[test]
fn network_record_is_stored_and_read_back() {
    let mut bench = Bench::hil();
    assert_eq!(bench.read(index::COMMIT, 7).unwrap(), network_record::emit(None).as_slice());
    assert_eq!(bench.number(index::NETWORK, 1), 0);
    let set = supplied();
    send(&mut bench, &set).unwrap();
    assert_eq!(bench.driver.joint.set(), &set);
    assert_eq!(bench.number(index::NETWORK, 1), 1);
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    let mut bench =
        Bench::boot(InputSource::Bus, bench.driver.joint.into_flash(), &Boot::default());
    assert_eq!(bench.driver.joint.set(), &set);
    assert_eq!(
        bench.read(index::COMMIT, 7).unwrap(),
        network_record::emit(set.network.as_ref()).as_slice()
    );
    // Without the network, the law uses its constants.
    let bare = ParameterSet { network: None, ..set.clone() };
    send(&mut bench, &bare).unwrap();
    assert_eq!(bench.driver.joint.set(), &bare);
    assert_eq!(bench.number(index::NETWORK, 1), 0);
}

#[test]
fn network_that_is_damaged_or_does_not_fit_its_law_is_refused() {
    let mut bench = Bench::hil();
    let before = bench.driver.joint.set().clone();
    let set = supplied();
    let mut damaged = network_record::emit(set.network.as_ref());
    damaged[700] ^= 1;
    assert_eq!(bench.write(index::COMMIT, 7, &damaged), Err(0x0609_0030));
    bench.check_refusal("damaged record of a network", &["CRC"]);
    assert_eq!(bench.write(index::COMMIT, 7, &damaged[..500]), Err(0x0609_0030));
    // The record is longer than any value.
    let long = [damaged.as_slice(), &[0; 8]].concat();
    assert_eq!(bench.write(index::COMMIT, 7, &long), Err(0x0504_0005));
    // A valid network for another law is refused.
    let other = ParameterSet { friction: before.friction.clone(), ..set.clone() };
    assert_eq!(send(&mut bench, &other), Err(0x0609_0030));
    bench.check_refusal("network for another law", &["lugre-asymmetric"]);
    bench.write(index::COMMIT, 4, &[1]).unwrap();
    assert_eq!(bench.number(index::COMMIT, 1), bench.number(index::COMMIT, 2));
    assert_eq!(bench.driver.joint.set(), &before);
    // The samples are farther apart than the evaluations of the training.
    send(&mut bench, &set).unwrap();
    assert_eq!(bench.write(index::OPERATION, 3, &0.05f32.to_le_bytes()), Err(0x0609_0030));
    assert!(bench.text(index::REFUSAL).starts_with("network_period_s = "));
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    let record = network_record::emit(None);
    assert_eq!(bench.write(index::COMMIT, 7, &record), Err(STATE_REFUSED));
}

#[test]
fn power_cut_while_saving_a_network_keeps_one_complete_set() {
    let mut bench = Bench::hil();
    let set = supplied();
    send(&mut bench, &set).unwrap();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    let flash = bench.driver.joint.into_flash();
    let mut newer = set.clone();
    newer.network.as_mut().unwrap().network.readout.bias[0] = 0.5;
    let (mut olds, mut news) = (0, 0);
    // Every seventh step is cut, up to and beyond the last step of a save.
    for step in (0..400).step_by(7) {
        let mut cut: Flash = flash.clone();
        cut.cut_power(step, firmware::store::memory::TornStep::Nothing);
        let mut bench = Bench::boot(InputSource::Bus, cut, &Boot::default());
        send(&mut bench, &newer).unwrap();
        let saved = bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes());
        let mut flash = bench.driver.joint.into_flash();
        assert_eq!(saved.is_err(), !flash.has_power());
        flash.power_on();
        let bench = Bench::boot(InputSource::Bus, flash, &Boot::default());
        let found = bench.driver.joint.set();
        assert!(*found == set || *found == newer, "step {step}");
        olds += u32::from(*found == set);
        news += u32::from(*found == newer);
    }
    assert!(olds > 30 && news > 2, "{olds} old, {news} new");
}

/// Law and network of the core, combined by hand.
struct ReferenceJoint<T: Real> {
    network: Network<T, 3, 8>,
    state: NetworkState<T, 8>,
    stroke: StrokeTracker<T>,
    compensator: Compensator<T>,
}

impl<T: Real<Setting = f32>> ReferenceJoint<T> {
    fn new(friction: &Configuration, period_s: f32) -> Self {
        let mut compensator = Compensator::build(friction, period_s).expect("builds");
        compensator.set_enabled(true);
        Self {
            network: reference::network(),
            state: NetworkState::default(),
            stroke: StrokeTracker::default(),
            compensator,
        }
    }

    fn step(&mut self, evaluates: bool, velocity: f32, auxiliary: f32) -> [u32; 3] {
        let number = T::from_setting;
        if evaluates {
            let strokes = reference::joint().strokes.expect("it has some");
            let strokes = compensator_core::network::StrokeRange {
                least: number(strokes.least),
                most: number(strokes.most),
                reversal: number(strokes.reversal),
                period_s: number(strokes.period_s),
            };
            let is_known = self.stroke.is_known(number(velocity), &strokes);
            let network_inputs =
                [number(auxiliary), number(velocity), self.compensator.bristle_torque_nm()];
            let factors = self.network.evaluate_guarded(&mut self.state, &network_inputs, is_known);
            self.compensator.supply(Some(factors));
        }
        let inputs = Inputs {
            velocity_rad_s: Reading::fresh(number(velocity)),
            auxiliary: Reading::fresh(number(auxiliary)),
            ..Inputs::missing()
        };
        let output = self.compensator.step(&inputs);
        let mut flags = output.flags;
        flags.set(Flags::NETWORK_OUTSIDE, self.state.is_outside);
        let word = |value: T| (value.value() as f32).to_bits();
        [word(output.friction_torque_nm), word(output.feed_forward_current_a), flags.bits()]
    }
}

fn check_core_bits<T: Real<Setting = f32>>(number: u8) {
    let mut bench = Bench::hil();
    let set = supplied();
    let period_s = 1.0 / 512.0;
    bench.write(index::OPERATION, 3, &f32::to_le_bytes(period_s)).unwrap();
    bench.write(index::OPERATION, 2, &[number]).unwrap();
    send(&mut bench, &set).unwrap();
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    let mut core = ReferenceJoint::<T>::new(&set.friction, period_s);
    let mut factors_seen = 0;
    for sequence in 0..4000u32 {
        let at = sequence as f32 * period_s;
        // The joint moves back and forth, sometimes farther than in the training, and the covariate sometimes
        // leaves its range.
        let velocity = 0.3 * (2.0 * at).sin() + if sequence > 3000 { 0.3 } else { 0.0 };
        let auxiliary = 1.0 + 2.2 * (0.9 * at).sin();
        bench.give(Message::Motion(
            NODE,
            MotionFrame { velocity_rad_s: velocity, position_rad: f32::NAN },
        ));
        let temperature_c = f32::NAN;
        bench.give(Message::Surroundings(NODE, SurroundingsFrame { temperature_c, auxiliary }));
        bench.give(Message::Sync(SyncFrame::of(sequence)));
        let answers = bench.messages();
        let [Message::Answer(_, answer), Message::Status(_, status), ..] = answers[..] else {
            panic!("{answers:?}")
        };
        let found = [
            answer.friction_torque_nm.to_bits(),
            answer.feed_forward_current_a.to_bits(),
            status.flags.bits(),
        ];
        let expected = core.step(sequence % 4 == 0, velocity, auxiliary);
        assert_eq!(found, expected, "sample {sequence}");
        factors_seen += u32::from(core.state.factors.to_array()[0].value() != 1.0);
    }
    assert!(factors_seen > 1000, "{factors_seen} samples under factors");
    // The guard object: count of the core, and the factors in use.
    let words = bench.number(index::NETWORK, Object::OUTSIDE_COUNT);
    assert_eq!(words, core.state.outside_count);
    assert!((50..900).contains(&words), "{words} evaluations outside");
    assert_eq!(bench.number(index::NETWORK, Object::OUTSIDE), u32::from(core.state.is_outside));
    assert_eq!(float(&mut bench, Object::SHARE), core.state.share.value() as f32);
    assert_eq!(float(&mut bench, 5), core.state.factors.coulomb.value() as f32);
}

#[test]
fn supplied_joint_matches_the_core_bit_for_bit_in_both_number_types() {
    check_core_bits::<f32>(0);
    if cfg!(feature = "fixed") {
        check_core_bits::<Fixed>(1);
    }
}

#[test]
fn network_on_sensors_is_evaluated_at_the_training_rate_while_compensating() {
    let mut bench = Bench::on_sensors();
    bench.start();
    send(&mut bench, &supplied()).unwrap();
    bench.commission();
    let report = |velocity_rad_s: f32| LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        bridge_temperature_c: Some(30.0),
        motor_temperature_c: Some(30.0),
        sample_age_us: Some(10),
        position_rad: 0.25,
        velocity_rad_s,
        bristle_torque_nm: 1.0,
        ..LoopReport::default()
    };
    let with_auxiliary =
        |auxiliary: f32| Covariates { auxiliary: Reading::fresh(auxiliary), ..Covariates::MISSING };
    let mut counter = 0u8;
    let mut pass = |bench: &mut Bench, velocity: f32, auxiliary: f32| {
        counter = u8::wrapping_add(counter, 1);
        bench.driver.joint.report(&report(velocity));
        let command = compensator_core::can::CommandFrame::new(1.0, 0.0, counter);
        bench.give(Message::Command(NODE, command));
        bench.pass_ms(1);
        bench.driver.joint.supply(&with_auxiliary(auxiliary), bench.now_us)
    };
    for _ in 0..20 {
        assert_eq!(pass(&mut bench, 0.1, 1.0), None);
    }
    bench.write(index::STATE, 1, &[1]).unwrap();
    // A stroke of 0.03 is known from 0.01 on; then the factors change at 128 Hz.
    let mut changes = 0;
    let mut last = None;
    for tick in 0..1000 {
        let velocity = 0.03 + 0.02 * (0.01 * tick as f32).sin();
        let factors = pass(&mut bench, velocity, 1.0).expect("it compensates");
        changes += u32::from(last != Some(factors));
        last = Some(factors);
    }
    assert!((120..=129).contains(&changes), "{changes} other factors in a second");
    assert_eq!(bench.number(index::NETWORK, Object::OUTSIDE), 0);
    let before = bench.number(index::NETWORK, Object::OUTSIDE_COUNT);
    // The covariate leaves its range: reported, and faded out in a third of a second.
    for _ in 0..500 {
        pass(&mut bench, 0.03, 9.0);
    }
    assert_eq!(bench.number(index::NETWORK, Object::OUTSIDE), 1);
    let after = bench.number(index::NETWORK, Object::OUTSIDE_COUNT);
    assert!((62..=65).contains(&(after - before)), "{}", after - before);
    let factors = pass(&mut bench, 0.03, 9.0).expect("it compensates");
    assert!(factors.to_array().iter().all(|factor| (factor - 1.0).abs() < 1e-5), "{factors:?}");
    // The status of the next sample reports it.
    bench.sent();
    bench.give_ten_syncs();
    let is_reported = |message: &Message| matches!(message, Message::Status(_, status) if status.flags.contains(Flags::NETWORK_OUTSIDE));
    assert!(bench.messages().iter().any(is_reported));
    // A stop of the network disarms the joint, and the network of the law rests.
    bench.driver.receive(&frame(0, &[2, 0]), bench.now_us);
    assert_eq!(pass(&mut bench, 0.03, 1.0), None);
}
