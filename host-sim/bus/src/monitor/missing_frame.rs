//! The frame whose absence leaves a quantity without values, and the command that has it sent.
//!
//! A joint answers at each SYNC, and only in the network state *operational*. The reasons are checked in the order in which
//! a user has to remove them: the joint itself, SYNC, NMT start, the frame of the quantity.

use super::quantity::Quantity;
use crate::canopen::download_request;
use canopen_rs::Address;
use compensator_core::can::NodeId;
use compensator_core::can::cob_id;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::OperationObject;

/// Base of a heartbeat's identifier.
const HEARTBEAT: u16 = 0x700;
/// Identifier of network management (NMT) commands.
const NMT: u16 = 0x000;

/// State of a joint's traffic.
#[derive(Clone, Copy, Debug)]
pub struct Traffic<'a> {
    /// The joint.
    pub node: NodeId,
    /// Name of the bus, as in `--bus`.
    pub bus: &'a str,
    /// True if the joint sends no frame.
    pub is_silent: bool,
    /// True if SYNCs arrive.
    pub has_sync: bool,
    /// False if the joint reported another network state than *operational*.
    pub is_operational: bool,
    /// True if the joint receives its inputs from the bus (HIL), false if it has sensors; `None` before this was read.
    pub is_hil: Option<bool>,
}

/// A frame that does not arrive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingFrame {
    /// Its name.
    pub name: &'static str,
    /// Its identifier.
    pub identifier: u16,
    /// The command that has it sent, or that shows why it is not sent.
    pub command: String,
}

impl MissingFrame {
    /// Returns the frame that this quantity waits for.
    pub fn of(quantity: Quantity, traffic: &Traffic) -> Self {
        let number = u16::from(traffic.node.number());
        let frame = |name, identifier, command| Self { name, identifier, command };
        let replay = || traffic.tool("replay TRACE");
        if traffic.is_silent {
            return frame("heartbeat", HEARTBEAT + number, traffic.tool("params status"));
        }
        if !traffic.has_sync {
            // A replay switches a joint to HIL. A joint with sensors gets one SYNC; its master sends them regularly.
            let command = match traffic.is_hil {
                Some(false) => traffic.send(cob_id::SYNC, &[1]),
                Some(true) | None => replay(),
            };
            return frame("SYNC", cob_id::SYNC, command);
        }
        let (name, base, object) = match quantity {
            Quantity::Velocity if traffic.is_hil == Some(true) => {
                return frame("Motion", cob_id::TPDO_4 + number, replay());
            }
            _ if !traffic.is_operational => {
                return frame("NMT start", NMT, traffic.send(NMT, &[1, traffic.node.number()]));
            }
            Quantity::Velocity => ("Motion", cob_id::TPDO_4, index::TRANSMIT_MOTION),
            Quantity::Friction | Quantity::FeedForward => {
                ("Answer", cob_id::TPDO_1, index::TRANSMIT_ANSWER)
            }
            Quantity::Current | Quantity::Residual => {
                // Telemetry is usually off because its rate is 0.
                let rate = Address::new(index::OPERATION, OperationObject::TELEMETRY_EVERY);
                let command = traffic.write(rate, &[1]);
                return frame("Telemetry", cob_id::TPDO_3 + number, command);
            }
        };
        // The frame is switched off: its object holds an unused identifier.
        let identifier = base + number;
        let enabled = u32::from(identifier).to_le_bytes();
        frame(name, identifier, traffic.write(Address::new(object, 1), &enabled))
    }
}

