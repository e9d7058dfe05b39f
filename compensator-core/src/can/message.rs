//! What the frames say: each as a struct, and all as one [`Message`] to emit and to parse.

use super::{Frame, FrameError, Node, cob_id};
use crate::flags::Flags;
use crate::joint_kind::JointKind;

/// Command byte of an expedited SDO download of four bytes.
const DOWNLOAD_4_BYTES: u8 = 0x23;

/// The object that says what is being logged or replayed: the first of the manufacturer's own.
const TRACE_OBJECT: u16 = 0x2000;

/// TPDO 4: how the joint moves; a joint in HIL is told it in the same frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Position, rad; NaN where it is not measured.
    pub position_rad: f32,
}

/// TPDO 5: what drives it; a joint in HIL is told it in the same frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torque {
    /// Measured torque, Nm. No model reads it: it is what a model explains.
    pub torque_nm: f32,
    /// Torque transmitted to the load, Nm; NaN where it is not measured.
    pub load_torque_nm: f32,
}

/// RPDO 3: what presses the seal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seal {
    /// Side load on the shaft, N; NaN where it is not measured.
    pub radial_force_n: f32,
    /// Outside minus inside pressure, Pa; NaN where it is not measured.
    pub pressure_diff_pa: f32,
}

impl Seal {
    /// The pressure in the unit of [`crate::Inputs`], MPa: one product, the same on driver and PC.
    pub fn pressure_diff_mpa(&self) -> f32 {
        self.pressure_diff_pa * 1e-6
    }
}

/// RPDO 4: what else changes friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Temperature of the seal, deg C; NaN where it is not measured.
    pub temperature_c: f32,
    /// The covariate this joint has of its own, in its own unit; NaN where there is none.
    pub auxiliary: f32,
}

/// SYNC: the sample is complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sync {
    /// 1..=[`Sync::LAST`], then 1 again.
    pub counter: u8,
}

impl Sync {
    /// The last number before 1.
    pub const LAST: u8 = 240;

    /// The SYNC that ends the sample of this number, which counts from 0.
    pub const fn of(sequence: u32) -> Self {
        Self { counter: (sequence % Self::LAST as u32) as u8 + 1 }
    }
}

/// TPDO 1: what the compensator makes of the sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// The model's friction torque, Nm.
    pub friction_torque_nm: f32,
    /// Current to add, A.
    pub feed_forward_current_a: f32,
}

/// TPDO 2: what happened on the way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// The compensator's flags. Bits of a newer driver stay as they are.
    pub flags: Flags,
    /// Number of the sample in its run, from 0.
    pub sequence: u32,
}

/// TPDO 3: what became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// Commanded current and compensation, limits applied, A.
    pub current_a: f32,
    /// Measured torque less the model's friction, Nm; NaN where no torque is measured.
    pub residual_torque_nm: f32,
}

/// RPDO 2: what the joint is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Torque-making current, A, before the compensation is added.
    pub current_a: f32,
    /// Velocity the joint is meant to have, in steps of [`Command::VELOCITY_STEP_RAD_S`], 24 bits.
    velocity_steps: i32,
    /// Counts every command by one, 255 to 0: a repeated one is no new command.
    pub counter: u8,
}

impl Command {
    /// Resolution of the velocity reference, rad/s.
    pub const VELOCITY_STEP_RAD_S: f32 = 1e-4;
    /// Largest velocity reference, rad/s.
    pub const VELOCITY_MAX_RAD_S: f32 = Self::LAST_STEP as f32 * Self::VELOCITY_STEP_RAD_S;
    const LAST_STEP: i32 = (1 << 23) - 1;

    /// A command. The velocity reference (rad/s) is rounded to its resolution and limited to its
    /// range; one that is not a number is no reference, and travels as the number below the range.
    pub fn new(current_a: f32, velocity_reference_rad_s: f32, counter: u8) -> Self {
        let steps = f64::from(velocity_reference_rad_s) / 1e-4;
        let half = if steps < 0.0 { -0.5 } else { 0.5 };
        let limited = ((steps + half) as i32).clamp(-Self::LAST_STEP, Self::LAST_STEP);
        let none = velocity_reference_rad_s.is_nan();
        let velocity_steps = if none { -Self::LAST_STEP - 1 } else { limited };
        Self { current_a, velocity_steps, counter }
    }

    /// A command from the two words of its frame.
    pub fn from_words([first, second]: [u32; 2]) -> Self {
        Self {
            current_a: f32::from_bits(first),
            // The sign of 24 bits is carried up by shifting them to the top and back.
            velocity_steps: (second << 8) as i32 >> 8,
            counter: (second >> 24) as u8,
        }
    }

