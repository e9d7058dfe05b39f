//! A network on the driver: its record over the bus and in flash, its factors in the law, the guard of its inputs.

use super::bench::{Bench, Flash, NODE};
use super::{STATE_REFUSED, frame};
use compensator_core::can::{Message, Motion, Surroundings, Sync};
use compensator_core::compensator::Reading;
use compensator_core::configuration::Configuration;
use compensator_core::network::record as network_record;
use compensator_core::network::{Network, NetworkState, Stroke, reference};
use compensator_core::{Compensator, Fixed, Flags, Inputs, Real, record};
use firmware::control::Covariates;
use firmware::driver::{Boot, LoopReport};
use firmware::node::dictionary::records::NetworkState as Object;
use firmware::node::dictionary::{SAVE, index};
use firmware::node_settings::Source;
use firmware::parameter_set::ParameterSet;

fn supplied() -> ParameterSet {
    let mut set = ParameterSet::default();
    set.friction.model = reference::parameters();
    set.network = Some(reference::joint());
    set
}

/// Gives the driver the set, in records, as a tool does.
fn send(bench: &mut Bench, set: &ParameterSet) -> Result<(), u32> {
    bench.write(index::COMMIT, 5, &record::emit(&set.friction))?;
    bench.write(index::COMMIT, 7, &network_record::emit(set.network.as_ref()))?;
    bench.write(index::COMMIT, 3, &set.crc().to_le_bytes())
}

fn float(bench: &mut Bench, sub_index: u8) -> f32 {
    f32::from_bits(bench.number(index::NETWORK, sub_index))
}

#[test]
fn a_network_goes_in_is_kept_in_flash_and_comes_out() {
    let mut bench = Bench::hil();
    assert_eq!(bench.read(index::COMMIT, 7).unwrap(), network_record::emit(None).as_slice());
    assert_eq!(bench.number(index::NETWORK, 1), 0);
    let set = supplied();
    send(&mut bench, &set).unwrap();
    assert_eq!(bench.driver.set(), &set);
    assert_eq!(bench.number(index::NETWORK, 1), 1);
    bench.write(index::STORE, 1, &SAVE.to_le_bytes()).unwrap();
    let mut bench = Bench::boot(Source::Bus, bench.driver.into_flash(), &Boot::default());
    assert_eq!(bench.driver.set(), &set);
    assert_eq!(
        bench.read(index::COMMIT, 7).unwrap(),
        network_record::emit(set.network.as_ref()).as_slice()
    );
    // Taken away again: the same law at its constants.
    let bare = ParameterSet { network: None, ..set.clone() };
    send(&mut bench, &bare).unwrap();
    assert_eq!(bench.driver.set(), &bare);
    assert_eq!(bench.number(index::NETWORK, 1), 0);
}

#[test]
fn what_is_damaged_or_does_not_fit_its_law_is_refused_and_nothing_changes() {
    let mut bench = Bench::hil();
    let before = bench.driver.set().clone();
    let set = supplied();
    let mut damaged = network_record::emit(set.network.as_ref());
    damaged[700] ^= 1;
    assert_eq!(bench.write(index::COMMIT, 7, &damaged), Err(0x0609_0030));
    assert_eq!(bench.text(index::REFUSAL), "network's record is damaged (CRC)");
    assert_eq!(bench.write(index::COMMIT, 7, &damaged[..500]), Err(0x0609_0030));
    // Longer than any value.
    let long = [damaged.as_slice(), &[0; 8]].concat();
    assert_eq!(bench.write(index::COMMIT, 7, &long), Err(0x0504_0005));
    // A network for another law: whole, and refused with it.
    let other = ParameterSet { friction: before.friction.clone(), ..set.clone() };
    assert_eq!(send(&mut bench, &other), Err(0x0609_0030));
    let reason = bench.text(index::REFUSAL);
    assert!(reason.contains("a network supplies lugre-asymmetric without terms"), "{reason}");
    bench.write(index::COMMIT, 4, &[1]).unwrap();
    assert_eq!(bench.number(index::COMMIT, 1), bench.number(index::COMMIT, 2));
    assert_eq!(bench.driver.set(), &before);
    // Samples farther apart than the evaluations of training.
    send(&mut bench, &set).unwrap();
    assert_eq!(bench.write(index::OPERATION, 3, &0.05f32.to_le_bytes()), Err(0x0609_0030));
    assert!(bench.text(index::REFUSAL).starts_with("network_period_s = "));
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    let record = network_record::emit(None);
    assert_eq!(bench.write(index::COMMIT, 7, &record), Err(STATE_REFUSED));
}

#[test]
fn a_power_cut_while_a_network_is_saved_leaves_the_old_set_or_the_new() {
    let mut bench = Bench::hil();
    let set = supplied();
    send(&mut bench, &set).unwrap();
    bench.write(index::STORE, 1, &SAVE.to_le_bytes()).unwrap();
    let flash = bench.driver.into_flash();
    let mut newer = set.clone();
    newer.network.as_mut().unwrap().network.readout.bias[0] = 0.5;
    let (mut olds, mut news) = (0, 0);
    // Every seventh step; the last one, at which nothing is cut any more, among them or after them.
    for step in (0..400).step_by(7) {
        let mut cut: Flash = flash.clone();
        cut.cut(step, firmware::store::memory::Torn::Nothing);
        let mut bench = Bench::boot(Source::Bus, cut, &Boot::default());
        send(&mut bench, &newer).unwrap();
        let saved = bench.write(index::STORE, 1, &SAVE.to_le_bytes());
        let mut flash = bench.driver.into_flash();
        assert_eq!(saved.is_err(), !flash.has_power());
        flash.power_on();
        let bench = Bench::boot(Source::Bus, flash, &Boot::default());
        let found = bench.driver.set();
        assert!(*found == set || *found == newer, "step {step}");
        olds += u32::from(*found == set);
        news += u32::from(*found == newer);
    }
    assert!(olds > 30 && news > 2, "{olds} old, {news} new");
}

