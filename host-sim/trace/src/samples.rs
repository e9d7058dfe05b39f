//! Assembly of frames into samples.
//!
//! * A SYNC ends a sample. Its time stamp is the time of the sample.
//! * The fast PDOs (motion, torque) must arrive between two SYNCs. A joint that sends its torque at every n-th SYNC gives a
//!   sample at every n-th one. The slow PDOs (seal, surroundings) keep their last
//!   values, as in the driver.
//! * The driver's answers follow the SYNC, so a sample is complete when the next one begins.
//! * The assembler follows one joint on one interface: the first joint whose inputs it receives. The [`Summary`] lists
//!   the others, because each joint is a data set of its own.
//! * The frame with both sides of the gear (260h + node) gives the position of the joint's side.
//! * A damaged frame of the joint invalidates its own sample only.

mod sample;

pub use sample::TraceSample;

use crate::frame::{CanFrame, Line};
use compensator_core::can::{
    FdTelemetry, Frame, FrameError, JointKind, Message, NodeId, SyncFrame, TraceEntry,
};
use sample::{NO_MOTION, NO_TORQUE};
use std::fmt;

/// Counts of a log.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Lines with a frame.
    pub frames: u64,
    /// Samples completed by a SYNC.
    pub samples: u64,
    /// Missing samples, from the counter of the SYNCs.
    pub lost: u64,
    /// Samples with an answer from the driver.
    pub answers: u64,
    /// Error frames.
    pub errors: u64,
    /// Frames that are not process data of the joint.
    pub foreign: u64,
    /// The joint that was followed.
    pub joint: Option<JointOnBus>,
    /// Other joints with inputs in the log; at most 16.
    pub others: Vec<JointOnBus>,
    /// Kind of the joint: revolute or prismatic.
    pub kind: JointKind,
}

/// A joint by its place in a log, displayed as `3 on can0`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointOnBus {
    /// Name of the interface, as in the log.
    pub interface: Box<[u8]>,
    /// Its node.
    pub node: NodeId,
}

impl JointOnBus {
    /// Returns true if it is the joint of this interface and node.
    #[inline]
    pub fn is(&self, interface: &[u8], node: NodeId) -> bool {
        self.node == node && *self.interface == *interface
    }
}

impl fmt::Display for JointOnBus {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} on {}", self.node.number(), String::from_utf8_lossy(&self.interface))
    }
}

/// The last SYNC of a run.
#[derive(Clone, Copy, Debug)]
struct LastSync {
    sequence: u32,
    counter: u8,
}

/// Maximum number of other joints in [`Summary::others`].
const MAX_OTHER_JOINTS: usize = 16;

/// Assembles frames into samples.
#[derive(Debug, Default)]
pub struct Assembler {
    joint: Option<JointOnBus>,
    /// Values since the last SYNC, and the last values of the slow PDOs.
    open: TraceSample,
    has_motion: bool,
    has_torque: bool,
    /// Sequence number of the last sample with a torque, and the least distance of two of them.
    last_torque: Option<u32>,
    torque_every: Option<u32>,
    /// The completed sample, whose answers may follow.
    closed: Option<TraceSample>,
    /// `None` before the first SYNC of a run.
    last: Option<LastSync>,
    /// Sequence number announced for the next sample.
    announced: Option<u32>,
    summary: Summary,
}

impl Assembler {
    /// Processes the next line of a log. Returns the previous sample once it is complete.
    #[inline]
    pub fn push(&mut self, number: u64, line: &Line) -> Option<TraceSample> {
        self.summary.frames += 1;
        let frame = match &line.frame {
            CanFrame::Data { identifier, extended: false, length, bytes } => {
                let data = bytes.get(..usize::from(*length)).unwrap_or_default();
                Frame::new(*identifier as u16, data)
            }
            CanFrame::Error { .. } => {
                self.summary.errors += 1;
                return None;
            }
            frame => match frame.to_telemetry() {
                Some(telemetry) => return self.telemetry(number, line, &telemetry),
                None => None,
            },
        };
        self.frame(number, line, frame)
    }

    /// Processes the frames in a CAN FD frame.
    fn telemetry(&mut self, number: u64, line: &Line, of: &FdTelemetry) -> Option<TraceSample> {
        // The first frame of a sample completes the one before, so at most one is returned.
        of.frames().fold(None, |completed, frame| {
            let sample = self.frame(number, line, Some(frame));
            completed.or(sample)
        })
    }

