//! What a session refuses, with one line, before it asks or moves.

use super::snapshot;
use super::{Bench, LIMITS, NODE, User, options};
use canopen_rs::Address;
use compensator_core::can::{CommandFrame, Frame, Message, SyncFrame, cob_id};
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use joint_bus::bus::{Hub, Participant};
use joint_bus::canopen::Client;
use joint_bus::joint::JointNode;
use joint_bus::parameters::write_set;
use joint_rig::{JointEvent, MotorNode};
use joint_trace::CanFrame;
use joint_tuning::{MotionLimits, TuneError, TuneUser, tune};
use std::cell::Cell;
use std::rc::Rc;

impl Bench {
    fn drawn() -> Self {
        Self::new(3, "none", |_| ())
    }

    fn write(&self, object: u16, sub_index: u8, value: &[u8]) {
        self.client().write(Address::new(object, sub_index), value).expect("written");
    }

    /// Returns the line of a session that is refused. Nothing was asked, and the joint did not arm.
    fn refusal(&self, limits: MotionLimits) -> String {
        let mut user = User::default();
        let limited = joint_tuning::TuneOptions { limits, ..options(300.0, 1) };
        let at = self.node.borrow().plant().position_rad();
        let error =
            tune(self.client(), &limited, Box::new(|| false), &mut user).expect_err("refused");
        let line = error.to_string();
        assert!(user.questions.is_empty() && user.lines.is_empty(), "{line}");
        assert!(!line.contains('\n'), "{line}");
        assert!(!self.is_armed(), "{line}");
        let moved = (self.node.borrow().plant().position_rad() - at).abs();
        assert!(moved < 1e-3, "{line}: moved by {moved} rad");
        line
    }

    /// Asserts that a session is refused with a line that has this name. `section` of the snapshot holds the line.
    fn assert_refused(&self, name: &str, section: &str) {
        let line = self.refusal(LIMITS);
        assert!(line.contains(name), "{line:?}, expected {name:?}");
        snapshot::check("refusals", section, &line);
    }
}

#[test]
fn joint_without_position_window_is_refused() {
    let bench = Bench::drawn();
    for side in [1, 2] {
        bench.write(index::POSITION_LIMITS, side, &0i32.to_le_bytes());
    }
    bench.assert_refused("607Dh", "no window");
}

#[test]
fn joint_with_unknown_position_is_refused() {
    let node = MotorNode::commissioned().expect("a start");
    let bench = Bench::with_node(node, ParameterSet::default(), 0);
    bench.assert_refused("home", "unknown position");
}

#[test]
fn joint_that_is_not_commissioned_is_refused() {
    let node = MotorNode::start().expect("a start");
    let bench = Bench::with_node(node, ParameterSet::default(), 0);
    bench.assert_refused("`params commission", "not commissioned");
}

#[test]
fn joint_with_a_fault_is_refused_with_its_name() {
    let bench = Bench::drawn();
    let now_ns = bench.hub.now_ns();
    bench.node.borrow_mut().schedule(now_ns, JointEvent::Supply(70.0));
    bench.run_for_ms(200);
    bench.assert_refused("bus-overvoltage", "a fault");
}

#[test]
fn node_without_motor_is_refused() {
    let hub = Hub::new();
    hub.attach(JointNode::start(NODE, None).expect("a start"));
    let client = Client::new(hub.port(), NODE);
    let mut user = User::default();
    let error = tune(client, &options(300.0, 1), Box::new(|| false), &mut user).expect_err("HIL");
    snapshot::check("refusals", "no motor", &error.to_string());
    assert!(error.to_string().contains("2001h:1"), "{error}");
    assert!(user.questions.is_empty());
}

/// Sends a frame every 10 ms.
struct OtherMaster(Frame, Option<CanFrame>);

impl Participant for OtherMaster {
    fn receive(&mut self, _: &CanFrame, _: u64) {}

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        self.1 = Some(CanFrame::from(self.0));
        Some(now_ns + 10_000_000)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.1.take()
    }
}

