//! A joint driver as a CANopen node (CiA 301): network state, heartbeat, emergencies, objects.
//!
//! A node starts in *pre-operational*: its objects can be read and written, process frames are ignored.
//! *Operational* enables process frames; in *stopped* only the heartbeat remains. None of these states arms
//! a joint. Arming is a request to the supervisor, so a broadcast "start" moves no shaft. Outgoing frames
//! wait in an [`Outbox`] until the controller accepts them. Frames that do not fit are counted and dropped.
//!
//! `canopen-rs` provides the network state machine and the coding of NMT, heartbeat and emergency frames.
//! The SDO server is our own; see [`sdo`] for the reason.

pub mod bit_timing;
pub mod dictionary;
pub mod lss;
pub mod sdo;

use canopen_rs::emcy::{EmergencyMessage, emcy_cob_id};
use canopen_rs::nmt::{
    HEARTBEAT_COB_BASE, NMT_COMMAND_COB_ID, decode_command, encode_heartbeat, heartbeat_cob_id,
};
use canopen_rs::{ErrorRegister, NmtCommand, NmtState, NmtStateMachine, NodeId as CanopenNodeId};
use compensator_core::can::{FdTelemetry, Frame, NodeId};
use heapless::Deque;

/// Maximum number of frames that wait to be sent. A sample produces three frames, an SDO request one.
pub const OUTBOX_CAPACITY: usize = 16;

/// Queue of outgoing frames.
#[derive(Debug, Default)]
pub struct Outbox {
    frames: Deque<Frame, OUTBOX_CAPACITY>,
    /// Frame of CAN FD that waits.
    fd: Option<FdTelemetry>,
    sent: u32,
    lost: u32,
}

