//! Frames of drives of other makers: CAN Simple of ODrive, and the registers of moteus.
//!
//! A frame becomes a [`DriveReading`] in the drive's own units. The signals arrive in frames of their own (ODrive) or
//! together (moteus), so each is optional.
//!
//! Sources: `tools/odrive-cansimple.dbc` of ODrive firmware 0.5.6 and `can_simple_messages.hpp` of ODrive's ROS packages
//! for 0.6; `docs/protocol/can.md` and `docs/protocol/registers.md` of moteus firmware 1.0.0.

use crate::frame::CanFrame;

/// The protocol of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveProtocol {
    /// CAN Simple: identifiers of six bits for the node and five for the command.
    ODrive,
    /// Replies with registers, in classic or FD frames.
    Moteus,
}

/// Measured values in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveReading {
    /// Number of the drive.
    pub node: u8,
    /// Position, turns.
    pub position_turns: Option<f32>,
    /// Velocity, turns/s.
    pub velocity_turns_s: Option<f32>,
    /// Torque, Nm.
    pub torque_nm: Option<f32>,
    /// Current that makes the torque, A.
    pub current_a: Option<f32>,
}

/// Command `Get_Encoder_Estimates`: position and velocity.
const ENCODER_ESTIMATES: u32 = 0x09;
/// Command `Get_Iq`: set-point and measured current.
const IQ: u32 = 0x14;
/// Command `Get_Torques`, firmware 0.6: target and estimate. Firmware 0.5.6 answers a request for an analog input with it.
const TORQUES: u32 = 0x1C;

/// Registers of moteus.
const POSITION: u32 = 0x001;
const VELOCITY: u32 = 0x002;
const TORQUE: u32 = 0x003;

impl DriveProtocol {
    /// Returns the values in a frame; `None` if it has none in this protocol.
    pub fn read(self, frame: &CanFrame) -> Option<DriveReading> {
        match self {
            Self::ODrive => odrive(frame),
            Self::Moteus => moteus(frame),
        }
    }
}

fn odrive(frame: &CanFrame) -> Option<DriveReading> {
    let CanFrame::Data { identifier, extended: false, length: 8, bytes } = frame else {
        return None;
    };
    let [low, high] = bytes.as_chunks::<4>().0 else { return None };
    let (first, second) = (f32::from_le_bytes(*low), f32::from_le_bytes(*high));
    let empty = DriveReading { node: (identifier >> 5) as u8, ..DriveReading::default() };
    match identifier & 0x1F {
        ENCODER_ESTIMATES => Some(DriveReading {
            position_turns: Some(first),
            velocity_turns_s: Some(second),
            ..empty
        }),
        IQ => Some(DriveReading { current_a: Some(second), ..empty }),
        TORQUES => Some(DriveReading { torque_nm: Some(second), ..empty }),
        _ => None,
    }
}

fn moteus(frame: &CanFrame) -> Option<DriveReading> {
    let (CanFrame::Data { .. } | CanFrame::Flexible { .. }) = frame else { return None };
    let (identifier, _) = frame.identifier();
    // A set bit 15 asks for a reply, so the frame is a command.
    if identifier > 0x7FFF {
        return None;
    }
    let mut found = DriveReading { node: (identifier >> 8) as u8, ..DriveReading::default() };
    let mut rest = frame.data();
    while let [command, after @ ..] = rest {
        rest = after;
        match command {
            0x50 => {}
            0x20..=0x2F => {
                let kind = NumberKind::of(command >> 2 & 3);
                let count = match u32::from(command & 3) {
                    0 => variable_length(&mut rest)?,
                    count => count,
                };
                let first = variable_length(&mut rest)?;
                for register in first..first.checked_add(count)? {
                    let value = kind.take(&mut rest)?;
                    let place = match register {
                        POSITION => &mut found.position_turns,
                        VELOCITY => &mut found.velocity_turns_s,
                        TORQUE => &mut found.torque_nm,
                        _ => continue,
                    };
                    *place = Some(kind.in_unit(value, register));
                }
            }
            // Errors of single registers.
            0x30 | 0x31 => {
                variable_length(&mut rest)?;
                variable_length(&mut rest)?;
            }
            _ => return None,
        }
    }
    (found.velocity_turns_s.is_some() || found.torque_nm.is_some()).then_some(found)
}

/// The type of the numbers in a subframe.
#[derive(Clone, Copy)]
enum NumberKind {
    Int8,
    Int16,
    Int32,
    Float,
}

impl NumberKind {
    fn of(code: u8) -> Self {
        [Self::Int8, Self::Int16, Self::Int32, Self::Float][usize::from(code & 3)]
    }

