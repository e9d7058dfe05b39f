//! Frames put together to samples.
//!
//! A SYNC ends a sample: its stamp is the sample's time, and the two fast PDOs, motion and torque, must
//! have come since the SYNC before. The slow ones, seal and surroundings, keep their last values, as a
//! driver keeps them: a thermometer need not speak at every sample. The driver's answers come after the
//! SYNC, so a sample is handed out when the next one begins. One joint on one interface is followed, the
//! first whose inputs are seen; inputs of others are told in the [`Summary`], for two joints are two data
//! sets. A frame of the joint that is damaged spoils its sample and no other.

use super::candump::{CanFrame, Line};
use compensator_core::can::{
    Answer, Entry, Frame, FrameError, JointKind, Message, Motion, Node, Seal, Status, Surroundings,
    Sync, Torque,
};
use compensator_core::quantity::Quantity;

/// A sample as it was on the bus. What nobody measures, and what did not arrive, is NaN.
#[derive(Clone, Copy, Debug)]
pub struct TraceSample {
    /// Line of the SYNC in the log, from 1.
    pub line: u64,
    /// Stamp of the SYNC, ns.
    pub time_ns: u64,
    /// The run it belongs to; `None` before the first run begins.
    pub run: Option<u32>,
    /// Its number in the run, from 0; lost ones counted.
    pub sequence: u32,
    /// How the joint moves.
    pub motion: Motion,
    /// What drives it.
    pub torque: Torque,
    /// What presses the seal.
    pub seal: Seal,
    /// What else changes friction.
    pub surroundings: Surroundings,
    /// What the driver made of it.
    pub answer: Option<Answer>,
    /// What happened on the way.
    pub status: Option<Status>,
    /// A frame of this sample that could not be read.
    pub fault: Option<FrameError>,
}

const NO_MOTION: Motion = Motion { velocity_rad_s: f32::NAN, position_rad: f32::NAN };
const NO_TORQUE: Torque = Torque { torque_nm: f32::NAN, load_torque_nm: f32::NAN };
const NO_SEAL: Seal = Seal { radial_force_n: f32::NAN, pressure_diff_pa: f32::NAN };
const NO_SURROUNDINGS: Surroundings = Surroundings { temperature_c: f32::NAN, auxiliary: f32::NAN };

impl TraceSample {
    /// A sample of which nothing is known.
    pub const EMPTY: Self = Self {
        line: 0,
        time_ns: 0,
        run: None,
        sequence: 0,
        motion: NO_MOTION,
        torque: NO_TORQUE,
        seal: NO_SEAL,
        surroundings: NO_SURROUNDINGS,
        answer: None,
        status: None,
        fault: None,
    };

    /// What was measured of a quantity, in the unit of its column in a log; NaN of what was not, and of what
    /// no frame carries.
    pub fn get(&self, quantity: Quantity) -> f32 {
        let mut copy = *self;
        copy.place(quantity).map_or(f32::NAN, |value| *value)
    }

    /// Sets what was measured of a quantity; of what no frame carries, nothing.
    pub fn set(&mut self, quantity: Quantity, value: f32) {
        if let Some(place) = self.place(quantity) {
            *place = value;
        }
    }

    /// Where a quantity stands in the frames.
    fn place(&mut self, quantity: Quantity) -> Option<&mut f32> {
        Some(match quantity {
            Quantity::Velocity => &mut self.motion.velocity_rad_s,
            Quantity::Position => &mut self.motion.position_rad,
            Quantity::Torque => &mut self.torque.torque_nm,
            Quantity::LoadTorque => &mut self.torque.load_torque_nm,
            Quantity::RadialForce => &mut self.seal.radial_force_n,
            Quantity::Pressure => &mut self.seal.pressure_diff_pa,
            Quantity::Temperature => &mut self.surroundings.temperature_c,
            Quantity::Auxiliary => &mut self.surroundings.auxiliary,
            Quantity::CampaignTime | Quantity::Acceleration => return None,
        })
    }
}