    #[inline]
    fn frame(&mut self, number: u64, line: &Line, frame: Option<Frame>) -> Option<TraceSample> {
        if let Some(side) = frame.as_ref().and_then(JointSide::of) {
            if self.is_followed(line.interface, side.node) {
                self.open.joint_position_rad = side.position_rad;
            } else {
                self.summary.foreign += 1;
            }
            return None;
        }
        let message = frame.map(|frame| (Message::parse(&frame), frame));
        match message {
            Some((Ok(message), _)) => self.message(number, line, message),
            Some((Err(FrameError::Foreign(_)), _)) | None => {
                self.summary.foreign += 1;
                None
            }
            Some((Err(fault), frame)) => {
                self.fault(line, &frame, fault);
                None
            }
        }
    }

    /// Returns the last sample and the summary.
    pub fn finish(mut self) -> (Option<TraceSample>, Summary) {
        let last = self.take_completed();
        self.summary.joint = self.joint;
        (last, self.summary)
    }

    fn take_completed(&mut self) -> Option<TraceSample> {
        let sample = self.closed.take()?;
        self.summary.samples += 1;
        self.summary.answers += u64::from(sample.answer.is_some());
        Some(sample)
    }

    /// Returns true if the frame belongs to the followed joint. The first input selects that joint.
    #[inline]
    fn select_or_match(&mut self, interface: &[u8], node: NodeId) -> bool {
        let Some(joint) = &self.joint else {
            self.joint = Some(JointOnBus { interface: interface.into(), node });
            return true;
        };
        let is_followed = joint.is(interface, node);
        if !is_followed {
            self.count_other(interface, node);
        }
        is_followed
    }

    fn count_other(&mut self, interface: &[u8], node: NodeId) {
        self.summary.foreign += 1;
        let others = &mut self.summary.others;
        if others.len() < MAX_OTHER_JOINTS && !others.iter().any(|of| of.is(interface, node)) {
            others.push(JointOnBus { interface: interface.into(), node });
        }
    }

    #[inline]
    fn is_followed(&self, interface: &[u8], node: NodeId) -> bool {
        self.joint.as_ref().is_some_and(|joint| joint.is(interface, node))
    }

    #[inline]
    fn message(&mut self, number: u64, line: &Line, message: Message) -> Option<TraceSample> {
        let interface = line.interface;
        match message {
            Message::Motion(node, _)
            | Message::Torque(node, _)
            | Message::Seal(node, _)
            | Message::Surroundings(node, _)
            | Message::Entry(node, _) => {
                if self.select_or_match(interface, node) {
                    let completed = self.take_completed();
                    self.input(message);
                    return completed;
                }
            }
            // Commands and telemetry are not part of a sample.
            Message::Command(..) | Message::Telemetry(..) => {}
            Message::Sync(sync) => {
                if self.joint.as_ref().is_some_and(|joint| *joint.interface == *interface) {
                    let completed = self.take_completed();
                    self.close(number, line.time_ns, sync);
                    return completed;
                }
                self.summary.foreign += 1;
            }
            Message::Answer(node, _) | Message::Status(node, _) => {
                let is_followed = self.is_followed(interface, node);
                match (&mut self.closed, message) {
                    (Some(closed), Message::Answer(_, answer)) if is_followed => {
                        closed.answer = Some(answer);
                    }
                    (Some(closed), Message::Status(_, status)) if is_followed => {
                        closed.status = Some(status);
                    }
                    _ => self.summary.foreign += 1,
                }
            }
        }
        None
    }

    /// Takes an input of the followed joint over.
    #[inline]
    fn input(&mut self, message: Message) {
        match message {
            Message::Motion(_, motion) => (self.open.motion, self.has_motion) = (motion, true),
            Message::Torque(_, torque) => (self.open.torque, self.has_torque) = (torque, true),
            Message::Seal(_, seal) => self.open.seal = seal,
            Message::Surroundings(_, surroundings) => self.open.surroundings = surroundings,
            Message::Entry(_, entry) => self.entry(entry),
            _ => {}
        }
    }

