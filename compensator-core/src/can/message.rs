//! Content of the frames: one struct per frame, and [`Message`] to emit and parse them.

use super::{Frame, FrameError, NodeId, cob_id};
use crate::flags::Flags;
use crate::joint_kind::JointKind;

/// Command byte of an expedited SDO download of four bytes.
const DOWNLOAD_4_BYTES: u8 = 0x23;

/// Object that describes the log or replay: the first index of the manufacturer-specific range.
const TRACE_OBJECT: u16 = 0x2000;

/// Makes the frames of two floats: a struct with these fields, and its conversion from and to the two words of the frame.
macro_rules! float_frames {
    ($($(#[$doc:meta])* $frame:ident {
        $(#[$first_doc:meta])* $first:ident: f32,
        $(#[$second_doc:meta])* $second:ident: f32,
    })*) => {
        $($(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $frame {
            $(#[$first_doc])* pub $first: f32,
            $(#[$second_doc])* pub $second: f32,
        }

        impl $frame {
            /// Creates the content from the two words of its frame.
            pub const fn from_words([first, second]: [u32; 2]) -> Self {
                Self { $first: f32::from_bits(first), $second: f32::from_bits(second) }
            }

            const fn words(&self) -> [u32; 2] {
                [self.$first.to_bits(), self.$second.to_bits()]
            }
        })*
    };
}

float_frames! {
    /// TPDO 4: motion of the joint. A joint in HIL receives its motion in the same frame.
    MotionFrame {
        /// Velocity, rad/s.
        velocity_rad_s: f32,
        /// Position, rad; NaN if not measured.
        position_rad: f32,
    }
    /// TPDO 5: torques at the joint. A joint in HIL receives its torques in the same frame.
    TorqueFrame {
        /// Measured torque, Nm. It is the quantity to be explained and not an input of any model.
        torque_nm: f32,
        /// Torque transmitted to the load, Nm; NaN if not measured.
        load_torque_nm: f32,
    }
    /// RPDO 3: load on the seal.
    SealFrame {
        /// Side load on the shaft, N; NaN if not measured.
        radial_force_n: f32,
        /// Outside minus inside pressure, Pa; NaN if not measured.
        pressure_diff_pa: f32,
    }
    /// RPDO 4: temperature and auxiliary covariate.
    SurroundingsFrame {
        /// Temperature of the seal, deg C; NaN if not measured.
        temperature_c: f32,
        /// Joint-specific covariate, in its own unit; NaN if there is none.
        auxiliary: f32,
    }
    /// TPDO 1: result of the compensator for the sample.
    AnswerFrame {
        /// The model's friction torque, Nm.
        friction_torque_nm: f32,
        /// Current to add, A.
        feed_forward_current_a: f32,
    }
    /// TPDO 3: resulting current and residual torque.
    TelemetryFrame {
        /// Commanded current and compensation, limits applied, A.
        current_a: f32,
        /// Measured torque minus the model's friction, Nm; NaN if no torque is measured.
        residual_torque_nm: f32,
    }
}

impl SealFrame {
    /// Pressure difference in the unit of [`crate::Inputs`], MPa. One product, identical on driver and PC.
    pub fn pressure_diff_mpa(&self) -> f32 {
        self.pressure_diff_pa * 1e-6
    }
}

/// SYNC: the sample is complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncFrame {
    /// 1..=[`SyncFrame::LAST`], then 1 again.
    pub counter: u8,
}

impl SyncFrame {
    /// Largest counter; 1 follows.
    pub const LAST: u8 = 240;

    /// The SYNC that completes the sample `sequence`, counted from 0.
    pub const fn of(sequence: u32) -> Self {
        Self { counter: (sequence % Self::LAST as u32) as u8 + 1 }
    }
}

/// TPDO 2: flags and number of the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatusFrame {
    /// Flags of the compensator. Unknown bits of a newer driver are kept.
    pub flags: Flags,
    /// Number of the sample in its run, from 0.
    pub sequence: u32,
}

/// RPDO 2: set-points of the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandFrame {
    /// Torque-producing current, A, before the compensation is added.
    pub current_a: f32,
    /// Reference velocity in steps of [`CommandFrame::VELOCITY_STEP_RAD_S`], 24 bits.
    velocity_steps: i32,
    /// Counter of commands, modulo 256. A frame with the last counter is a repetition.
    pub counter: u8,
}

impl CommandFrame {
    /// Resolution of the velocity reference, rad/s.
    pub const VELOCITY_STEP_RAD_S: f32 = 1e-4;
    /// Largest velocity reference, rad/s.
    pub const VELOCITY_MAX_RAD_S: f32 = Self::LAST_STEP as f32 * Self::VELOCITY_STEP_RAD_S;
    const LAST_STEP: i32 = (1 << 23) - 1;

    /// Creates a command. The velocity reference (rad/s) is rounded to its resolution and limited to its range.
    /// NaN means no reference; it is transmitted as the value below the range.
    pub fn new(current_a: f32, velocity_reference_rad_s: f32, counter: u8) -> Self {
        let steps = f64::from(velocity_reference_rad_s) / 1e-4;
        let half = if steps < 0.0 { -0.5 } else { 0.5 };
        let limited = ((steps + half) as i32).clamp(-Self::LAST_STEP, Self::LAST_STEP);
        let none = velocity_reference_rad_s.is_nan();
        let velocity_steps = if none { -Self::LAST_STEP - 1 } else { limited };
        Self { current_a, velocity_steps, counter }
    }

    /// Creates a command from the two words of its frame.
    pub fn from_words([first, second]: [u32; 2]) -> Self {
        Self {
            current_a: f32::from_bits(first),
            // Shifting left and back extends the sign of the 24 bits.
            velocity_steps: (second << 8) as i32 >> 8,
            counter: (second >> 24) as u8,
        }
    }

    fn words(&self) -> [u32; 2] {
        let rest = self.velocity_steps as u32 & 0x00FF_FFFF | u32::from(self.counter) << 24;
        [self.current_a.to_bits(), rest]
    }

    /// Velocity reference, rad/s; NaN if there is none.
    pub fn velocity_reference_rad_s(&self) -> f32 {
        if self.velocity_steps < -Self::LAST_STEP {
            return f32::NAN;
        }
        // Exact in 24 bits, then one rounding: identical on driver and PC.
        self.velocity_steps as f32 * Self::VELOCITY_STEP_RAD_S
    }
}

/// SDO download to the trace object, 0x2000: describes the samples that follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceEntry {
    /// Sub-index 1: a run with this number begins. Its samples count from 0.
    Run(u32),
    /// Sub-index 2: the next sample has this number.
    Sequence(u32),
    /// Sub-index 3: the units of the quantities.
    JointKind(JointKind),
}

/// A parsed frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// TPDO 4.
    Motion(NodeId, MotionFrame),
    /// TPDO 5.
    Torque(NodeId, TorqueFrame),
    /// RPDO 3.
    Seal(NodeId, SealFrame),
    /// RPDO 4.
    Surroundings(NodeId, SurroundingsFrame),
    /// SYNC, for every node.
    Sync(SyncFrame),
    /// TPDO 1.
    Answer(NodeId, AnswerFrame),
    /// TPDO 2.
    Status(NodeId, StatusFrame),
    /// TPDO 3.
    Telemetry(NodeId, TelemetryFrame),
    /// RPDO 2.
    Command(NodeId, CommandFrame),
    /// SDO download to the trace object.
    Entry(NodeId, TraceEntry),
}