/// What there was in a log.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Lines with a frame.
    pub frames: u64,
    /// Samples that were ended by a SYNC.
    pub samples: u64,
    /// Samples that are missing by the count of the SYNCs.
    pub lost: u64,
    /// Samples with an answer of the driver.
    pub answers: u64,
    /// Error frames.
    pub errors: u64,
    /// Frames that are no process data of the joint.
    pub foreign: u64,
    /// The joint that was followed: interface and node.
    pub joint: Option<(String, u8)>,
    /// Joints with inputs of their own that were not followed, the first few.
    pub others: Vec<(String, u8)>,
    /// Whether the joint turns or slides.
    pub kind: JointKind,
}

/// How many joints beside the one followed are told by name.
const MOST_OTHERS: usize = 16;

/// Takes frames and gives samples.
#[derive(Debug)]
pub struct Assembler {
    joint: Option<(Box<[u8]>, Node)>,
    /// What has come since the last SYNC, and what the slow PDOs hold.
    open: TraceSample,
    heard_motion: bool,
    heard_torque: bool,
    /// The sample that waits for its answers.
    closed: Option<TraceSample>,
    /// Number and counter of the last SYNC in this run.
    last: Option<(u32, u8)>,
    /// The number the next sample was said to have.
    announced: Option<u32>,
    summary: Summary,
}

impl Default for Assembler {
    fn default() -> Self {
        Self {
            joint: None,
            open: TraceSample::EMPTY,
            heard_motion: false,
            heard_torque: false,
            closed: None,
            last: None,
            announced: None,
            summary: Summary::default(),
        }
    }
}

impl Assembler {
    /// Takes the next line of a log; gives the sample it shows to be complete.
    #[inline]
    pub fn take(&mut self, number: u64, line: &Line) -> Option<TraceSample> {
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
            _ => None,
        };
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

    /// The last sample, and what there was.
    pub fn finish(mut self) -> (Option<TraceSample>, Summary) {
        let last = self.hand_out();
        self.summary.joint = self.joint.as_ref().map(|(interface, node)| named(interface, *node));
        (last, self.summary)
    }

    fn hand_out(&mut self) -> Option<TraceSample> {
        let sample = self.closed.take()?;
        self.summary.samples += 1;
        self.summary.answers += u64::from(sample.answer.is_some());
        Some(sample)
    }

    /// Whether the frame is of the joint that is followed; the first input decides which that is.
    #[inline]
    fn follows(&mut self, interface: &[u8], node: Node) -> bool {
        match &self.joint {
            Some((own, own_node)) => {
                let is_own = *own_node == node && **own == *interface;
                if !is_own {
                    self.other(interface, node);
                }
                is_own
            }
            None => {
                self.joint = Some((interface.into(), node));
                true
            }
        }
    }

    fn other(&mut self, interface: &[u8], node: Node) {
        self.summary.foreign += 1;
        let others = &mut self.summary.others;
        let known =
            |other: &(String, u8)| other.1 == node.number() && other.0.as_bytes() == interface;
        if others.len() < MOST_OTHERS && !others.iter().any(known) {
            others.push(named(interface, node));
        }
    }

    fn is_own(&self, interface: &[u8], node: Node) -> bool {
        self.joint.as_ref().is_some_and(|(own, number)| *number == node && **own == *interface)
    }

    #[inline]
    fn message(&mut self, number: u64, line: &Line, message: Message) -> Option<TraceSample> {
        let interface = line.interface;
        match message {
            Message::Motion(node, motion) => {
                if self.follows(interface, node) {
                    self.open.motion = motion;
                    self.heard_motion = true;
                    return self.hand_out();
                }
            }
            Message::Torque(node, torque) => {
                if self.follows(interface, node) {
                    self.open.torque = torque;
                    self.heard_torque = true;
                    return self.hand_out();
                }
            }
            Message::Seal(node, seal) => {
                if self.follows(interface, node) {
                    self.open.seal = seal;
                    return self.hand_out();
                }
            }
            Message::Surroundings(node, surroundings) => {
                if self.follows(interface, node) {
                    self.open.surroundings = surroundings;
                    return self.hand_out();
                }
            }
            // What the joint was told to do, and did, is no part of a sample.
            Message::Command(..) | Message::Telemetry(..) => {}
            Message::Entry(node, entry) => {
                if self.follows(interface, node) {
                    let before = self.hand_out();
                    self.entry(entry);
                    return before;
                }
            }
            Message::Sync(sync) => {
                let same_bus = |(own, _): &(Box<[u8]>, Node)| **own == *interface;
                if self.joint.as_ref().is_some_and(same_bus) {
                    let before = self.hand_out();
                    self.close(number, line.time_ns, sync);
                    return before;
                }
                self.summary.foreign += 1;
            }
            Message::Answer(node, answer) => {
                let own = self.is_own(interface, node);
                match &mut self.closed {
                    Some(closed) if own => closed.answer = Some(answer),
                    _ => self.summary.foreign += 1,
                }
            }
            Message::Status(node, status) => {
                let own = self.is_own(interface, node);
                match &mut self.closed {
                    Some(closed) if own => closed.status = Some(status),
                    _ => self.summary.foreign += 1,
                }
            }
        }
        None
    }

