//! Tests with the driver of the firmware, and without a driver.

use super::*;
use crate::bus::{Hub, Participant};
use crate::canopen::Client;
use crate::joint::JointNode;
use joint_trace::CanFrame;
use std::cell::RefCell;
use std::rc::Rc;

const MS: u64 = 1_000_000;

/// A joint and its poller on a bus without delay.
struct Bench {
    joint: JointNode,
    sdo_poller: SdoPoller,
    now_ns: u64,
    replies: Vec<SdoReply>,
    asked: Vec<Frame>,
}

impl Bench {
    fn new(listen: bool) -> Self {
        let joint = JointNode::start(NodeId::FIRST, None).unwrap();
        let sdo_poller = SdoPoller::new(NodeId::FIRST, listen);
        Self { joint, sdo_poller, now_ns: 0, replies: Vec::new(), asked: Vec::new() }
    }

    fn run(&mut self, time_ms: u64) {
        for _ in 0..time_ms {
            self.joint.tick(self.now_ns);
            loop {
                let (frame, reply) = self.sdo_poller.poll(self.now_ns, true);
                self.replies.extend(reply);
                if let Some(frame) = frame {
                    self.asked.push(frame);
                    Participant::receive(&mut self.joint, &CanFrame::from(frame), self.now_ns);
                }
                let mut arrived = false;
                while let Some(answer) = self.joint.transmit().and_then(|of| of.to_joint()) {
                    self.replies.extend(self.sdo_poller.receive(&answer, self.now_ns));
                    arrived = true;
                }
                if !arrived {
                    break;
                }
            }
            self.now_ns += MS;
        }
    }

    fn value(&self, index: u16, place: u8) -> Option<u32> {
        self.replies.iter().rev().find_map(|reply| match reply {
            SdoReply::Value(at, value) if *at == Address::new(index, place) => Some(*value),
            _ => None,
        })
    }
}

#[test]
fn poller_reads_all_objects_twice_a_second() {
    let mut bench = Bench::new(false);
    bench.run(2001);
    assert_eq!(bench.replies.len(), 5 * POLLED_OBJECTS.len());
    assert_eq!(bench.asked.len(), bench.replies.len());
    for at in POLLED_OBJECTS {
        assert!(bench.value(at.index, at.subindex).is_some(), "{at:?}");
    }
    // A new driver: inputs from the bus, safe, no fault, only the limit parameters-default (34).
    assert_eq!(bench.value(index::STATE, 2), Some(0));
    assert_eq!(bench.value(index::STATE, 4), Some(1 << 1));
    assert_eq!(bench.value(index::OPERATION, 1), Some(1));
}

#[test]
fn poller_sends_requests_first_and_reports_their_result() {
    let mut bench = Bench::new(false);
    bench.sdo_poller.request(Request::Arm);
    bench.run(1);
    assert_eq!(bench.asked[0].data()[..5], [0x2F, 0x02, 0x20, 1, 1]);
    assert_eq!(bench.replies[0], SdoReply::Done(Request::Arm));
    // The result is read at once.
    assert_eq!(bench.value(index::STATE, 2), Some(1));
    bench.sdo_poller.request(Request::Arm);
    bench.sdo_poller.request(Request::Disarm);
    let asked = bench.asked.len();
    bench.run(1);
    // A request to disarm overtakes and cancels the request to arm.
    assert_eq!(bench.asked[asked].data()[4], 0);
    assert_eq!(bench.value(index::STATE, 2), Some(0));
    assert!(!bench.joint.driver().joint.is_armed());
}

#[test]
fn refused_request_reports_the_reason_of_the_joint() {
    let mut bench = Bench::new(false);
    // A PC has no sensors of its own, so arming is refused.
    let joint = JointNode::start(NodeId::FIRST, None).expect("starts without a file");
    let joint = Rc::new(RefCell::new(joint));
    let hub = Hub::new();
    hub.attach(joint.clone());
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    client.write(Address::new(index::OPERATION, 1), &[0]).expect("the client unlocks the joint");
    drop((client, hub));
    bench.joint = Rc::into_inner(joint).expect("the hub is gone").into_inner();
    bench.sdo_poller.request(Request::Arm);
    bench.run(5);
    let refused = bench.replies.iter().find_map(|reply| match reply {
        SdoReply::Refused(Request::Arm, code, why) => Some((*code, why.clone())),
        _ => None,
    });
    let (code, why) = refused.expect("refused");
    assert_eq!(code, 0x0800_0022);
    // Longer than an expedited answer, so it arrived in segments.
    assert!(why.len() > 8 && why.contains("command-timeout"), "{why:?}");
    bench.run(600);
    assert_eq!(bench.value(index::OPERATION, 1), Some(0));
}

#[test]
fn listening_poller_sends_nothing_and_reads_answers() {
    let mut bench = Bench::new(true);
    bench.sdo_poller.request(Request::Arm);
    bench.run(3000);
    assert!(bench.asked.is_empty() && bench.replies.is_empty());
    // Another client reads the state.
    let read = Frame::new(0x601, &encode_upload_request(POLLED_OBJECTS[0])).unwrap();
    Participant::receive(&mut bench.joint, &CanFrame::from(read), bench.now_ns);
    bench.run(1);
    assert_eq!(bench.replies, [SdoReply::Value(POLLED_OBJECTS[0], 0)]);
}

#[test]
fn poller_pauses_for_another_client() {
    let mut bench = Bench::new(false);
    bench.run(100);
    let theirs = Frame::new(0x601, &[0x23, 0x23, 0x20, 1, 0, 0, 0, 0]).unwrap();
    let asked = bench.asked.len();
    for _ in 0..20 {
        assert_eq!(bench.sdo_poller.receive(&theirs, bench.now_ns), None);
        assert!(bench.sdo_poller.is_held(bench.now_ns));
        bench.run(100);
    }
    assert_eq!(bench.asked.len(), asked);
    // A request to disarm does not wait.
    bench.sdo_poller.request(Request::Disarm);
    bench.run(1);
    assert_eq!(bench.asked.len(), asked + 1);
    bench.run(1500);
    assert!(bench.asked.len() > asked + POLLED_OBJECTS.len());
}

#[test]
fn silent_joint_is_polled_less_often() {
    let mut sdo_poller = SdoPoller::new(NodeId::FIRST, false);
    let mut times = Vec::new();
    for now_ms in 0..120_000 {
        let (frame, reply) = sdo_poller.poll(now_ms * MS, true);
        assert_eq!(reply, None);
        times.extend(frame.map(|_| now_ms));
    }
    // One request each time, not a complete round.
    assert!(times.len() < 15, "{times:?}");
    assert!(times.windows(2).last().is_some_and(|pair| pair[1] - pair[0] >= 16_000), "{times:?}");
    // The joint appears and is polled at once.
    sdo_poller.wake(120_000 * MS);
    assert!((120_000..120_400).any(|now_ms| sdo_poller.poll(now_ms * MS, true).0.is_some()));
    // A stopped joint is not polled, and a full bus is not used.
    let mut sdo_poller = SdoPoller::new(NodeId::FIRST, false);
    assert_eq!(sdo_poller.poll(0, false), (None, None));
    sdo_poller.bus_is_full(0);
    assert!((0..9_000).all(|now_ms| sdo_poller.poll(now_ms * MS, true).0.is_none()));
    sdo_poller.request(Request::Arm);
    assert!(sdo_poller.poll(9_000 * MS, true).0.is_some());
    assert_eq!(sdo_poller.poll(9_300 * MS, false).1, Some(SdoReply::Unanswered(Request::Arm)));
}