    /// Takes a number from the front of the bytes. The least integer stands for NaN.
    fn take(self, bytes: &mut &[u8]) -> Option<f32> {
        fn front<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
            let (number, rest) = bytes.split_first_chunk::<N>()?;
            *bytes = rest;
            Some(*number)
        }
        let or_nan = |number: i32, least: i32| match number {
            number if number == least => f32::NAN,
            number => number as f32,
        };
        Some(match self {
            Self::Int8 => or_nan(i8::from_le_bytes(front(bytes)?).into(), i8::MIN.into()),
            Self::Int16 => or_nan(i16::from_le_bytes(front(bytes)?).into(), i16::MIN.into()),
            Self::Int32 => or_nan(i32::from_le_bytes(front(bytes)?), i32::MIN),
            Self::Float => f32::from_le_bytes(front(bytes)?),
        })
    }

    /// Returns a register's value in turns, turns/s or Nm.
    fn in_unit(self, value: f32, register: u32) -> f32 {
        let [int8, int16, int32] = match register {
            POSITION => [0.01, 1e-4, 1e-5],
            VELOCITY => [0.1, 2.5e-4, 1e-5],
            _ => [0.5, 0.01, 1e-3],
        };
        match self {
            Self::Int8 => value * int8,
            Self::Int16 => value * int16,
            Self::Int32 => value * int32,
            Self::Float => value,
        }
    }
}

/// Takes a number of seven bits a byte from the front of the bytes.
fn variable_length(bytes: &mut &[u8]) -> Option<u32> {
    let mut value = 0;
    for shift in [0, 7, 14, 21, 28] {
        let (byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u32::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candump;

    fn reading(protocol: DriveProtocol, frame: &str) -> Option<DriveReading> {
        let line = format!("(1.000000) can0 {frame}");
        protocol.read(&candump::parse(line.as_bytes()).expect("a line").frame)
    }

    #[test]
    fn read_with_frames_of_odrive_returns_their_signals() {
        // Node 3: 3 << 5 | 9 = 0x069. 1.5 turns, -2 turns/s.
        let encoder = reading(DriveProtocol::ODrive, "069#0000C03F000000C0").expect("estimates");
        assert_eq!((encoder.node, encoder.position_turns), (3, Some(1.5)));
        assert_eq!(encoder.velocity_turns_s, Some(-2.0));
        // Target 0.5 Nm, estimate 0.25 Nm.
        let torques = reading(DriveProtocol::ODrive, "07C#0000003F0000803E").expect("torques");
        assert_eq!((torques.node, torques.torque_nm, torques.current_a), (3, Some(0.25), None));
        let iq = reading(DriveProtocol::ODrive, "074#0000003F0000803E").expect("currents");
        assert_eq!((iq.torque_nm, iq.current_a), (None, Some(0.25)));
        for other in ["061#0000000008000000", "069#R", "069#0000C03F", "00000069#0000C03F000000C0"]
        {
            assert_eq!(reading(DriveProtocol::ODrive, other), None, "{other}");
        }
    }

    #[test]
    fn read_with_reply_of_moteus_returns_its_registers() {
        // The example of the protocol's documentation: 0.0080 turns, 0.064 turns/s, -1.44 Nm.
        let reply = reading(DriveProtocol::Moteus, "100##12404000a005000000170FF230D181400")
            .expect("a reply");
        assert_eq!(reply.node, 1);
        let close = |value: Option<f32>, expected: f32| {
            assert!((value.expect("a value") - expected).abs() < 1e-6, "{value:?} {expected}");
        };
        close(reply.position_turns, 0.008);
        close(reply.velocity_turns_s, 0.064);
        close(reply.torque_nm, -1.44);
        // Floats from register 1, with padding.
        let floats = "100##12F010000803F000000C00000003F505050";
        let reply = reading(DriveProtocol::Moteus, floats).expect("a reply");
        assert_eq!((reply.position_turns, reply.torque_nm), (Some(1.0), Some(0.5)));
        // The least integer is NaN.
        let missing = reading(DriveProtocol::Moteus, "100##1270100000080000050").expect("a reply");
        assert!(missing.velocity_turns_s.expect("a value").is_nan());
        // A command, a truncated reply, and a frame of another protocol.
        let others =
            ["00008001##101000A0720", "100##12404000A0050", "100##1FFFF", "123#1122334455667788"];
        for other in others {
            assert_eq!(reading(DriveProtocol::Moteus, other), None, "{other}");
        }
    }
}
