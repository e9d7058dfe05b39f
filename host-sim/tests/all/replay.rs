//! Replay of a trace to a driver in this process: answers are bit-identical to the core, and every fault is detected.

use canopen_rs::Address;
use compensator_core::can::{Message, MotionFrame, NodeId, SealFrame, SyncFrame};
use compensator_core::configuration::Configuration;
use compensator_core::{LawKind, ParameterId, TermKind};
use firmware::hil::NumberType;
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use joint_bus::bus::{FaultInjector, FaultPlan, Faults, Hub, Port, Recorder};
use joint_bus::canopen::Client;
use joint_bus::joint::JointNode;
use joint_bus::replay::{Check, Plan, PlayResult, Rate, ReplaySetup, play, set_up};
use joint_trace::{CanFrame, Fraction, Line, candump};

const NODE: NodeId = NodeId::FIRST;
/// Entry of the operation object.
const FD_TELEMETRY: u8 = 9;

/// A trace of a joint that moves back and forth under pressure, `count` samples at 1 kHz.
fn log(count: u32) -> Vec<u8> {
    let mut out = Vec::new();
    let mut line = |time_ns: u64, message: Message| {
        let frame = CanFrame::from(message.emit());
        let line = Line { time_ns, interface: b"can0", frame, direction: None };
        candump::emit(&line, Fraction::Nanoseconds, &mut out);
    };
    for sequence in 0..count {
        let time_ns = 5_000_000_000 + u64::from(sequence) * 1_000_000;
        let phase = sequence as f32 * 0.01;
        let motion =
            MotionFrame { velocity_rad_s: 1.5 * phase.sin(), position_rad: -150.0 * phase.cos() };
        line(time_ns, Message::Motion(NODE, motion));
        if sequence.is_multiple_of(10) {
            let seal = SealFrame { radial_force_n: 40.0, pressure_diff_pa: 1e5 + 100.0 * phase };
            line(time_ns, Message::Seal(NODE, seal));
        }
        line(time_ns, Message::Sync(SyncFrame::of(sequence)));
    }
    out
}

fn improved() -> Configuration {
    let mut friction = ParameterSet::default().friction;
    friction.model.law = LawKind::ImprovedLugre;
    friction.model.set(ParameterId::PressureCoulomb, 2e-6);
    friction.model.set(ParameterId::RippleSine, 0.05);
    friction.model.set(ParameterId::RippleOrder, 3.0);
    friction.model.envelope.position_max_rad = 500.0;
    friction.model.add_term(TermKind::PositionRipple);
    friction.model.add_term(TermKind::DwellTimeStatic);
    friction
}

fn client(faults: FaultPlan, seed: u64) -> Client<FaultInjector<Port>> {
    let hub = Hub::new();
    hub.attach(JointNode::start(NODE, None).expect("no file"));
    Client::new(FaultInjector::new(hub.port(), faults, seed), NODE)
}

fn replayed(log: &[u8], setup: &ReplaySetup, rate: Rate, faults: Faults, seed: u64) -> PlayResult {
    let plan = Plan::parse(log, NODE).expect("a log");
    let hub = Hub::new();
    hub.attach(JointNode::start(NODE, None).expect("no file"));
    let mut client = Client::new(hub.port(), NODE);
    let core = set_up(&mut client, NODE, setup).expect("a driver that answers");
    let faults = FaultPlan { sent: faults, received: faults };
    let mut bus = FaultInjector::new(client.into_bus(), faults, seed);
    play(&mut bus, &plan, rate, Check::new(NODE, core), &mut |_| {}).expect("a bus")
}

fn setup(number: NumberType) -> ReplaySetup {
    ReplaySetup {
        friction: Some(improved()),
        network: None,
        number: Some(number),
        period_s: 1e-3,
        adaptation: None,
    }
}

#[test]
fn replay_with_any_number_type_and_rate_is_bit_identical() {
    let log = log(5000);
    for number in [NumberType::Float, NumberType::Fixed] {
        for rate in [Rate::Times(1.0), Rate::Times(20.0), Rate::Max] {
            let played = replayed(&log, &setup(number), rate, Faults::default(), 1);
            assert!(played.tally.holds(), "{number:?} {rate:?}: {:?}", played.tally);
            assert_eq!((played.tally.equal, played.tally.telemetry_equal), (5000, 5000));
            assert_eq!(played.round_trips_ns.len(), 5000);
        }
    }
}