#[test]
fn bus_with_another_master_is_refused() {
    let targets = cob_id::RPDO_1 + u16::from(NODE.number());
    for (frame, name, section) in [
        (Message::Sync(SyncFrame::of(1)).emit(), "SYNC", "another master with SYNC"),
        (
            Message::Command(NODE, CommandFrame::new(0.0, 0.0, 1)).emit(),
            "commands",
            "another master with commands",
        ),
        (
            Frame::new(targets, &[0x06, 0, 0, 0, 0, 0]).expect("a frame"),
            "targets",
            "another master with targets",
        ),
    ] {
        let bench = Bench::drawn();
        bench.hub.attach(OtherMaster(frame, None));
        bench.assert_refused(name, section);
    }
}

#[test]
fn joint_without_limits_of_torque_is_refused() {
    let bench = Bench::drawn();
    bench.write(index::MAX_TORQUE, 0, &0u16.to_le_bytes());
    bench.assert_refused("6072h = 0", "limits without motion");
    let bench = Bench::new(3, "none", |set| set.friction.compensator.torque_limit_nm = 500.0);
    bench.assert_refused("compensator.torque_limit_nm", "no limit of torque");
}

#[test]
fn motion_beyond_window_or_speed_of_the_joint_is_refused() {
    let bench = Bench::drawn();
    let line = bench.refusal(MotionLimits { range_rad: 1.2, ..LIMITS });
    assert!(line.starts_with("--range 1.2 rad: ") && line.contains(" 0.980 rad"), "{line}");
    snapshot::check("refusals", "motion beyond the window", &line);
    let line = bench.refusal(MotionLimits { speed_rad_s: 90.0, ..LIMITS });
    assert!(line.starts_with("--speed 90 rad/s: "), "{line}");
    snapshot::check("refusals", "motion beyond the speed", &line);
}

#[test]
fn joint_that_uses_learnt_gains_is_refused() {
    for mode in [1, 2] {
        let bench = Bench::drawn();
        bench.write(index::ADAPTATION, 1, &[mode]);
        bench.assert_refused("2044h:1", "learnt gains in use");
    }
}

/// Counts the requests that write an object of the joint.
#[derive(Clone, Default)]
struct WriteCounter(Rc<Cell<usize>>);

impl Participant for WriteCounter {
    fn receive(&mut self, frame: &CanFrame, _: u64) {
        let request = 0x600 + NODE.number() as u16;
        let is_write = frame.to_joint().is_some_and(|frame| {
            let head = frame.data().first().copied().unwrap_or(0x40);
            frame.identifier() == request && head & 0xE0 == 0x20
        });
        self.0.set(self.0.get() + usize::from(is_write));
    }

    fn tick(&mut self, _: u64) -> Option<u64> {
        None
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        None
    }
}

/// A user who declines, and counts what was written before.
struct Decliner(WriteCounter, Option<usize>);

impl TuneUser for Decliner {
    fn confirms(&mut self, _: &str) -> bool {
        self.1 = Some(self.0.0.get());
        false
    }

    fn progress(&mut self, line: &str) {
        panic!("{line}");
    }
}

#[test]
fn session_before_the_answer_and_after_a_no_writes_nothing() {
    let bench = Bench::drawn();
    let counter = WriteCounter::default();
    bench.hub.attach(counter.clone());
    let mut user = Decliner(counter.clone(), None);
    let error = tune(bench.client(), &options(300.0, 1), Box::new(|| false), &mut user);
    assert!(matches!(error, Err(TuneError::Declined)));
    assert_eq!((user.1, counter.0.get()), (Some(0), 0));
    bench.write(index::MODE, 0, &[8]);
    assert_eq!(counter.0.get(), 1, "the counter counts");
}

#[test]
fn joint_whose_parameters_are_not_saved_is_refused_after_the_answer() {
    let bench = Bench::drawn();
    let mut changed = bench.stored.clone();
    changed.friction.compensator.scale = 0.25;
    write_set(&mut bench.client(), &changed).expect("committed");
    let mut user = User::default();
    let error = tune(bench.client(), &options(300.0, 1), Box::new(|| false), &mut user);
    let line = error.expect_err("refused").to_string();
    assert!(line.contains("save") && !line.contains('\n'), "{line}");
    assert_eq!((user.questions.len(), user.lines.len()), (1, 0));
    assert!(!bench.is_armed());
    assert_eq!(bench.active().0, changed.crc(), "it keeps them");
}
