//! A joint driver as a CANopen node (CiA 301): network state, heartbeat, emergencies, objects.
//!
//! A node starts in *pre-operational*: its objects can be read and written, process frames are passed
//! over. *Operational* switches those on, *stopped* leaves nothing but the heartbeat. None of this arms
//! a joint: that is the supervisor's, so a broadcast "start" moves no shaft. What leaves a node waits in
//! an [`Outbox`] until the controller takes it; what does not fit is counted, never waited for.
//!
//! The network's state machine and the codes of NMT, heartbeat and emergency are `canopen-rs`'s. Of the
//! others looked at, `zencan-node` 0.0.5 keeps its objects in statics made by a macro, so two joints in
//! one process cannot be. The SDO server is our own; see [`sdo`] for why.

pub mod bit_timing;
pub mod dictionary;
pub mod sdo;

use canopen_rs::emcy::{EmergencyMessage, emcy_cob_id};
use canopen_rs::nmt::{
    HEARTBEAT_COB_BASE, NMT_COMMAND_COB_ID, decode_command, encode_heartbeat, heartbeat_cob_id,
};
use canopen_rs::{ErrorRegister, NmtCommand, NmtState, NmtStateMachine, NodeId};
use compensator_core::can::{Frame, Node};
use heapless::Deque;

/// Frames that wait to be sent, at most. A sample makes three, an SDO one.
pub const OUTBOX: usize = 16;

/// Frames on their way out.
#[derive(Debug, Default)]
pub struct Outbox {
    frames: Deque<Frame, OUTBOX>,
    sent: u32,
    lost: u32,
}

impl Outbox {
    /// Puts a frame in; where there is no room it is lost, and counted.
    pub fn push(&mut self, frame: Frame) {
        if self.frames.push_back(frame).is_err() {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// Takes the oldest frame out.
    pub fn pop(&mut self) -> Option<Frame> {
        let frame = self.frames.pop_front()?;
        self.sent = self.sent.wrapping_add(1);
        Some(frame)
    }

    /// Frames taken out so far.
    pub const fn sent(&self) -> u32 {
        self.sent
    }

    /// Frames there was no room for.
    pub const fn lost(&self) -> u32 {
        self.lost
    }
}

/// What a network command leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtAction {
    /// The state is another, or the same; nothing else is to be done.
    State(NmtState),
    /// Start anew, as after power-up.
    Reset,
    /// Start the bus side anew: settings and parameters stay.
    ResetCommunication,
}

/// The part of a node that every CANopen device has.
#[derive(Debug)]
pub struct Network {
    node: Node,
    machine: NmtStateMachine,
    sent_us: u64,
    /// When the awaited heartbeat last came.
    heartbeat_us: Option<u64>,
}

impl Network {
    /// Says that it is there, and becomes pre-operational.
    pub fn boot(node: Node, now_us: u64, outbox: &mut Outbox) -> Self {
        let mut machine = NmtStateMachine::new();
        let network = |machine| Self { node, machine, sent_us: now_us, heartbeat_us: None };
        outbox.push(heartbeat(node, NmtState::Initialising));
        machine.boot();
        network(machine)
    }

    /// The node's number.
    pub const fn node(&self) -> Node {
        self.node
    }

    /// The network's state.
    pub const fn state(&self) -> NmtState {
        self.machine.state()
    }

    /// Whether process frames are spoken and heard.
    pub fn is_operational(&self) -> bool {
        self.state() == NmtState::Operational
    }

    /// Whether objects can be read and written.
    pub fn serves_objects(&self) -> bool {
        matches!(self.state(), NmtState::Operational | NmtState::PreOperational)
    }

    /// Takes in a network command, where the frame is one and this node is meant.
    pub fn on_nmt_frame(&mut self, frame: &Frame) -> Option<NmtAction> {
        if frame.identifier() != NMT_COMMAND_COB_ID {
            return None;
        }
        let data: &[u8; 2] = frame.data().try_into().ok()?;
        let (command, target) = decode_command(data).ok()?;
        if target != NodeId::BROADCAST && target.raw() != self.node.number() {
            return None;
        }
        Some(match command {
            NmtCommand::ResetNode => NmtAction::Reset,
            NmtCommand::ResetCommunication => NmtAction::ResetCommunication,
            other => NmtAction::State(self.machine.apply(other)),
        })
    }

    /// Takes in a heartbeat, where the frame is one of the node awaited (`awaited` as in object 1016h).
    pub fn on_heartbeat(&mut self, frame: &Frame, awaited: u32, now_us: u64) -> bool {
        let producer = (awaited >> 16) as u16 & 0x7F;
        let is_it = awaited != 0 && frame.identifier() == HEARTBEAT_COB_BASE + producer;
        if is_it && frame.data().len() == 1 {
            self.heartbeat_us = Some(now_us);
        }
        is_it
    }

