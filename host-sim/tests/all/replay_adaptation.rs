//! Replay of a joint that adapts its friction levels (2044h): the answers in its trace return bit for bit.

use compensator_core::ParameterId;
use compensator_core::can::{Message, MotionFrame, NodeId, SyncFrame, TorqueFrame};
use firmware::hil::{HilJoint, NumberType};
use firmware::level_learner::{OFF, ON};
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use joint_bus::bus::{Hub, Recorder};
use joint_bus::canopen::Client;
use joint_bus::joint::JointNode;
use joint_bus::replay::{
    Check, CoreJoint, Plan, PlayResult, Rate, ReplaySetup, in_process, play, set_up,
};
use joint_trace::{CanFrame, Fraction, Line, candump};

const NODE: NodeId = NodeId::FIRST;
/// Samples of the trace, at 1 kHz.
const SAMPLES: u32 = 30_000;
/// Level of the joint relative to that of its set, at the begin and at the end of the trace.
const LEVEL: [f32; 2] = [1.0, 1.6];
/// SYNCs per torque: a joint on its sensors sends it at every tenth.
const TORQUE_EVERY: u32 = 10;

/// A trace of a joint that moves back and forth while its friction rises.
fn inputs() -> Vec<u8> {
    let mut out = Vec::new();
    let mut line = |time_ns: u64, message: Message| {
        let frame = CanFrame::from(message.emit());
        let line = Line { time_ns, interface: b"can0", frame, direction: None };
        candump::emit(&line, Fraction::Nanoseconds, &mut out);
    };
    let model = ParameterSet::default().friction.model;
    let coulomb_nm = model.get(ParameterId::CoulombTorque);
    let viscous = model.get(ParameterId::ViscousFriction);
    for sequence in 0..SAMPLES {
        let time_ns = u64::from(sequence) * 1_000_000;
        let phase = sequence as f32 * 3e-3;
        let motion =
            MotionFrame { velocity_rad_s: 1.2 * phase.sin(), position_rad: -0.4 * phase.cos() };
        line(time_ns, Message::Motion(NODE, motion));
        if sequence.is_multiple_of(TORQUE_EVERY) {
            let share = sequence as f32 / SAMPLES as f32;
            let level = LEVEL[0] + share * (LEVEL[1] - LEVEL[0]);
            let velocity_rad_s = motion.velocity_rad_s;
            let torque_nm =
                level * coulomb_nm * (velocity_rad_s / 0.02).tanh() + viscous * velocity_rad_s;
            let torque = TorqueFrame { torque_nm, load_torque_nm: f32::NAN };
            line(time_ns, Message::Torque(NODE, torque));
        }
        line(time_ns, Message::Sync(SyncFrame::of(sequence)));
    }
    out
}

fn setup(number: NumberType, mode: u8) -> ReplaySetup {
    ReplaySetup {
        friction: Some(ParameterSet::default().friction),
        network: None,
        number: Some(number),
        period_s: 1e-3,
        adaptation: Some(mode),
    }
}

/// Records a driver that adapts on the bus of this process. Returns its trace and the gain of its level at the end.
fn record(number: NumberType) -> (Vec<u8>, f32) {
    let plan = Plan::parse(&inputs(), NODE).expect("a log");
    let hub = Hub::new();
    hub.attach(JointNode::start(NODE, None).expect("no file"));
    let mut client = Client::new(hub.port(), NODE);
    let core = set_up(&mut client, NODE, &setup(number, ON)).expect("a driver");
    let mut recorded = Vec::new();
    let mut bus = Recorder::new(client.into_bus(), &mut recorded, "can0", Fraction::Nanoseconds);
    let played = play(&mut bus, &plan, Rate::Times(1.0), Check::new(NODE, core), &mut |_| {})
        .expect("a bus");
    assert!(played.tally.holds(), "{:?}", played.tally);
    drop(bus);
    let gain = Client::new(hub.port(), NODE)
        .read_float(canopen_rs::Address::new(index::LEARNT_GAINS, 1))
        .expect("an answer");
    (recorded, gain)
}

fn replay(trace: &[u8], number: NumberType, mode: u8) -> PlayResult {
    let plan = Plan::parse(trace, NODE).expect("a log");
    in_process(&plan, NODE, &setup(number, mode)).expect("a driver")
}

#[test]
fn replay_of_joint_that_adapts_returns_every_recorded_torque() {
    for number in [NumberType::Float, NumberType::Fixed] {
        let (trace, gain) = record(number);
        assert!((1.3..1.7).contains(&gain), "{number:?}: {gain}");
        let again = replay(&trace, number, ON).tally;
        assert!(again.holds(), "{number:?}: {again:?}");
        let all = u64::from(SAMPLES);
        assert_eq!((again.equal, again.recorded_equal, again.recorded), (all, all, all));
        // Without the gains, the torques differ from the first one that was learnt on.
        let without = replay(&trace, number, OFF).tally;
        assert_eq!(without.equal, all, "{number:?}");
        assert!(without.recorded_equal < all / 2, "{number:?}: {}", without.recorded_equal);
    }
}

#[test]
fn check_that_drops_the_gains_of_its_driver_does_not_hold() {
    let plan = Plan::parse(&inputs(), NODE).expect("a log");
    let hub = Hub::new();
    hub.attach(JointNode::start(NODE, None).expect("no file"));
    let mut client = Client::new(hub.port(), NODE);
    let core = set_up(&mut client, NODE, &setup(NumberType::Float, ON)).expect("a driver");
    let friction = ParameterSet::default().friction;
    let fixed = HilJoint::build(NODE, &friction, None, core.setup()).expect("a model");
    let check = Check::new(NODE, CoreJoint::from(fixed));
    let mut bus = client.into_bus();
    let played = play(&mut bus, &plan, Rate::Max, check, &mut |_| {}).expect("a bus");
    assert!(played.tally.mismatches > u64::from(SAMPLES / 2), "{:?}", played.tally);
}
