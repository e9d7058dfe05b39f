//! A drawn joint in service on the in-process bus: its start, its sensors, its faults, and its restart.

use canopen_rs::{Address, NmtCommand};
use compensator_core::can::{Frame, Message, NodeId, SyncFrame};
use firmware::node::dictionary::index;
use joint_bus::bus::{Bus, Hub, Port};
use joint_bus::canopen::Client;
use joint_rig::{EncoderFault, JointEvent, MotorNode, service};
use joint_trace::CanFrame;
use simulated_machines::joint_plant::DrawnJoint;
use simulated_machines::scenarios::Hide;
use std::cell::RefCell;
use std::rc::Rc;

const NODE: NodeId = NodeId::FIRST;
const MILLISECOND_NS: u64 = 1_000_000;
const CSP: u8 = 8;
const POSITION_KNOWN: u32 = 1 << 8;
/// Bits of the statusword that hold the state, and operation enabled.
const STATE_MASK: u32 = 0x6F;
const ENABLED: u32 = 0x27;

/// A drawn joint on its bus, with a master.
struct Bench {
    joint: DrawnJoint,
    node: Rc<RefCell<MotorNode>>,
    client: Client<Port>,
    sync: u32,
    /// Side load and temperature frames that the master received.
    seen: Vec<Message>,
}

impl Bench {
    fn new(seed: u64, hidden: &str) -> Self {
        let hide = [Hide::parse(hidden).expect("a cause")];
        let joint = DrawnJoint::draw(seed, &hide, None).expect("a joint");
        let set = service::starting_set(&joint);
        let node = Rc::new(RefCell::new(MotorNode::drawn(&joint, &set).expect("a start")));
        let hub = Hub::new();
        hub.attach(node.clone());
        let client = Client::new(hub.port(), NODE);
        Self { joint, node, client, sync: 0, seen: Vec::new() }
    }

    fn status(&mut self) -> u32 {
        self.client.read_number(Address::new(index::STATUSWORD, 0)).expect("an answer")
    }

    fn position_rad(&self) -> f64 {
        self.node.borrow().plant().position_rad()
    }

    fn is_armed(&self) -> bool {
        self.node.borrow_mut().rig().is_armed()
    }

    /// Runs with SYNC and a controlword each millisecond, and a target position (rad) if given.
    fn run(&mut self, milliseconds: u32, controlword: u16, target: impl Fn(f64) -> Option<f64>) {
        for step in 0..milliseconds {
            let mut send = |identifier, data: &[u8]| {
                let frame = Frame::new(identifier, data).expect("legal");
                self.client.bus().send(&frame.into()).expect("a bus");
            };
            if let Some(target) = target(1e-3 * f64::from(step)) {
                let [a, b, c, d] = ((1e6 * target) as i32).to_le_bytes();
                send(0x601, &[0x23, 0x7A, 0x60, 0, a, b, c, d]);
            }
            let [low, high] = controlword.to_le_bytes();
            send(0x201, &[low, high, 0, 0, 0, 0, 0, 0]);
            let sync = Message::Sync(SyncFrame::of(self.sync)).emit();
            self.client.bus().send(&CanFrame::from(sync)).expect("a bus");
            self.sync += 1;
            let until_ns = self.client.bus().now_ns() + MILLISECOND_NS;
            while let Some(received) = self.client.bus().receive(until_ns).expect("a bus") {
                let message = received.frame.to_joint().and_then(|f| Message::parse(&f).ok());
                let is_reading = |message: &Message| {
                    matches!(message, Message::Seal(..) | Message::Surroundings(..))
                };
                self.seen.extend(message.filter(is_reading));
            }
        }
    }

    fn enable(&mut self) {
        self.client.command(NmtCommand::StartRemoteNode).expect("a bus");
        self.client.write(Address::new(index::MODE, 0), &[CSP]).expect("a mode");
        for word in [0x06, 0x07, 0x0F] {
            self.run(100, word, |_| None);
        }
    }

    /// Lets something happen this long from now, ms.
    fn schedule(&mut self, in_ms: u64, event: JointEvent) {
        let at_ns = self.client.bus().now_ns() + in_ms * MILLISECOND_NS;
        self.node.borrow_mut().schedule(at_ns, event);
    }
}

#[test]
fn drawn_joint_is_homed_within_its_window_and_moves_in_position_mode() {
    for seed in 0..4 {
        let mut bench = Bench::new(seed, "none");
        assert_ne!(bench.status() & POSITION_KNOWN, 0, "seed {seed}: the position is known");
        let from = bench.position_rad();
        assert!((from - bench.joint.start_rad).abs() < 1e-4);
        let limit = |client: &mut Client<Port>, sub| {
            let word = client.read_number(Address::new(index::POSITION_LIMITS, sub));
            1e-6 * f64::from(word.expect("a limit") as i32)
        };
        let window = [1, 2].map(|sub| limit(&mut bench.client, sub) - from);
        assert!((window[0] + 1.0).abs() < 1e-3 && (window[1] - 1.0).abs() < 1e-3, "{window:?}");
        bench.enable();
        assert!(bench.is_armed(), "seed {seed}");
        bench.run(1000, 0x0F, |t| Some(from + 0.3 * (1.0 - (3.0 * t).cos()) * 0.5));
        bench.run(400, 0x0F, |_| None);
        let moved = bench.position_rad() - from;
        let target = 0.15 * (1.0 - 2.997f64.cos());
        assert!((moved - target).abs() < 0.03, "seed {seed}: {moved} rad of {target} rad");
        // Beyond the window there is no way.
        bench.run(2500, 0x0F, |t| Some(from + target + t.min(2.0)));
        let moved = bench.position_rad() - from;
        assert!((0.9..1.03).contains(&moved), "seed {seed}: {moved} rad");
    }
}