    /// Whether an awaited heartbeat that had been heard has stayed away for too long.
    pub fn misses_heartbeat(&self, awaited: u32, now_us: u64) -> bool {
        let longest_us = u64::from(awaited & 0xFFFF) * 1000;
        let late = |came: u64| now_us.saturating_sub(came) > longest_us;
        awaited != 0 && longest_us > 0 && self.heartbeat_us.is_some_and(late)
    }

    /// Sends a heartbeat where one is due; `every_ms` 0 is never.
    pub fn tick(&mut self, every_ms: u16, now_us: u64, outbox: &mut Outbox) {
        let period_us = u64::from(every_ms) * 1000;
        if period_us > 0 && now_us.saturating_sub(self.sent_us) >= period_us {
            self.sent_us = now_us;
            outbox.push(heartbeat(self.node, self.state()));
        }
    }

    /// Sends an emergency: an error came (its code of CiA 301) or the last one went (code 0).
    /// `detail` is the joint's own.
    pub fn emergency(&self, code: u16, register: u8, detail: [u8; 5], outbox: &mut Outbox) {
        let message = EmergencyMessage::new(code, ErrorRegister(register), detail);
        if let Ok(id) = NodeId::new(self.node.number())
            && let Some(frame) = Frame::new(emcy_cob_id(id), &message.encode())
        {
            outbox.push(frame);
        }
    }
}

fn heartbeat(node: Node, state: NmtState) -> Frame {
    // A node's number is legal, and one byte fits: the frame in the default is never sent.
    NodeId::new(node.number())
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
    fn it_boots_and_is_told_what_to_do() {
        let mut outbox = Outbox::default();
        let node = Node::new(5).unwrap();
        let mut network = Network::boot(node, 0, &mut outbox);
        assert_eq!(outbox.pop(), Some(frame(0x705, &[0])));
        assert_eq!(network.state(), NmtState::PreOperational);
        assert!(!network.is_operational() && network.serves_objects());
        let state = |state| Some(NmtAction::State(state));
        assert_eq!(network.on_nmt_frame(&frame(0, &[1, 4])), None);
        assert_eq!(network.on_nmt_frame(&frame(0, &[1, 5])), state(NmtState::Operational));
        assert_eq!(network.on_nmt_frame(&frame(0, &[2, 0])), state(NmtState::Stopped));
        assert!(!network.serves_objects());
        assert_eq!(network.on_nmt_frame(&frame(0, &[0x81, 0])), Some(NmtAction::Reset));
        for wrong in [&[1][..], &[7, 5], &[1, 5, 0], &[1, 128]] {
            assert_eq!(network.on_nmt_frame(&frame(0, wrong)), None);
        }
    }

    #[test]
    fn it_sends_heartbeats_and_misses_them() {
        let mut outbox = Outbox::default();
        let mut network = Network::boot(Node::FIRST, 0, &mut outbox);
        outbox.pop();
        for now_ms in 0..=1000u64 {
            network.tick(100, now_ms * 1000, &mut outbox);
        }
        assert_eq!(core::iter::from_fn(|| outbox.pop()).count(), 10);
        network.tick(0, 1_000_000_000, &mut outbox);
        assert_eq!(outbox.pop(), None);

        let awaited = 7 << 16 | 50;
        // Not heard of yet: there is nobody to miss.
        assert!(!network.misses_heartbeat(awaited, 1_000_000));
        assert!(!network.on_heartbeat(&frame(0x708, &[5]), awaited, 0));
        assert!(network.on_heartbeat(&frame(0x707, &[5]), awaited, 1_000_000));
        assert!(!network.misses_heartbeat(awaited, 1_050_000));
        assert!(network.misses_heartbeat(awaited, 1_050_001));
        assert!(!network.misses_heartbeat(0, 9_000_000));
    }

    #[test]
    fn what_has_no_room_is_counted() {
        let mut outbox = Outbox::default();
        for _ in 0..OUTBOX + 3 {
            outbox.push(frame(1, &[]));
        }
        assert_eq!((outbox.lost(), outbox.sent()), (3, 0));
        while outbox.pop().is_some() {}
        assert_eq!(outbox.sent(), OUTBOX as u32);
    }

    #[test]
    fn an_emergency_has_its_code_register_and_detail() {
        let mut outbox = Outbox::default();
        let network = Network::boot(Node::FIRST, 0, &mut outbox);
        outbox.pop();
        network.emergency(0x3210, 0x04, [1, 2, 3, 4, 5], &mut outbox);
        assert_eq!(outbox.pop(), Some(frame(0x081, &[0x10, 0x32, 0x04, 1, 2, 3, 4, 5])));
    }
}
