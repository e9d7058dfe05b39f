//! Tests of block transfers between the client and a joint driver, with and without faults of the bus.

use crate::reference_network as reference;
use canopen_rs::Address;
use compensator_core::can::NodeId;
use compensator_core::network::record;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommitObject;
use joint_bus::bus::{BitRates, Bus, FaultInjector, FaultPlan, Faults, Hub};
use joint_bus::canopen::{Client, SdoError};
use joint_bus::joint::JointNode;
use joint_trace::CanFrame;
use std::cell::RefCell;
use std::rc::Rc;

const RECORD: Address = Address::new(index::COMMIT, CommitObject::NETWORK_RECORD);

fn joint_on(hub: &Hub) -> Rc<RefCell<JointNode>> {
    let joint = JointNode::start(NodeId::FIRST, None).expect("starts without a file");
    let joint = Rc::new(RefCell::new(joint));
    hub.attach(joint.clone());
    joint
}

fn not_sent(joint: &Rc<RefCell<JointNode>>) -> u32 {
    let joint = joint.borrow();
    let counters = joint.driver().joint.counters();
    counters.not_sent + counters.receiver_overrun
}

#[test]
fn record_written_in_blocks_is_read_back_in_blocks_and_in_segments() {
    let hub = Hub::with_bit_rates(BitRates { nominal: 1_000_000, data: 1_000_000 });
    let joint = joint_on(&hub);
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    let network = record::emit(Some(&reference::joint()));
    let mut steps = Vec::new();
    client.write_blocks(RECORD, &network, |done| steps.push(done)).unwrap();
    assert_eq!(steps, [889, 1778, network.len()]);
    assert_eq!(client.read(RECORD).unwrap(), network.as_slice());
    let start_ns = hub.now_ns();
    assert_eq!(client.read_blocks(RECORD, |_| ()).unwrap(), network.as_slice());
    let block_ns = hub.now_ns() - start_ns;
    let start_ns = hub.now_ns();
    client.read(RECORD).unwrap();
    // A confirmation per segment takes the bus as often as the segment.
    assert!(19 * block_ns < 10 * (hub.now_ns() - start_ns), "{block_ns} ns in blocks");
    assert_eq!(not_sent(&joint), 0);
}

#[test]
fn refusal_within_blocks_has_code_and_reason() {
    let hub = Hub::new();
    joint_on(&hub);
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    let mut network = record::emit(Some(&reference::joint()));
    network[700] ^= 1;
    let error = client.write_blocks(RECORD, &network, |_| ()).unwrap_err().to_string();
    assert!(error.contains("06090030") && error.contains("damaged (CRC)"), "{error}");
    let error = client.write_blocks(RECORD, &[0; 4000], |_| ()).unwrap_err().to_string();
    assert!(error.contains("out of memory"), "{error}");
    let absent = client.read_blocks(Address::new(0x2FFF, 0), |_| ()).unwrap_err().to_string();
    assert!(absent.contains("no such object"), "{absent}");
    assert_eq!(client.read(RECORD).unwrap(), record::emit(None).as_slice());
}

#[test]
fn blocks_survive_lost_and_repeated_frames_and_detect_corrupted_ones() {
    let network = record::emit(Some(&reference::joint()));
    let (mut whole, mut failed, mut dropped, mut corrupted) = (0, 0, 0, 0);
    for seed in 0..300 {
        let hub = Hub::new();
        joint_on(&hub);
        let corrupt = if seed % 2 == 0 { 0.0 } else { 0.002 };
        let faults = Faults { drop: 0.01, duplicate: 0.01, corrupt, ..Faults::default() };
        let plan = FaultPlan { sent: faults, received: faults };
        let bus = FaultInjector::new(hub.port(), plan, seed);
        let mut client = Client::new(bus, NodeId::FIRST);
        let written = client.write_blocks(RECORD, &network, |_| ());
        let read = client.read_blocks(RECORD, |_| ());
        let (sent, received) = client.bus().fault_counters();
        dropped += sent.dropped + received.dropped;
        corrupted += sent.corrupted + received.corrupted;
        match (&written, &read) {
            (Ok(()), Ok(value)) => {
                assert_eq!(value.as_slice(), network.as_slice(), "seed {seed}");
                whole += 1;
            }
            // What was read is what the driver holds, whatever happened before.
            (Err(_), Ok(value)) => {
                let absent = record::emit(None);
                let is_one = [network.as_slice(), absent.as_slice()].contains(&value.as_slice());
                assert!(is_one, "seed {seed}");
                failed += 1;
            }
            (_, Err(_)) => failed += 1,
        }
    }
    assert!(dropped > 1000 && corrupted > 50, "{dropped} dropped, {corrupted} corrupted");
    // Confirmations that are lost end a transfer; lost segments do not.
    assert!(whole > 100 && failed > 5, "{whole} whole, {failed} failed");
}

#[test]
fn transfers_pass_between_can_fd_frames_of_other_nodes() {
    let hub = Hub::with_bit_rates(BitRates { nominal: 1_000_000, data: 5_000_000 });
    let joint = joint_on(&hub);
    let mut other = hub.port();
    // The identifiers of the joint itself, and of its master.
    for identifier in [0x081, 0x201, 0x581, 0x601, 0x701] {
        let (flags, length, bytes) = (1, 64, [0x23; 64]);
        let frame = CanFrame::Flexible { identifier, extended: false, flags, length, bytes };
        other.send(&frame).unwrap();
    }
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    let network = record::emit(Some(&reference::joint()));
    client.write_blocks(RECORD, &network, |_| ()).unwrap();
    assert_eq!(client.read_blocks(RECORD, |_| ()).unwrap(), network.as_slice());
    let joint = joint.borrow();
    assert_eq!(joint.driver().joint.counters().wrong_length, 0);
}

#[test]
fn silent_node_is_reported_after_the_timeout() {
    let hub = Hub::new();
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    let error = client.write_blocks(RECORD, &[0; 100], |_| ()).unwrap_err();
    assert!(matches!(error, SdoError::Silent { node: 1 }), "{error}");
    assert_eq!(client.bus().now_ns(), 1_000_000_000);
}