    fn entry(&mut self, entry: Entry) {
        match entry {
            Entry::Run(run) => {
                // What the slow PDOs said was of another run.
                self.open = TraceSample { run: Some(run), ..TraceSample::EMPTY };
                (self.heard_motion, self.heard_torque) = (false, false);
                (self.last, self.announced) = (None, Some(0));
            }
            Entry::Sequence(number) => self.announced = Some(number),
            Entry::JointKind(kind) => self.summary.kind = kind,
        }
    }

    #[inline]
    fn close(&mut self, number: u64, time_ns: u64, sync: Sync) {
        let sequence = self.count(sync);
        // A SYNC for others on the bus ends no sample of this joint.
        if self.heard_motion || self.heard_torque || self.open.fault.is_some() {
            let mut sample = TraceSample { line: number, time_ns, sequence, ..self.open };
            if sample.fault.is_some() {
                // Whichever frame it was: a slow PDO would else pass with its old value.
                sample.motion = NO_MOTION;
            }
            self.closed = Some(sample);
            self.open.motion = NO_MOTION;
            self.open.torque = NO_TORQUE;
            self.open.fault = None;
            (self.heard_motion, self.heard_torque) = (false, false);
        }
    }

    /// The number of the sample this SYNC ends. Without a number said in full, a loss of a multiple of
    /// 240 goes unseen.
    #[inline]
    fn count(&mut self, sync: Sync) -> u32 {
        let sequence = match (self.announced.take(), self.last) {
            (Some(announced), _) => announced,
            (None, Some((last, counter))) => {
                let round = u32::from(Sync::LAST);
                let passed = (round + u32::from(sync.counter) - u32::from(counter)) % round;
                last.wrapping_add(if passed == 0 { round } else { passed })
            }
            (None, None) => u32::from(sync.counter) - 1,
        };
        if let Some((last, _)) = self.last {
            self.summary.lost += u64::from(sequence.saturating_sub(last.saturating_add(1)));
        }
        self.last = Some((sequence, sync.counter));
        sequence
    }

    fn fault(&mut self, line: &Line, frame: &Frame, fault: FrameError) {
        let node = Node::new((frame.identifier() & 0x7F) as u8);
        let is_sync = frame.identifier() == 0x080;
        let own = |(own, number): &(Box<[u8]>, Node)| {
            **own == *line.interface && (is_sync || node == Some(*number))
        };
        match &self.joint {
            // The sample is not ended by it, and the next one's number shows that.
            Some(joint) if own(joint) && is_sync => {}
            Some(joint) if own(joint) => self.open.fault = Some(fault),
            _ => self.summary.foreign += 1,
        }
    }
}