impl Outbox {
    /// Adds a frame. If the queue is full, the frame is dropped and counted.
    // Not inlined: it has many callers.
    #[inline(never)]
    pub fn push(&mut self, frame: Frame) {
        if self.frames.push_back(frame).is_err() {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// Removes and returns the oldest frame.
    pub fn pop(&mut self) -> Option<Frame> {
        self.take(|_| true)
    }

    /// Removes and returns the oldest frame whose identifier can be sent now. Frames before it keep their order.
    pub fn take(&mut self, mut can_send: impl FnMut(u16) -> bool) -> Option<Frame> {
        let mut found = None;
        let mut left = self.frames.len();
        while left > 0 {
            let frame = self.frames.pop_front()?;
            left -= 1;
            if found.is_none() && can_send(frame.identifier()) {
                found = Some(frame);
                // Without frames before it, the others are in their order.
                if left == self.frames.len() {
                    break;
                }
            } else {
                // There is room: it was just removed.
                let _ = self.frames.push_back(frame);
            }
        }
        self.sent = self.sent.wrapping_add(u32::from(found.is_some()));
        found
    }

    /// Stores a frame of CAN FD. One that still waits is dropped and counted: it is of an earlier sample.
    pub fn set_fd(&mut self, frame: FdTelemetry) {
        if self.fd.replace(frame).is_some() {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// Removes and returns the frame of CAN FD, if its identifier can be sent now.
    pub fn take_fd(&mut self, can_send: impl FnOnce(u16) -> bool) -> Option<FdTelemetry> {
        let frame = self.fd.take_if(|frame| can_send(frame.identifier()))?;
        self.sent = self.sent.wrapping_add(1);
        Some(frame)
    }

    /// Returns true if no classic frame waits.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Returns the number of frames removed so far.
    pub const fn sent(&self) -> u32 {
        self.sent
    }

    /// Returns the number of frames dropped because the queue was full.
    pub const fn lost(&self) -> u32 {
        self.lost
    }
}

/// Action that a network command requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtAction {
    /// The state machine is in this state; nothing else is to be done.
    State(NmtState),
    /// Restart as after power-up.
    Reset,
    /// Restart the communication; settings and parameters stay.
    ResetCommunication,
}

/// An error that was raised or cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code of CiA 301; 0 if the error was cleared.
    pub code: u16,
    /// Error register, object 1001h.
    pub register: u8,
    /// Manufacturer specific.
    pub detail: [u8; 5],
}

/// The network functions that every CANopen device has.
#[derive(Debug)]
pub struct Network {
    node: NodeId,
    machine: NmtStateMachine,
    sent_us: u64,
    /// Time of the last monitored heartbeat, us.
    heartbeat_us: Option<u64>,
}

impl Network {
    /// Creates a node that has not booted.
    pub fn new(node: NodeId, now_us: u64) -> Self {
        Self { node, machine: NmtStateMachine::new(), sent_us: now_us, heartbeat_us: None }
    }

    /// Sends the boot-up message and enters pre-operational.
    #[inline(never)]
    pub fn boot(node: NodeId, now_us: u64, outbox: &mut Outbox) -> Self {
        let mut network = Self::new(node, now_us);
        outbox.push(heartbeat(node, NmtState::Initialising));
        network.machine.boot();
        network
    }

    /// Returns the node number.
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// Returns the network state.
    pub const fn state(&self) -> NmtState {
        self.machine.state()
    }

    /// Returns true if process frames are sent and received.
    pub fn is_operational(&self) -> bool {
        self.state() == NmtState::Operational
    }

    /// Returns true if objects can be read and written.
    pub fn can_serve_objects(&self) -> bool {
        matches!(self.state(), NmtState::Operational | NmtState::PreOperational)
    }

    /// Handles a network command if the frame is one and addresses this node.
    pub fn on_nmt_frame(&mut self, frame: &Frame) -> Option<NmtAction> {
        if frame.identifier() != NMT_COMMAND_COB_ID {
            return None;
        }
        let data: &[u8; 2] = frame.data().try_into().ok()?;
        let (command, target) = decode_command(data).ok()?;
        if target != CanopenNodeId::BROADCAST && target.raw() != self.node.number() {
            return None;
        }
        Some(match command {
            NmtCommand::ResetNode => NmtAction::Reset,
            NmtCommand::ResetCommunication => NmtAction::ResetCommunication,
            other => NmtAction::State(self.machine.apply(other)),
        })
    }

    /// Handles a heartbeat of the monitored node (`awaited` has the format of object 1016h). Returns true
    /// if the frame is one.
    pub fn on_heartbeat(&mut self, frame: &Frame, awaited: u32, now_us: u64) -> bool {
        let producer = (awaited >> 16) as u16 & 0x7F;
        let is_heartbeat = awaited != 0
            && frame.identifier() == HEARTBEAT_COB_BASE + producer
            && frame.data().len() == 1;
        if is_heartbeat {
            self.heartbeat_us = Some(now_us);
        }
        is_heartbeat
    }

    /// Returns true if the monitored heartbeat was received once and has been missing for longer than its
    /// timeout.
    pub fn is_heartbeat_missing(&self, awaited: u32, now_us: u64) -> bool {
        let timeout_us = u64::from(awaited & 0xFFFF) * 1000;
        let is_late = |received_us: u64| now_us.saturating_sub(received_us) > timeout_us;
        awaited != 0 && timeout_us > 0 && self.heartbeat_us.is_some_and(is_late)
    }

    /// Sends a heartbeat if one is due; `every_ms` 0 disables it.
    pub fn tick(&mut self, every_ms: u16, now_us: u64, outbox: &mut Outbox) {
        let period_us = u64::from(every_ms) * 1000;
        if period_us > 0 && now_us.saturating_sub(self.sent_us) >= period_us {
            self.sent_us = now_us;
            outbox.push(heartbeat(self.node, self.state()));
        }
    }

    /// Sends an emergency.
    pub fn send_emergency(&self, emergency: &Emergency, outbox: &mut Outbox) {
        let Emergency { code, register, detail } = *emergency;
        let message = EmergencyMessage::new(code, ErrorRegister(register), detail);
        if let Ok(id) = CanopenNodeId::new(self.node.number())
            && let Some(frame) = Frame::new(emcy_cob_id(id), &message.encode())
        {
            outbox.push(frame);
        }
    }
}

fn heartbeat(node: NodeId, state: NmtState) -> Frame {
    // The node number is legal and one byte fits, so the default frame is never sent.
    CanopenNodeId::new(node.number())
        .ok()
        .and_then(|id| Frame::new(heartbeat_cob_id(id), &encode_heartbeat(state)))
        .unwrap_or(Frame::EMPTY)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(identifier: u16, data: &[u8]) -> Frame {
        Frame::new(identifier, data).unwrap()
    }

    #[test]
    fn take_passes_over_identifiers_that_wait_and_keeps_the_order() {
        let mut outbox = Outbox::default();
        for (identifier, data) in [(0x705, 1), (0x185, 2), (0x285, 3), (0x185, 4)] {
            outbox.push(frame(identifier, &[data]));
        }
        let mut taken = |waiting: u16| {
            outbox.take(|identifier| identifier != waiting).map(|frame| frame.data()[0])
        };
        assert_eq!([taken(0x705), taken(0x705), taken(0x285)], [Some(2), Some(3), Some(1)]);
        assert_eq!([taken(0x185), taken(0), taken(0)], [None, Some(4), None]);
        assert_eq!(outbox.sent(), 4);
    }

    #[test]
    fn network_follows_nmt_commands_after_boot() {
        let mut outbox = Outbox::default();
        let node = NodeId::new(5).unwrap();
        let mut network = Network::boot(node, 0, &mut outbox);
        assert_eq!(outbox.pop(), Some(frame(0x705, &[0])));
        assert_eq!(network.state(), NmtState::PreOperational);
        assert!(!network.is_operational() && network.can_serve_objects());
        let state = |state| Some(NmtAction::State(state));
        assert_eq!(network.on_nmt_frame(&frame(0, &[1, 4])), None);
        assert_eq!(network.on_nmt_frame(&frame(0, &[1, 5])), state(NmtState::Operational));
        assert_eq!(network.on_nmt_frame(&frame(0, &[2, 0])), state(NmtState::Stopped));
        assert!(!network.can_serve_objects());
        assert_eq!(network.on_nmt_frame(&frame(0, &[0x81, 0])), Some(NmtAction::Reset));
        for wrong in [&[1][..], &[7, 5], &[1, 5, 0], &[1, 128]] {
            assert_eq!(network.on_nmt_frame(&frame(0, wrong)), None);
        }
    }

    #[test]
    fn heartbeat_is_sent_periodically_and_a_missing_one_is_detected() {
        let mut outbox = Outbox::default();
        let mut network = Network::boot(NodeId::FIRST, 0, &mut outbox);
        outbox.pop();
        for now_ms in 0..=1000u64 {
            network.tick(100, now_ms * 1000, &mut outbox);
        }
        assert_eq!(core::iter::from_fn(|| outbox.pop()).count(), 10);
        network.tick(0, 1_000_000_000, &mut outbox);
        assert_eq!(outbox.pop(), None);

        let awaited = 7 << 16 | 50;
        // Not received yet, so nothing is missing.
        assert!(!network.is_heartbeat_missing(awaited, 1_000_000));
        assert!(!network.on_heartbeat(&frame(0x708, &[5]), awaited, 0));
        assert!(network.on_heartbeat(&frame(0x707, &[5]), awaited, 1_000_000));
        assert!(!network.is_heartbeat_missing(awaited, 1_050_000));
        assert!(network.is_heartbeat_missing(awaited, 1_050_001));
        assert!(!network.is_heartbeat_missing(0, 9_000_000));
    }

    #[test]
    fn push_to_full_outbox_counts_the_lost_frame() {
        let mut outbox = Outbox::default();
        for _ in 0..OUTBOX_CAPACITY + 3 {
            outbox.push(frame(1, &[]));
        }
        assert_eq!((outbox.lost(), outbox.sent()), (3, 0));
        while outbox.pop().is_some() {}
        assert_eq!(outbox.sent(), OUTBOX_CAPACITY as u32);
    }

    #[test]
    fn emergency_frame_holds_code_register_and_detail() {
        let mut outbox = Outbox::default();
        let network = Network::boot(NodeId::FIRST, 0, &mut outbox);
        outbox.pop();
        let emergency = Emergency { code: 0x3210, register: 0x04, detail: [1, 2, 3, 4, 5] };
        network.send_emergency(&emergency, &mut outbox);
        assert_eq!(outbox.pop(), Some(frame(0x081, &[0x10, 0x32, 0x04, 1, 2, 3, 4, 5])));
    }
}
