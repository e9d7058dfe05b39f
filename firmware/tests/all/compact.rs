//! The compact node by its frames: faults of its chip, and what it does not arm with.

use compensator_core::ParameterId;
use compensator_core::can::{CommandFrame, Frame, Message, NodeId};
use firmware::compact::CompactNode;
use firmware::driver::{Boot, Identity, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::records::TraceObject;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::node::sdo::Abort;
use firmware::node_settings::NodeSettings;
use firmware::store::memory::MemoryFlash;
use firmware::supervisor::Code;

const NODE: NodeId = NodeId::FIRST;

struct Bench {
    node: CompactNode<MemoryFlash<4>>,
    now_us: u64,
    counter: u8,
}

impl Bench {
    fn start() -> Self {
        let settings = NodeSettings { node: NODE, ..NodeSettings::default() };
        let identity = Identity { hardware: "bench", serial: 7, stage: StageTraits::NONE };
        let mut node = CompactNode::with_defaults(settings, MemoryFlash::new(), identity, 0);
        node.load(&Boot::default(), 0);
        let mut bench = Self { node, now_us: 0, counter: 0 };
        bench.node.receive(&Frame::new(0, &[1, NODE.number()]).unwrap(), 0);
        let wiring = bench.read(index::COMMISSIONING, 2);
        bench.write(index::COMMISSIONING, 3, &wiring.to_le_bytes()).unwrap();
        bench.pass(20, true);
        bench
    }

    /// Sends a request of the object server. Returns the word of its answer, or the abort code.
    fn exchange(&mut self, request: [u8; 8]) -> Result<u32, u32> {
        while self.node.transmit_if(|_| true).is_some() {}
        self.node.receive(&Frame::new(0x601, &request).unwrap(), self.now_us);
        while let Some(frame) = self.node.transmit_if(|_| true) {
            if frame.identifier() == 0x581 {
                let data = frame.data();
                let word = u32::from_le_bytes(data[4..].try_into().unwrap());
                return if data[0] == 0x80 { Err(word) } else { Ok(word) };
            }
        }
        panic!("no answer to {request:02X?}")
    }

    fn read(&mut self, at: u16, sub_index: u8) -> u32 {
        let [low, high] = at.to_le_bytes();
        self.exchange([0x40, low, high, sub_index, 0, 0, 0, 0]).expect("an object")
    }

    fn write(&mut self, at: u16, sub_index: u8, value: &[u8]) -> Result<u32, u32> {
        let [low, high] = at.to_le_bytes();
        let mut request = [0x23 | (4 - value.len() as u8) << 2, low, high, sub_index, 0, 0, 0, 0];
        request[4..4 + value.len()].copy_from_slice(value);
        self.exchange(request)
    }

    /// Passes milliseconds with a command and a report in each.
    fn pass(&mut self, milliseconds: usize, stack_intact: bool) {
        for _ in 0..milliseconds {
            self.counter = self.counter.wrapping_add(1);
            let command = CommandFrame::new(0.0, 0.0, self.counter);
            self.node.receive(&Message::Command(NODE, command).emit(), self.now_us);
            self.node.joint.report(&LoopReport {
                bus_voltage_v: Some(48.0),
                phase_currents_a: Some([0.0; 3]),
                stack_intact,
                ..LoopReport::default()
            });
            self.now_us += 1000;
            self.node.tick(self.now_us);
            while self.node.transmit_if(|_| true).is_some() {}
        }
    }

    fn is_armed(&self) -> bool {
        self.node.joint.supervisor().is_armed()
    }
}

#[test]
fn overwritten_stack_guard_stops_an_armed_node() {
    let mut bench = Bench::start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    bench.pass(20, true);
    assert!(bench.is_armed());
    bench.pass(2, false);
    assert!(
        !bench.is_armed() && bench.node.joint.supervisor().faults().contains(Code::StackOverflow)
    );
}

#[test]
fn joint_kind_beyond_its_values_is_refused_as_out_of_range() {
    let mut bench = Bench::start();
    bench.write(index::TRACE, TraceObject::JOINT_KIND, &[1, 0, 0, 0]).unwrap();
    let refused = bench.write(index::TRACE, TraceObject::JOINT_KIND, &[2, 0, 0, 0]);
    assert_eq!(refused, Err(Abort::Value.code()));
    assert_eq!(bench.read(index::TRACE, TraceObject::JOINT_KIND), 1);
}

#[test]
fn node_with_more_friction_than_stored_does_not_arm_until_it_is_saved() {
    let mut bench = Bench::start();
    let place = ParameterId::StaticTorque as u8 + 1;
    let stored_nm = f32::from_bits(bench.read(index::PARAMETERS, place));
    for (factor, arms) in [(1.2f32, false), (1.0, true)] {
        bench.write(index::PARAMETERS, place, &(factor * stored_nm).to_le_bytes()).unwrap();
        let staged = bench.read(index::COMMIT, 2);
        bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
        bench.pass(5, true);
        assert_eq!(bench.write(index::STATE, 1, &[1]).is_ok(), arms, "x{factor}");
        bench.write(index::STATE, 1, &[0]).unwrap();
    }
    bench.write(index::PARAMETERS, place, &(1.2 * stored_nm).to_le_bytes()).unwrap();
    let staged = bench.read(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    bench.pass(5, true);
    bench.write(index::STATE, 1, &[1]).expect("what it compensates is stored");
}