/// The law and the network put together by hand, of the core's parts.
struct ByHand<T: Real> {
    network: Network<T, 3, 8>,
    state: NetworkState<T, 8>,
    stroke: Stroke<T>,
    compensator: Compensator<T>,
}

impl<T: Real<Setting = f32>> ByHand<T> {
    fn new(friction: &Configuration, period_s: f32) -> Self {
        let mut compensator = Compensator::build(friction, period_s).expect("builds");
        compensator.set_enabled(true);
        Self {
            network: reference::network(),
            state: NetworkState::default(),
            stroke: Stroke::default(),
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
            let fed = [number(auxiliary), number(velocity), self.compensator.bristle_torque_nm()];
            let factors = self.network.evaluate_where(&mut self.state, &fed, is_known);
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

fn gives_the_core_s_bits<T: Real<Setting = f32>>(number: u8) {
    let mut bench = Bench::hil();
    let set = supplied();
    let period_s = 1.0 / 512.0;
    bench.write(index::OPERATION, 3, &f32::to_le_bytes(period_s)).unwrap();
    bench.write(index::OPERATION, 2, &[number]).unwrap();
    send(&mut bench, &set).unwrap();
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    let mut core = ByHand::<T>::new(&set.friction, period_s);
    let mut factors_seen = 0;
    for sequence in 0..4000u32 {
        let at = sequence as f32 * period_s;
        // To and fro, at times farther than it was trained on, under a covariate that leaves its range at times.
        let velocity = 0.3 * (2.0 * at).sin() + if sequence > 3000 { 0.3 } else { 0.0 };
        let auxiliary = 1.0 + 2.2 * (0.9 * at).sin();
        bench.give(Message::Motion(
            NODE,
            Motion { velocity_rad_s: velocity, position_rad: f32::NAN },
        ));
        let temperature_c = f32::NAN;
        bench.give(Message::Surroundings(NODE, Surroundings { temperature_c, auxiliary }));
        bench.give(Message::Sync(Sync::of(sequence)));
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
    // The guard as an object: what the core counted, and the factors in force.
    let words = bench.number(index::NETWORK, Object::OUTSIDE_COUNT);
    assert_eq!(words, core.state.outside_count);
    assert!((50..900).contains(&words), "{words} evaluations outside");
    assert_eq!(bench.number(index::NETWORK, Object::OUTSIDE), u32::from(core.state.is_outside));
    assert_eq!(float(&mut bench, Object::SHARE), core.state.share.value() as f32);
    assert_eq!(float(&mut bench, 5), core.state.factors.coulomb.value() as f32);
}

#[test]
fn a_supplied_joint_gives_the_bits_of_the_core_s_parts_in_both_numbers() {
    gives_the_core_s_bits::<f32>(0);
    if cfg!(feature = "fixed") {
        gives_the_core_s_bits::<Fixed>(1);
    }
}

#[test]
fn a_joint_on_its_sensors_is_supplied_at_the_rate_of_training_while_it_compensates() {
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
    let fed =
        |auxiliary: f32| Covariates { auxiliary: Reading::fresh(auxiliary), ..Covariates::none() };
    let mut counter = 0u8;
    let mut pass = |bench: &mut Bench, velocity: f32, auxiliary: f32| {
        counter = u8::wrapping_add(counter, 1);
        bench.driver.report(&report(velocity));
        let command = compensator_core::can::Command::new(1.0, 0.0, counter);
        bench.give(Message::Command(NODE, command));
        bench.pass_ms(1);
        bench.driver.supply(&fed(auxiliary), bench.now_us)
    };
    for _ in 0..20 {
        assert_eq!(pass(&mut bench, 0.1, 1.0), None);
    }
    bench.write(index::STATE, 1, &[1]).unwrap();
    // A stroke of 0.03, known from 0.01 on; then factors move at 128 Hz.
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
    // The covariate leaves its range: told, and faded out in a third of a second.
    for _ in 0..500 {
        pass(&mut bench, 0.03, 9.0);
    }
    assert_eq!(bench.number(index::NETWORK, Object::OUTSIDE), 1);
    let after = bench.number(index::NETWORK, Object::OUTSIDE_COUNT);
    assert!((62..=65).contains(&(after - before)), "{}", after - before);
    let factors = pass(&mut bench, 0.03, 9.0).expect("it compensates");
    assert!(factors.to_array().iter().all(|factor| (factor - 1.0).abs() < 1e-5), "{factors:?}");
    // The status of the next sample says so.
    bench.sent();
    bench.give(Message::Sync(Sync::of(0)));
    let is_told = |message: &Message| matches!(message, Message::Status(_, status) if status.flags.contains(Flags::NETWORK_OUTSIDE));
    assert!(bench.messages().iter().any(is_told));
    // A stop of the bus disarms it, and the network rests.
    bench.driver.receive(&frame(0, &[2, 0]), bench.now_us);
    assert_eq!(pass(&mut bench, 0.03, 1.0), None);
}
