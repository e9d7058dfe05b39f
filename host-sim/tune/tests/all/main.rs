//! Sessions on a drawn joint in this process: what is refused, what an interrupt leaves, and the way back after a tuning.

mod interrupt;
mod refusals;
#[path = "../../../../tests/snapshot.rs"]
mod snapshot;
mod stop;
mod undo;

use canopen_rs::Address;
use compensator_core::can::NodeId;
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use joint_bus::bus::{Hub, Port};
use joint_bus::canopen::Client;
use joint_rig::{MotorNode, service};
use joint_tuning::{MotionLimits, TuneOptions, TuneUser};
use simulated_machines::joint_plant::DrawnJoint;
use simulated_machines::scenarios::Hide;
use std::cell::RefCell;
use std::rc::Rc;

const NODE: NodeId = NodeId::FIRST;
const LIMITS: MotionLimits =
    MotionLimits { range_rad: 0.4, speed_rad_s: 1.5, acceleration_rad_s2: 11.25 };

/// A joint on its bus.
struct Bench {
    hub: Hub,
    node: Rc<RefCell<MotorNode>>,
    /// The set and the gain of the position loop in its flash.
    stored: ParameterSet,
    position_gain: u32,
}

impl Bench {
    /// A drawn joint in service. `change` changes the set that it starts with.
    fn new(seed: u64, hidden: &str, change: impl FnOnce(&mut ParameterSet)) -> Self {
        let hide = [Hide::parse(hidden).expect("a cause")];
        let joint = DrawnJoint::draw(seed, &hide, None).expect("a joint");
        let mut stored = service::starting_set(&joint);
        change(&mut stored);
        let position_gain = service::drive_settings(&joint).position_gain;
        let node = MotorNode::drawn(&joint, &stored).expect("a start");
        Self::with_node(node, stored, position_gain)
    }

    fn with_node(node: MotorNode, stored: ParameterSet, position_gain: u32) -> Self {
        let (hub, node) = (Hub::new(), Rc::new(RefCell::new(node)));
        hub.attach(node.clone());
        Self { hub, node, stored, position_gain }
    }

    fn client(&self) -> Client<Port> {
        Client::new(self.hub.port(), NODE)
    }

    fn run_for_ms(&self, milliseconds: u64) {
        self.hub.run_until(self.hub.now_ns() + milliseconds * 1_000_000).expect("no storm");
    }

    fn is_armed(&self) -> bool {
        self.node.borrow_mut().rig().is_armed()
    }

    fn velocity_rad_s(&self) -> f64 {
        self.node.borrow().plant().velocity_rad_s()
    }

    /// CRC of the active set, and gain of the position loop.
    fn active(&self) -> (u32, u32) {
        let mut client = self.client();
        let crc = client.read_number(Address::new(index::COMMIT, 1)).expect("an answer");
        let gain = client.read_number(Address::new(index::POSITION_LOOP, 1)).expect("an answer");
        (crc, gain)
    }

    fn stored(&self) -> (u32, u32) {
        (self.stored.crc(), self.position_gain)
    }
}

fn options(seconds: f64, seed: u64) -> TuneOptions {
    TuneOptions {
        node: NODE,
        limits: LIMITS,
        seconds,
        motion: None,
        allow_active: false,
        seed,
        joint: "node 1 on loop".into(),
        is_simulated: true,
        now_s: 1_800_000_000,
    }
}

/// A user who confirms, and keeps the lines of progress.
#[derive(Default)]
struct User {
    questions: Vec<String>,
    lines: Vec<String>,
}

impl TuneUser for User {
    fn confirms(&mut self, what: &str) -> bool {
        self.questions.push(what.to_owned());
        true
    }

    fn progress(&mut self, line: &str) {
        self.lines.push(line.to_owned());
    }
}