/// Returns a frame of two words for a node.
fn frame(base: u16, node: NodeId, [first, second]: [u32; 2]) -> Frame {
    let bytes = (u64::from(first) | u64::from(second) << 32).to_le_bytes();
    Frame { identifier: base + u16::from(node.number()), length: 8, bytes }
}

/// The two words of a frame.
fn split(bytes: [u8; 8]) -> [u32; 2] {
    let both = u64::from_le_bytes(bytes);
    [both as u32, (both >> 32) as u32]
}

impl Message {
    /// Node ID of the sender or receiver; `None` for a SYNC, which is a broadcast.
    pub const fn node(&self) -> Option<NodeId> {
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

    /// Returns the message with another node ID.
    #[must_use]
    pub const fn with_node(self, node: NodeId) -> Self {
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

    /// Encodes the message as a frame.
    pub fn emit(&self) -> Frame {
        match *self {
            Self::Motion(node, of) => frame(cob_id::TPDO_4, node, of.words()),
            Self::Torque(node, of) => frame(cob_id::TPDO_5, node, of.words()),
            Self::Seal(node, of) => frame(cob_id::RPDO_3, node, of.words()),
            Self::Surroundings(node, of) => frame(cob_id::RPDO_4, node, of.words()),
            Self::Sync(SyncFrame { counter }) => {
                Frame { identifier: cob_id::SYNC, length: 1, bytes: [counter, 0, 0, 0, 0, 0, 0, 0] }
            }
            Self::Answer(node, of) => frame(cob_id::TPDO_1, node, of.words()),
            Self::Status(node, of) => frame(cob_id::TPDO_2, node, [of.flags.bits(), of.sequence]),
            Self::Telemetry(node, of) => frame(cob_id::TPDO_3, node, of.words()),
            Self::Command(node, of) => frame(cob_id::RPDO_2, node, of.words()),
            Self::Entry(node, entry) => {
                let (sub_index, value) = match entry {
                    TraceEntry::Run(number) => (1, number),
                    TraceEntry::Sequence(number) => (2, number),
                    TraceEntry::JointKind(kind) => (3, kind as u32),
                };
                let [low, high] = TRACE_OBJECT.to_le_bytes();
                let head = u32::from_le_bytes([DOWNLOAD_4_BYTES, low, high, sub_index]);
                frame(cob_id::SDO_REQUEST, node, [head, value])
            }
        }
    }

    /// Parses a frame.
    ///
    /// # Errors
    /// [`FrameError::Foreign`] for frames of other devices or protocols. The other errors are for joint frames
    /// with invalid content.
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
            let legal = (1..=SyncFrame::LAST).contains(&counter);
            return if legal {
                Ok(Self::Sync(SyncFrame { counter }))
            } else {
                Err(FrameError::Counter(counter))
            };
        }
        let foreign = FrameError::Foreign(identifier);
        let node = NodeId::new((identifier & cob_id::NODE) as u8).ok_or(foreign)?;
        let words = split(frame.bytes);
        let [first, second] = words;
        let message = match identifier & !cob_id::NODE {
            cob_id::TPDO_4 => Self::Motion(node, MotionFrame::from_words(words)),
            cob_id::TPDO_5 => Self::Torque(node, TorqueFrame::from_words(words)),
            cob_id::RPDO_3 => Self::Seal(node, SealFrame::from_words(words)),
            cob_id::RPDO_4 => Self::Surroundings(node, SurroundingsFrame::from_words(words)),
            cob_id::TPDO_1 => Self::Answer(node, AnswerFrame::from_words(words)),
            cob_id::TPDO_2 => {
                let flags = Flags::from_bits_retain(first);
                Self::Status(node, StatusFrame { flags, sequence: second })
            }
            cob_id::TPDO_3 => Self::Telemetry(node, TelemetryFrame::from_words(words)),
            cob_id::RPDO_2 => Self::Command(node, CommandFrame::from_words(words)),
            cob_id::SDO_REQUEST => {
                // Any other SDO request addresses another object and is legal.
                let [command, low, high, sub_index] = first.to_le_bytes();
                let ours = command == DOWNLOAD_4_BYTES
                    && u16::from_le_bytes([low, high]) == TRACE_OBJECT
                    && frame.length == 8;
                let entry = match sub_index {
                    1 if ours => TraceEntry::Run(second),
                    2 if ours => TraceEntry::Sequence(second),
                    3 if ours => TraceEntry::JointKind(match second {
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

    fn node(number: u8) -> NodeId {
        NodeId::new(number).unwrap()
    }

    /// One message of each kind, with distinct words.
    fn all(node: NodeId, words: [u32; 8]) -> [Message; 12] {
        let [a, b, c, d, e, f, g, h] = words.map(f32::from_bits);
        [
            Message::Motion(node, MotionFrame { velocity_rad_s: a, position_rad: b }),
            Message::Torque(node, TorqueFrame { torque_nm: c, load_torque_nm: d }),
            Message::Seal(node, SealFrame { radial_force_n: e, pressure_diff_pa: f }),
            Message::Surroundings(node, SurroundingsFrame { temperature_c: g, auxiliary: h }),
            Message::Sync(SyncFrame::of(words[0])),
            Message::Answer(node, AnswerFrame { friction_torque_nm: h, feed_forward_current_a: a }),
            Message::Status(
                node,
                StatusFrame { flags: Flags::from_bits_retain(words[1]), sequence: words[2] },
            ),
            Message::Telemetry(node, TelemetryFrame { current_a: b, residual_torque_nm: g }),
            Message::Command(
                node,
                CommandFrame {
                    current_a: c,
                    velocity_steps: (words[5] as i32) >> 8,
                    counter: words[6] as u8,
                },
            ),
            Message::Entry(node, TraceEntry::Run(words[3])),
            Message::Entry(node, TraceEntry::Sequence(words[4])),
            Message::Entry(node, TraceEntry::JointKind(JointKind::Prismatic)),
        ]
    }

    #[test]
    fn emit_matches_documented_identifiers_and_bytes() {
        let motion = MotionFrame { velocity_rad_s: 1.0, position_rad: -2.0 };
        let frame = Message::Motion(node(4), motion).emit();
        assert_eq!(frame.identifier(), 0x484);
        assert_eq!(frame.data(), [0, 0, 0x80, 0x3F, 0, 0, 0, 0xC0]);
        let frame = Message::Sync(SyncFrame::of(239)).emit();
        assert_eq!((frame.identifier(), frame.data()), (0x080, &[240][..]));
        assert_eq!(SyncFrame::of(240).counter, 1);
        let status = StatusFrame { flags: Flags::SLEW_LIMITED, sequence: 0x0102_0304 };
        let frame = Message::Status(node(127), status).emit();
        assert_eq!(frame.identifier(), 0x2FF);
        assert_eq!(frame.data(), [0, 0, 2, 0, 4, 3, 2, 1]);
        let frame = Message::Entry(node(1), TraceEntry::Run(7)).emit();
        assert_eq!(frame.identifier(), 0x601);
        assert_eq!(frame.data(), [0x23, 0x00, 0x20, 1, 7, 0, 0, 0]);
    }

    #[test]
    fn parse_with_invalid_frame_returns_specific_error() {
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
        assert!(NodeId::new(0).is_none() && NodeId::new(128).is_none());
    }

    #[test]
    fn velocity_reference_is_rounded_and_limited_or_nan() {
        let reference = |velocity| CommandFrame::new(0.0, velocity, 0).velocity_reference_rad_s();
        for exact in
            [0.0, 1.5, -0.25, CommandFrame::VELOCITY_MAX_RAD_S, -CommandFrame::VELOCITY_MAX_RAD_S]
        {
            assert_eq!(reference(exact), exact);
        }
        assert!((reference(0.123_449) - 0.1234).abs() < 1e-6);
        assert_eq!(reference(f32::INFINITY), CommandFrame::VELOCITY_MAX_RAD_S);
        assert_eq!(reference(-1e9), -CommandFrame::VELOCITY_MAX_RAD_S);
        assert!(reference(f32::NAN).is_nan());
    }

    proptest! {
        #[test]
        fn parse_of_emitted_frame_restores_every_bit(number in 1u8..=127, words in any::<[u32; 8]>()) {
            for message in all(node(number), words) {
                let frame = message.emit();
                let back = Message::parse(&frame).unwrap();
                // NaN is not equal to itself, its bits are.
                prop_assert_eq!(back.emit(), frame);
            }
        }

        #[test]
        fn parse_with_arbitrary_frame_never_panics(
            identifier in 0u16..=0x7FF, data in proptest::collection::vec(any::<u8>(), 0..=8),
        ) {
            let frame = Frame::new(identifier, &data).unwrap();
            if let Ok(message) = Message::parse(&frame) {
                prop_assert_eq!(message.emit(), frame);
            }
        }
    }
}