    /// The velocity reference, rad/s; NaN where there is none.
    pub fn velocity_reference_rad_s(&self) -> f32 {
        if self.velocity_steps < -Self::LAST_STEP {
            return f32::NAN;
        }
        // Exact in 24 bits, and one rounding: the same number on driver and PC.
        self.velocity_steps as f32 * Self::VELOCITY_STEP_RAD_S
    }
}

/// SDO download to the trace object, 0x2000: what the samples that follow are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// Sub-index 1: a run of this number begins, and its samples count from 0.
    Run(u32),
    /// Sub-index 2: the next sample has this number.
    Sequence(u32),
    /// Sub-index 3: the units of the quantities.
    JointKind(JointKind),
}

/// A frame, understood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// TPDO 4.
    Motion(Node, Motion),
    /// TPDO 5.
    Torque(Node, Torque),
    /// RPDO 3.
    Seal(Node, Seal),
    /// RPDO 4.
    Surroundings(Node, Surroundings),
    /// SYNC, for every node.
    Sync(Sync),
    /// TPDO 1.
    Answer(Node, Answer),
    /// TPDO 2.
    Status(Node, Status),
    /// TPDO 3.
    Telemetry(Node, Telemetry),
    /// RPDO 2.
    Command(Node, Command),
    /// SDO download to the trace object.
    Entry(Node, Entry),
}

/// A frame of eight bytes for a node.
fn frame(base: u16, node: Node, bytes: [u8; 8]) -> Frame {
    Frame { identifier: base + u16::from(node.number()), length: 8, bytes }
}

fn pair(first: f32, second: f32) -> [u8; 8] {
    words(first.to_bits(), second.to_bits())
}

fn words(first: u32, second: u32) -> [u8; 8] {
    (u64::from(first) | u64::from(second) << 32).to_le_bytes()
}

/// The two words of a frame.
fn split(bytes: [u8; 8]) -> [u32; 2] {
    let both = u64::from_le_bytes(bytes);
    [both as u32, (both >> 32) as u32]
}

impl Message {
    /// The node it is for, or from; `None` for a SYNC, which is everyone's.
    pub const fn node(&self) -> Option<Node> {
        match *self {
            Self::Motion(node, _)
            | Self::Torque(node, _)
            | Self::Seal(node, _)
            | Self::Surroundings(node, _)
            | Self::Answer(node, _)
            | Self::Status(node, _)
            | Self::Telemetry(node, _)
            | Self::Command(node, _)
            | Self::Entry(node, _) => Some(node),
            Self::Sync(_) => None,
        }
    }

    /// The same for, or from, another node.
    #[must_use]
    pub const fn with_node(self, node: Node) -> Self {
        match self {
            Self::Motion(_, of) => Self::Motion(node, of),
            Self::Torque(_, of) => Self::Torque(node, of),
            Self::Seal(_, of) => Self::Seal(node, of),
            Self::Surroundings(_, of) => Self::Surroundings(node, of),
            Self::Answer(_, of) => Self::Answer(node, of),
            Self::Status(_, of) => Self::Status(node, of),
            Self::Telemetry(_, of) => Self::Telemetry(node, of),
            Self::Command(_, of) => Self::Command(node, of),
            Self::Entry(_, of) => Self::Entry(node, of),
            Self::Sync(of) => Self::Sync(of),
        }
    }

    /// The frame that says this.
    pub fn emit(&self) -> Frame {
        match *self {
            Self::Motion(node, of) => {
                frame(cob_id::TPDO_4, node, pair(of.velocity_rad_s, of.position_rad))
            }
            Self::Torque(node, of) => {
                frame(cob_id::TPDO_5, node, pair(of.torque_nm, of.load_torque_nm))
            }
            Self::Seal(node, of) => {
                frame(cob_id::RPDO_3, node, pair(of.radial_force_n, of.pressure_diff_pa))
            }
            Self::Surroundings(node, of) => {
                frame(cob_id::RPDO_4, node, pair(of.temperature_c, of.auxiliary))
            }
            Self::Sync(Sync { counter }) => {
                Frame { identifier: cob_id::SYNC, length: 1, bytes: [counter, 0, 0, 0, 0, 0, 0, 0] }
            }
            Self::Answer(node, of) => {
                frame(cob_id::TPDO_1, node, pair(of.friction_torque_nm, of.feed_forward_current_a))
            }
            Self::Status(node, of) => {
                frame(cob_id::TPDO_2, node, words(of.flags.bits(), of.sequence))
            }
            Self::Telemetry(node, of) => {
                frame(cob_id::TPDO_3, node, pair(of.current_a, of.residual_torque_nm))
            }
            Self::Command(node, of) => {
                let rest = of.velocity_steps as u32 & 0x00FF_FFFF | u32::from(of.counter) << 24;
                frame(cob_id::RPDO_2, node, words(of.current_a.to_bits(), rest))
            }
            Self::Entry(node, entry) => {
                let (sub_index, value) = match entry {
                    Entry::Run(number) => (1, number),
                    Entry::Sequence(number) => (2, number),
                    Entry::JointKind(kind) => (3, kind as u32),
                };
                let [low, high] = TRACE_OBJECT.to_le_bytes();
                let head = u32::from_le_bytes([DOWNLOAD_4_BYTES, low, high, sub_index]);
                frame(cob_id::SDO_REQUEST, node, words(head, value))
            }
        }
    }