fn named(interface: &[u8], node: Node) -> (String, u8) {
    (String::from_utf8_lossy(interface).into_owned(), node.number())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candump;

    /// The samples of a log, and what there was in it.
    fn assemble(log: &str) -> (Vec<TraceSample>, Summary) {
        let mut assembler = Assembler::default();
        let mut samples = Vec::new();
        for (at, line) in log.lines().enumerate() {
            let line = candump::parse(line.trim().as_bytes()).unwrap();
            samples.extend(assembler.take(at as u64 + 1, &line));
        }
        let (last, summary) = assembler.finish();
        samples.extend(last);
        (samples, summary)
    }

    /// 1.0 and 2.0, as a pair of words.
    const ONE_TWO: &str = "0000803F00000040";

    #[test]
    fn a_sync_ends_a_sample_and_answers_follow_it() {
        let (samples, summary) = assemble(&format!(
            "(1.000000) can0 601#2300200105000000
             (1.001000) can0 481#{ONE_TWO}
             (1.001000) can0 681#{ONE_TWO}
             (1.001000) can0 401#{ONE_TWO}
             (1.002000) can0 080#01
             (1.003000) can0 181#{ONE_TWO}
             (1.003000) can0 281#0000020000000000
             (1.004000) can0 481#{ONE_TWO}
             (1.004000) can0 681#{ONE_TWO}
             (1.005000) can0 080#02"
        ));
        assert_eq!(samples.len(), 2);
        let [first, second] = [samples[0], samples[1]];
        assert_eq!(
            (first.line, first.time_ns, first.run, first.sequence),
            (5, 1_002_000_000, Some(5), 0)
        );
        assert_eq!((first.motion.velocity_rad_s, first.motion.position_rad), (1.0, 2.0));
        assert_eq!(first.answer.unwrap().feed_forward_current_a, 2.0);
        assert_eq!(first.status.unwrap().flags.bits(), 1 << 17);
        assert_eq!((second.sequence, second.answer), (1, None));
        assert_eq!(second.seal.pressure_diff_pa, 2.0, "a slow PDO keeps its value");
        assert!(second.surroundings.temperature_c.is_nan());
        assert_eq!((summary.samples, summary.answers, summary.lost), (2, 1, 0));
        assert_eq!(summary.joint, Some(("can0".to_owned(), 1)));
    }

    #[test]
    fn what_is_lost_is_counted_and_what_is_damaged_spoils_one_sample() {
        let pair = format!("(1.0) can0 481#{ONE_TWO}\n(1.0) can0 681#{ONE_TWO}\n");
        let (samples, summary) = assemble(&format!(
            "{pair}(1.0) can0 080#EF
             {pair}(1.0) can0 080#02
             (1.0) can0 481#00112233
             (1.0) can0 681#{ONE_TWO}
             (1.0) can0 080#03
             (1.0) can0 481#{ONE_TWO}
             (1.0) can0 080#04
             (1.0) can0 080#05
             (1.0) can0 601#23002002F1010000
             {pair}(1.0) can0 080#12"
        ));
        let sequences: Vec<u32> = samples.iter().map(|sample| sample.sequence).collect();
        assert_eq!(sequences, [238, 241, 242, 243, 497]);
        assert_eq!(summary.lost, 2 + 252);
        let length = FrameError::Length { identifier: 0x481, found: 4, expected: 8 };
        assert_eq!(samples[2].fault, Some(length));
        assert!(samples[2].motion.velocity_rad_s.is_nan() && samples[3].fault.is_none());
        assert!(samples[3].torque.torque_nm.is_nan(), "a fast PDO that is missing is missing");
        assert!(samples[4].torque.torque_nm == 1.0);
    }

    #[test]
    fn one_joint_is_followed_and_the_rest_of_the_bus_passed_over() {
        let (samples, summary) = assemble(&format!(
            "(1.0) can0 080#01
             (1.0) can0 000#0102
             (1.0) can0 20000004#000C000000000000
             (1.0) can0 00000481#{ONE_TWO}
             (1.0) can0 481##0{ONE_TWO}
             (1.0) can0 482#{ONE_TWO}
             (1.0) can0 483#{ONE_TWO}
             (1.0) can1 482#{ONE_TWO}
             (1.0) can1 080#01
             (1.0) can0 181#{ONE_TWO}
             (1.0) can0 302#{ONE_TWO}
             (1.0) can0 182#{ONE_TWO}
             (1.0) can0 080#07"
        ));
        assert_eq!(samples.len(), 1);
        assert_eq!((samples[0].sequence, samples[0].run), (6, None));
        assert_eq!(summary.joint, Some(("can0".to_owned(), 2)));
        assert_eq!(summary.others, [("can0".to_owned(), 3), ("can1".to_owned(), 2)]);
        assert_eq!((summary.frames, summary.errors, summary.answers), (13, 1, 0));
    }
}