#[test]
fn replay_to_a_driver_with_fd_telemetry_is_bit_identical() {
    let plan = Plan::parse(&log(1000), NODE).expect("a log");
    let mut client = client(FaultPlan::default(), 1);
    client.write(Address::new(index::OPERATION, FD_TELEMETRY), &[1]).expect("a setting");
    let core = set_up(&mut client, NODE, &setup(NumberType::Float)).expect("answers");
    let mut recorded = Vec::new();
    let mut bus = Recorder::new(client.into_bus(), &mut recorded, "can0", Fraction::Nanoseconds);
    let played = play(&mut bus, &plan, Rate::Times(1.0), Check::new(NODE, core), &mut |_| {})
        .expect("a bus");
    drop(bus);
    let recorded = String::from_utf8(recorded).expect("text");
    assert!(recorded.contains("381##1") && !recorded.contains("181#"));
    assert!(played.tally.holds(), "{:?}", played.tally);
    assert_eq!((played.tally.equal, played.tally.telemetry_equal), (1000, 1000));
}

#[test]
fn replayed_friction_has_the_size_of_the_model() {
    // If all torques were zero, the comparison would also succeed.
    let plan = Plan::parse(&log(3000), NODE).expect("a log");
    let mut client = client(FaultPlan::default(), 1);
    let mut core = set_up(&mut client, NODE, &setup(NumberType::Float)).expect("answers");
    core.set_enabled(true);
    let mut largest = 0f32;
    for planned in &plan.frames {
        match planned.message {
            Message::Sync(sync) => {
                if let firmware::hil::HilStep::Reply(reply, _) = core.sync(sync) {
                    largest = largest.max(reply.answer.friction_torque_nm.abs());
                }
            }
            message => core.take(&message),
        }
    }
    // 1 Nm, 2e-6 Nm/Pa at 0.1 MPa, and a small ripple.
    assert!((1.1..1.5).contains(&largest), "{largest}");
}

#[test]
fn replay_in_virtual_time_is_reproducible() {
    let log = log(2000);
    let faults = Faults { drop: 0.01, duplicate: 0.01, delay: 0.05, reorder: 0.02, ..worst() };
    let replay = |seed| {
        let played = replayed(&log, &setup(NumberType::Float), Rate::Times(1.0), faults, seed);
        (played.tally, played.round_trips_ns, played.lateness_ns)
    };
    assert_eq!(replay(3), replay(3));
    assert_ne!(replay(3), replay(4));
}

fn worst() -> Faults {
    Faults { longest_delay_ns: 2_000_000, ..Faults::default() }
}

#[test]
fn replay_with_faults_counts_each_kind() {
    let log = log(4000);
    let tally =
        |faults| replayed(&log, &setup(NumberType::Float), Rate::Times(1.0), faults, 7).tally;
    let dropped = tally(Faults { drop: 0.01, ..worst() });
    // A dropped SYNC loses a sample, and the driver's state differs from then on.
    assert!(dropped.lost > 20 && dropped.mismatches > 0, "{dropped:?}");
    let corrupted = tally(Faults { corrupt: 0.01, ..worst() });
    assert!(corrupted.mismatches > 20, "{corrupted:?}");
    let duplicated = tally(Faults { duplicate: 0.05, ..worst() });
    assert!(duplicated.duplicated > 50 && duplicated.mismatches == 0, "{duplicated:?}");
    for tally in [dropped, corrupted] {
        assert!(!tally.holds());
        assert!(!tally.shown.is_empty() && tally.shown.len() <= 10);
    }
}

#[test]
fn replay_of_trace_with_answers_compares_the_recorded_answers() {
    let log = log(500);
    let plan = Plan::parse(&log, NODE).expect("a log");
    let mut client = client(FaultPlan::default(), 1);
    let mut core = set_up(&mut client, NODE, &setup(NumberType::Float)).expect("answers");
    core.set_enabled(true);
    // The trace with the joint's answers, one of which is changed.
    let mut recorded = Vec::new();
    let mut line = |time_ns: u64, message: Message| {
        let frame = CanFrame::from(message.emit());
        let line = Line { time_ns, interface: b"can0", frame, direction: None };
        candump::emit(&line, Fraction::Nanoseconds, &mut recorded);
    };
    for planned in &plan.frames {
        line(planned.due_ns, planned.message);
        match planned.message {
            Message::Sync(sync) => {
                let firmware::hil::HilStep::Reply(mut reply, _) = core.sync(sync) else { panic!() };
                if reply.status.sequence == 321 {
                    reply.answer.friction_torque_nm += 1e-3;
                }
                line(planned.due_ns, Message::Answer(NODE, reply.answer));
                line(planned.due_ns, Message::Status(NODE, reply.status));
            }
            message => core.take(&message),
        }
    }
    let played = replayed(&recorded, &setup(NumberType::Float), Rate::Max, Faults::default(), 1);
    assert!(played.tally.holds());
    assert_eq!((played.tally.recorded_equal, played.tally.recorded), (499, 500));
}