impl Traffic<'_> {
    /// Returns a command of this program for the joint.
    fn tool(&self, command: &str) -> String {
        format!("host-sim {command} --bus {} --node-id {}", self.bus, self.node.number())
    }

    /// Returns the command that sends a frame: with can-utils on an interface of the kernel, else the frame itself.
    fn send(&self, identifier: u16, data: &[u8]) -> String {
        let data: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
        match self.bus.contains(':') || self.bus.starts_with("loop") {
            true => format!("send the frame {identifier:03X}#{data}"),
            false => format!("cansend {} {identifier:03X}#{data}", self.bus),
        }
    }

    /// Returns the command that writes an object of the joint.
    fn write(&self, at: Address, value: &[u8]) -> String {
        let request = download_request(at, value);
        self.send(cob_id::SDO_REQUEST + u16::from(self.node.number()), &request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::{Bus, Hub};
    use crate::joint::JointNode;
    use compensator_core::can::Frame;
    use joint_trace::CanFrame;

    const RUNNING: Traffic = Traffic {
        node: NodeId::FIRST,
        bus: "can0",
        is_silent: false,
        has_sync: true,
        is_operational: true,
        is_hil: None,
    };

    fn missing(quantity: Quantity, traffic: &Traffic) -> (&'static str, u16, String) {
        let MissingFrame { name, identifier, command } = MissingFrame::of(quantity, traffic);
        (name, identifier, command)
    }

    #[test]
    fn of_silent_joint_without_sync_or_start_names_first_reason() {
        let silent = Traffic { is_silent: true, has_sync: false, ..RUNNING };
        let status = "host-sim params status --bus can0 --node-id 1".to_owned();
        assert_eq!(missing(Quantity::Current, &silent), ("heartbeat", 0x701, status));
        let without_sync = Traffic { has_sync: false, is_operational: false, ..RUNNING };
        let replay = "host-sim replay TRACE --bus can0 --node-id 1".to_owned();
        assert_eq!(missing(Quantity::Friction, &without_sync), ("SYNC", 0x080, replay.clone()));
        let stopped = Traffic { is_operational: false, ..RUNNING };
        let start = "cansend can0 000#0101".to_owned();
        assert_eq!(missing(Quantity::Friction, &stopped), ("NMT start", 0, start));
        let with_sensors = Traffic { is_hil: Some(false), ..without_sync };
        let one = "cansend can0 080#01".to_owned();
        assert_eq!(missing(Quantity::Friction, &with_sensors), ("SYNC", 0x080, one));
        let hil = Traffic { is_hil: Some(true), is_operational: false, ..RUNNING };
        assert_eq!(missing(Quantity::Velocity, &hil), ("Motion", 0x481, replay));
    }

    #[test]
    fn commands_for_disabled_frames_are_accepted_by_a_driver() {
        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, None).unwrap());
        let mut port = hub.port();
        for quantity in [Quantity::Velocity, Quantity::Friction, Quantity::Residual] {
            let command = missing(quantity, &RUNNING).2;
            let (identifier, data) = command.rsplit_once(' ').unwrap().1.split_once('#').unwrap();
            let byte = |at: usize| u8::from_str_radix(&data[at..at + 2], 16).unwrap();
            let data: Vec<u8> = (0..data.len()).step_by(2).map(byte).collect();
            let identifier = u16::from_str_radix(identifier, 16).unwrap();
            let frame = Frame::new(identifier, &data).unwrap();
            port.send(&CanFrame::from(frame)).unwrap();
            let until_ns = port.now_ns() + 100_000_000;
            let mut frames = std::iter::from_fn(|| port.receive(until_ns).unwrap());
            let reply = frames
                .find_map(|received| received.frame.to_joint().filter(|f| f.identifier() == 0x581));
            // 60h confirms a download; 80h would refuse it.
            assert_eq!(reply.expect("a reply").data()[..4], [0x60, data[1], data[2], data[3]]);
        }
    }

    #[test]
    fn of_disabled_frame_gives_sdo_write_that_enables_it() {
        let node = NodeId::new(5).unwrap();
        let traffic = Traffic { node, ..RUNNING };
        for (quantity, name, identifier, command) in [
            (Quantity::Velocity, "Motion", 0x485, "cansend can0 605#2303180185040000"),
            (Quantity::Friction, "Answer", 0x185, "cansend can0 605#2300180185010000"),
            (Quantity::Residual, "Telemetry", 0x385, "cansend can0 605#2F01200501000000"),
        ] {
            assert_eq!(missing(quantity, &traffic), (name, identifier, command.to_owned()));
        }
        let adapter = Traffic { bus: "slcan:/dev/ttyACM0", ..traffic };
        let command = missing(Quantity::Current, &adapter).2;
        let parts = ["605#2F01200501000000"];
        crate::message::check("events", "frame for an adapter", &command, &parts);
    }
}