    fn entry(&mut self, entry: TraceEntry) {
        match entry {
            TraceEntry::Run(run) => {
                // The values of the slow PDOs belong to the previous run.
                self.open = TraceSample { run: Some(run), ..TraceSample::EMPTY };
                (self.has_motion, self.has_torque) = (false, false);
                (self.last, self.announced) = (None, Some(0));
                self.last_torque = None;
            }
            TraceEntry::Sequence(number) => self.announced = Some(number),
            TraceEntry::JointKind(kind) => self.summary.kind = kind,
        }
    }

    #[inline]
    fn close(&mut self, number: u64, time_ns: u64, sync: SyncFrame) {
        let sequence = self.count(sync);
        // A SYNC without values of this joint ends no sample of it.
        let has_values = self.has_motion || self.has_torque || self.open.fault.is_some();
        if has_values && self.is_torque_due(sequence) {
            let mut sample = TraceSample { line: number, time_ns, sequence, ..self.open };
            if sample.fault.is_some() {
                // Invalidates the sample whichever frame is damaged: a slow PDO would otherwise keep its old value.
                sample.motion = NO_MOTION;
            }
            self.closed = Some(sample);
        }
        if has_values {
            self.open.motion = NO_MOTION;
            self.open.torque = NO_TORQUE;
            self.open.joint_position_rad = f64::NAN;
            self.open.fault = None;
            (self.has_motion, self.has_torque) = (false, false);
        }
    }

    /// Returns false for a sample between two with a torque, of a joint that does not send it at every SYNC.
    fn is_torque_due(&mut self, sequence: u32) -> bool {
        let Some(last) = self.last_torque.replace(sequence) else {
            self.last_torque = self.has_torque.then_some(sequence);
            return true;
        };
        let distance = sequence.wrapping_sub(last).max(1);
        if self.has_torque {
            let least = self.torque_every.map_or(distance, |every| every.min(distance));
            self.torque_every = Some(least);
            return true;
        }
        self.last_torque = Some(last);
        self.torque_every.is_none_or(|every| distance.is_multiple_of(every))
    }

    /// Returns the sequence number of the sample that this SYNC ends. Without an announced number, the loss of a
    /// multiple of 240 samples is not detected.
    #[inline]
    fn count(&mut self, sync: SyncFrame) -> u32 {
        let sequence = match (self.announced.take(), self.last) {
            (Some(announced), _) => announced,
            (None, Some(last)) => {
                let round = u32::from(SyncFrame::LAST);
                let passed = (round + u32::from(sync.counter) - u32::from(last.counter)) % round;
                last.sequence.wrapping_add(if passed == 0 { round } else { passed })
            }
            (None, None) => u32::from(sync.counter) - 1,
        };
        if let Some(last) = self.last {
            let next = last.sequence.saturating_add(1);
            self.summary.lost += u64::from(sequence.saturating_sub(next));
        }
        self.last = Some(LastSync { sequence, counter: sync.counter });
        sequence
    }

    fn fault(&mut self, line: &Line, frame: &Frame, fault: FrameError) {
        let node = NodeId::new((frame.identifier() & 0x7F) as u8);
        let is_sync = frame.identifier() == 0x080;
        let is_followed = |joint: &JointOnBus| {
            *joint.interface == *line.interface && (is_sync || node == Some(joint.node))
        };
        match &self.joint {
            // A damaged SYNC ends no sample. The next sequence number shows the loss.
            Some(joint) if is_followed(joint) && is_sync => {}
            Some(joint) if is_followed(joint) => self.open.fault = Some(fault),
            _ => self.summary.foreign += 1,
        }
    }
}

/// The position at the joint's side of the gear.
struct JointSide {
    node: NodeId,
    /// NaN without a position.
    position_rad: f64,
}

impl JointSide {
    /// Returns the joint's side in a frame with both sides of the gear.
    ///
    /// Identifier 260h + node, for the nodes 1 to 31, with 60E4h:1 and 6064h: those that receive the Drive frame of nodes above 95.
    fn of(frame: &Frame) -> Option<Self> {
        const SIDES: u16 = 0x260;
        const NODES: u16 = 0x1F;
        let node = NodeId::new((frame.identifier() & NODES) as u8)?;
        let [a, b, c, d, _, _, _, _] = *frame.data() else { return None };
        let position = i32::from_le_bytes([a, b, c, d]);
        let position_rad = if position == i32::MIN { f64::NAN } else { f64::from(position) / 1e6 };
        (frame.identifier() & !NODES == SIDES).then_some(Self { node, position_rad })
    }
}

#[cfg(test)]
mod tests;