    /// What a frame says.
    ///
    /// # Errors
    /// [`FrameError::Foreign`] for all else there is on a bus; the others for a frame that should
    /// have said something and does not.
    pub fn parse(frame: &Frame) -> Result<Self, FrameError> {
        let identifier = frame.identifier;
        let expect = |expected: u8| {
            let found = frame.length;
            let wrong = FrameError::Length { identifier, found, expected };
            if found == expected { Ok(()) } else { Err(wrong) }
        };
        if identifier == cob_id::SYNC {
            expect(1)?;
            let counter = frame.bytes[0];
            let legal = (1..=Sync::LAST).contains(&counter);
            return if legal {
                Ok(Self::Sync(Sync { counter }))
            } else {
                Err(FrameError::Counter(counter))
            };
        }
        let foreign = FrameError::Foreign(identifier);
        let node = Node::new((identifier & cob_id::NODE) as u8).ok_or(foreign)?;
        let [first, second] = split(frame.bytes);
        let (a, b) = (f32::from_bits(first), f32::from_bits(second));
        let message = match identifier & !cob_id::NODE {
            cob_id::TPDO_4 => Self::Motion(node, Motion { velocity_rad_s: a, position_rad: b }),
            cob_id::TPDO_5 => Self::Torque(node, Torque { torque_nm: a, load_torque_nm: b }),
            cob_id::RPDO_3 => Self::Seal(node, Seal { radial_force_n: a, pressure_diff_pa: b }),
            cob_id::RPDO_4 => {
                Self::Surroundings(node, Surroundings { temperature_c: a, auxiliary: b })
            }
            cob_id::TPDO_1 => {
                Self::Answer(node, Answer { friction_torque_nm: a, feed_forward_current_a: b })
            }
            cob_id::TPDO_2 => {
                let flags = Flags::from_bits_retain(first);
                Self::Status(node, Status { flags, sequence: second })
            }
            cob_id::TPDO_3 => {
                Self::Telemetry(node, Telemetry { current_a: a, residual_torque_nm: b })
            }
            cob_id::RPDO_2 => Self::Command(node, Command::from_words([first, second])),
            cob_id::SDO_REQUEST => {
                // Any other download is for another object, and legal.
                let [command, low, high, sub_index] = first.to_le_bytes();
                let ours = command == DOWNLOAD_4_BYTES
                    && u16::from_le_bytes([low, high]) == TRACE_OBJECT
                    && frame.length == 8;
                let entry = match sub_index {
                    1 if ours => Entry::Run(second),
                    2 if ours => Entry::Sequence(second),
                    3 if ours => Entry::JointKind(match second {
                        0 => JointKind::Revolute,
                        1 => JointKind::Prismatic,
                        other => return Err(FrameError::JointKind(other)),
                    }),
                    _ => return Err(foreign),
                };
                Self::Entry(node, entry)
            }
            _ => return Err(foreign),
        };
        expect(8)?;
        Ok(message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn node(number: u8) -> Node {
        Node::new(number).unwrap()
    }

    /// One of each, with words no two of which are alike.
    fn all(node: Node, words: [u32; 8]) -> [Message; 12] {
        let [a, b, c, d, e, f, g, h] = words.map(f32::from_bits);
        [
            Message::Motion(node, Motion { velocity_rad_s: a, position_rad: b }),
            Message::Torque(node, Torque { torque_nm: c, load_torque_nm: d }),
            Message::Seal(node, Seal { radial_force_n: e, pressure_diff_pa: f }),
            Message::Surroundings(node, Surroundings { temperature_c: g, auxiliary: h }),
            Message::Sync(Sync::of(words[0])),
            Message::Answer(node, Answer { friction_torque_nm: h, feed_forward_current_a: a }),
            Message::Status(
                node,
                Status { flags: Flags::from_bits_retain(words[1]), sequence: words[2] },
            ),
            Message::Telemetry(node, Telemetry { current_a: b, residual_torque_nm: g }),
            Message::Command(
                node,
                Command {
                    current_a: c,
                    velocity_steps: (words[5] as i32) >> 8,
                    counter: words[6] as u8,
                },
            ),
            Message::Entry(node, Entry::Run(words[3])),
            Message::Entry(node, Entry::Sequence(words[4])),
            Message::Entry(node, Entry::JointKind(JointKind::Prismatic)),
        ]
    }

    #[test]
    fn identifiers_and_bytes_are_as_documented() {
        let motion = Motion { velocity_rad_s: 1.0, position_rad: -2.0 };
        let frame = Message::Motion(node(4), motion).emit();
        assert_eq!(frame.identifier(), 0x484);
        assert_eq!(frame.data(), [0, 0, 0x80, 0x3F, 0, 0, 0, 0xC0]);
        let frame = Message::Sync(Sync::of(239)).emit();
        assert_eq!((frame.identifier(), frame.data()), (0x080, &[240][..]));
        assert_eq!(Sync::of(240).counter, 1);
        let status = Status { flags: Flags::SLEW_LIMITED, sequence: 0x0102_0304 };
        let frame = Message::Status(node(127), status).emit();
        assert_eq!(frame.identifier(), 0x2FF);
        assert_eq!(frame.data(), [0, 0, 2, 0, 4, 3, 2, 1]);
        let frame = Message::Entry(node(1), Entry::Run(7)).emit();
        assert_eq!(frame.identifier(), 0x601);
        assert_eq!(frame.data(), [0x23, 0x00, 0x20, 1, 7, 0, 0, 0]);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let parse =
            |identifier, data: &[u8]| Message::parse(&Frame::new(identifier, data).unwrap());
        let length =
            |identifier, found, expected| Err(FrameError::Length { identifier, found, expected });
        assert_eq!(parse(0x481, &[0; 7]), length(0x481, 7, 8));
        assert_eq!(parse(0x080, &[]), length(0x080, 0, 1));
        assert_eq!(parse(0x080, &[0]), Err(FrameError::Counter(0)));
        assert_eq!(parse(0x080, &[241]), Err(FrameError::Counter(241)));
        // Node 0, a frame of CiA 402, an emergency, a heartbeat, an SDO answer.
        for foreign in [0x480, 0x201, 0x081, 0x701, 0x581] {
            assert_eq!(parse(foreign, &[0; 8]), Err(FrameError::Foreign(foreign)));
        }
        let other = parse(0x601, &[0x23, 0x01, 0x20, 1, 7, 0, 0, 0]);
        assert_eq!(other, Err(FrameError::Foreign(0x601)));
        let kind = parse(0x601, &[0x23, 0x00, 0x20, 3, 2, 0, 0, 0]);
        assert_eq!(kind, Err(FrameError::JointKind(2)));
        assert!(Frame::new(0x800, &[]).is_none() && Frame::new(1, &[0; 9]).is_none());
        assert!(Node::new(0).is_none() && Node::new(128).is_none());
    }

    #[test]
    fn a_velocity_reference_is_rounded_limited_or_absent() {
        let reference = |velocity| Command::new(0.0, velocity, 0).velocity_reference_rad_s();
        for exact in [0.0, 1.5, -0.25, Command::VELOCITY_MAX_RAD_S, -Command::VELOCITY_MAX_RAD_S] {
            assert_eq!(reference(exact), exact);
        }
        assert!((reference(0.123_449) - 0.1234).abs() < 1e-6);
        assert_eq!(reference(f32::INFINITY), Command::VELOCITY_MAX_RAD_S);
        assert_eq!(reference(-1e9), -Command::VELOCITY_MAX_RAD_S);
        assert!(reference(f32::NAN).is_nan());
    }

    proptest! {
        #[test]
        fn what_was_emitted_is_parsed_to_the_bit(number in 1u8..=127, words in any::<[u32; 8]>()) {
            for message in all(node(number), words) {
                let frame = message.emit();
                let back = Message::parse(&frame).unwrap();
                // NaN is not equal to itself, its bits are.
                prop_assert_eq!(back.emit(), frame);
            }
        }

        #[test]
        fn garbage_never_panics(
            identifier in 0u16..=0x7FF, data in proptest::collection::vec(any::<u8>(), 0..=8),
        ) {
            let frame = Frame::new(identifier, &data).unwrap();
            if let Ok(message) = Message::parse(&frame) {
                prop_assert_eq!(message.emit(), frame);
            }
        }
    }
}