#[test]
fn sensors_of_a_drawn_joint_send_their_readings_to_driver_and_master() {
    let mut bench = Bench::new(2, "pressure-coulomb");
    bench.enable();
    bench.seen.clear();
    bench.schedule(0, JointEvent::SealSensorsStuck);
    bench.run(500, 0x0F, |_| None);
    let pressures: Vec<f32> = (bench.seen.iter())
        .filter_map(|message| match message {
            Message::Seal(_, seal) => Some(seal.pressure_diff_pa),
            _ => None,
        })
        .collect();
    assert!((49..=51).contains(&pressures.len()), "{}", pressures.len());
    assert!(pressures.iter().all(|pressure| *pressure == pressures[0]), "stuck: {pressures:?}");
    let truth = bench.node.borrow().plant().around.pressure_diff_pa;
    let shown = bench.client.read_float(Address::new(index::INPUTS, 6)).expect("an input");
    assert!((f64::from(shown) - truth).abs() < 2e3, "{shown} Pa, truly {truth} Pa");
    bench.seen.clear();
    bench.schedule(0, JointEvent::SealSensorsRestored);
    bench.run(500, 0x0F, |_| None);
    let pressures = bench.seen.iter().filter_map(|message| match message {
        Message::Seal(_, seal) => Some(seal.pressure_diff_pa),
        _ => None,
    });
    assert!(pressures.collect::<Vec<_>>().windows(2).any(|pair| pair[0] != pair[1]));
}

#[test]
fn cut_cable_stops_the_joint_and_a_restored_one_answers_again() {
    let mut bench = Bench::new(3, "none");
    bench.enable();
    let from = bench.position_rad();
    bench.schedule(300, JointEvent::CableCut);
    bench.schedule(1500, JointEvent::CableRestored);
    bench.run(1200, 0x0F, |t| Some(from + 0.5 * t.min(0.8)));
    assert!(!bench.is_armed(), "the watchdog of the targets stops the joint");
    let cut_at = bench.position_rad();
    assert!(cut_at - from < 0.25 + 0.1, "{}", cut_at - from);
    bench.run(600, 0, |_| None);
    assert_ne!(bench.status() & STATE_MASK, ENABLED);
    assert_eq!(bench.node.borrow().restarts(), 0);
}

#[test]
fn reset_driver_starts_from_its_flash_on_the_joint_as_it_is() {
    for through_network in [false, true] {
        let mut bench = Bench::new(1, "none");
        let from = bench.position_rad();
        bench.enable();
        bench.run(600, 0x0F, |t| Some(from + 0.4 * t.min(0.5)));
        let at = bench.position_rad();
        // Saved in flash, and changed in RAM.
        let inertia = bench.joint.known.inertia_kg_m2 as f32;
        let gain = Address::new(index::POSITION_LOOP, 1);
        let saved = bench.client.read_number(gain).expect("a gain");
        bench.run(200, 0x06, |_| None);
        bench.client.write(gain, &(saved + 1000).to_le_bytes()).expect("a gain");
        if through_network {
            bench.client.command(NmtCommand::ResetNode).expect("a bus");
        } else {
            bench.schedule(0, JointEvent::ProcessorReset);
        }
        bench.run(300, 0, |_| None);
        assert_eq!(bench.node.borrow().restarts(), 1, "network {through_network}");
        assert_eq!(bench.client.read_number(gain).expect("a gain"), saved);
        assert!((bench.position_rad() - at).abs() < 0.02, "the joint stays where it is");
        let known = service::starting_set(&bench.joint).motor.inertia_kg_m2;
        assert_eq!(known, inertia);
        // It was disarmed and at rest, so its home is kept.
        assert_eq!(bench.status() & POSITION_KNOWN, POSITION_KNOWN);
        bench.enable();
        assert!(bench.is_armed());
    }
}

#[test]
fn faults_of_encoder_and_supply_stop_the_joint() {
    let events = [JointEvent::Encoder(EncoderFault::Low), JointEvent::Supply(20.0)];
    for event in events {
        let mut bench = Bench::new(4, "none");
        bench.enable();
        assert!(bench.is_armed());
        bench.schedule(50, event);
        bench.run(400, 0x0F, |_| None);
        assert!(!bench.is_armed(), "{event:?}");
    }
}
